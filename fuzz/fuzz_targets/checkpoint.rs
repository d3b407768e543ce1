//! Checkpoints of form factors, as they are and with their checksums made right: the work goes on from them, or anew.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use radiosity::checkpoint::Checkpoint;
use radiosity::form_factor::{FormFactorMethod, Input, MethodSettings, RAYS, method};
use radiosity::matrix::StorageChoice;
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Progress;
use radiosity::visibility::brute_force::BruteForce;
use radiosity_fuzz::{CUBE, at, put, refused};

const KEY: &[u8; 32] = b"the key of all seeds is this key";
const HEAD: usize = 56;
const RECORD_HEAD: usize = 16;

/// More rows than one piece has.
static FINE: LazyLock<Mesh> = LazyLock::new(|| Mesh::new(&CUBE, Subdivision::Uniform(2)).expect("a mesh"));

/// One method for each way of cutting work into pieces: rows, rows of pairs, runs of rows.
const METHODS: [&str; 3] = ["sr", "centre", "exact"];

struct Kept(Checkpoint);

impl Progress for Kept {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
    fn checkpoint(&self) -> Option<&Checkpoint> {
        Some(&self.0)
    }
}

fuzz_target!(|data: &[u8]| {
    // The first byte chooses the method.
    let Some((choice, data)) = data.split_first() else { return };
    let name = METHODS[usize::from(*choice) % METHODS.len()];
    let mut settings = MethodSettings::default();
    if name == "sr" {
        settings.values.set(&RAYS, 4_u64);
    }
    let method = method(name, &settings).expect("a method");
    attempt(method.as_ref(), data);
    attempt(method.as_ref(), &repaired(data));
});

fn attempt(method: &dyn FormFactorMethod, bytes: &[u8]) {
    let path = put("checkpoint", bytes);
    match Checkpoint::open(&path, KEY) {
        Ok(checkpoint) => {
            let kept = Kept(checkpoint);
            let visibility = BruteForce::new(&CUBE);
            let input = Input {
                scene: &CUBE,
                mesh: &FINE,
                visibility: &visibility,
                unoccluded: true,
            };
            match method.compute(input, StorageChoice::default(), &kept) {
                Ok(computed) => {
                    assert_eq!(computed.factors.n_rows(), FINE.n_patches());
                    assert!(computed.factors.row_sums().iter().all(|sum| sum.is_finite()));
                }
                Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
            }
            assert!(kept.0.failure().is_none());
        }
        Err(error) => {
            refused(&path, &error.to_string());
            assert_eq!(std::fs::read(at("checkpoint")).expect("it is left"), bytes, "what is refused stays as it is");
        }
    }
}

/// Returns the file with the head of this work's, and the CRC-32 of every record as long as it says.
fn repaired(data: &[u8]) -> Vec<u8> {
    let mut bytes = [&b"radiosity checkpoint 01\n"[..], KEY].concat();
    bytes.extend_from_slice(data.get(HEAD..).unwrap_or_default());
    let mut start = HEAD;
    while let Some(head) = bytes.get(start..start + RECORD_HEAD) {
        let length = u64::from_le_bytes(head[8..].try_into().expect("8 bytes")).min(1 << 40);
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
