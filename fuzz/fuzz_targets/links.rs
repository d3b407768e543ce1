//! Files of voxel links, whole and half-written, as they are and with their checksums made right.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use radiosity::matrix::operator::{Block, LinearOperator as _};
use radiosity::progress::Silent;
use radiosity::voxel::{DiscreteSphere, LinkOperator, Links, RowWeights, SolidAngle, VoxelScene};
use radiosity_fuzz::{CUBE, at, refused};

/// Two chunks of surfels.
static VOXELS: LazyLock<VoxelScene> = LazyLock::new(|| VoxelScene::new(&CUBE, 8).expect("voxels"));
static SPHERE: LazyLock<DiscreteSphere> =
    LazyLock::new(|| DiscreteSphere::new(1, SolidAngle::Centre).expect("a sphere"));

const HEAD: usize = 56;
const RECORD_HEAD: usize = 40;

fuzz_target!(|data: &[u8]| {
    for bytes in [data.to_vec(), repaired(data)] {
        for name in ["l", "l.part"] {
            attempt(name, &bytes);
        }
    }
});

fn attempt(name: &str, bytes: &[u8]) {
    let path = at("l");
    for old in ["l", "l.part"] {
        let _ = std::fs::remove_file(at(old));
    }
    std::fs::write(at(name), bytes).expect("room for an input");
    match Links::on_disk(&VOXELS, &SPHERE, &path, &Silent) {
        Ok(links) => {
            let operator = LinkOperator::new(&VOXELS, &SPHERE, &links, RowWeights::default());
            let x = Block::from_values(vec![1.0; VOXELS.n_surfels()], 1);
            let mut y = Block::zeros(VOXELS.n_surfels(), 1);
            operator.apply(&x, &mut y);
            assert!(links.failure().is_none(), "it was whole when it was opened");
            // Weights of a row sum to 1, to rounding; a link that leaves takes its share along.
            assert!(y.values().iter().all(|sum| (0.0..=1.0 + 1e-12).contains(sum)), "{:?}", y.values());
        }
        Err(error) => {
            refused(&path, &error.to_string());
            assert_eq!(name, "l", "a part is dropped where it is wrong: {error}");
        }
    }
}

/// Returns the file with the head of this geometry's, and the CRC-32 of every record as long as it says.
fn repaired(data: &[u8]) -> Vec<u8> {
    static RIGHT: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let path = at("right");
        let _ = std::fs::remove_file(&path);
        let links = Links::on_disk(&VOXELS, &SPHERE, &path, &Silent);
        drop(links.expect("a file of links"));
        std::fs::read(&path).expect("it was written")
    });
    let mut bytes = RIGHT[..HEAD].to_vec();
    bytes.extend_from_slice(data.get(HEAD..).unwrap_or_default());
    let mut start = HEAD;
    while let Some(head) = bytes.get(start..start + RECORD_HEAD) {
        let number = |at: usize| u64::from_le_bytes(head[at..at + 8].try_into().expect("8 bytes"));
        let length = number(0).saturating_mul(4).saturating_add(number(8)).min(1 << 40);
        let end = start + RECORD_HEAD + usize::try_from(length).expect("below 2^40");
        if end + 4 > bytes.len() {
            break;
        }
        let sum = crc32fast::hash(&bytes[start..end]);
        bytes[end..end + 4].copy_from_slice(&sum.to_le_bytes());
        start = end + 4;
    }
    bytes
}
