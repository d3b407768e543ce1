//! The records of a checkpoint's file.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

pub(super) const LAYOUT: &[u8; 24] = b"radiosity checkpoint 02\n";

/// The bytes of a file before its records.
pub(super) const HEAD: u64 = 56;

/// The bytes of a record beside its content.
pub(super) const RECORD: u64 = 20;

/// The bits of a piece's number within its part.
pub(super) const PIECE_BITS: u32 = 40;

/// The piece that is the key of a part.
pub(super) const PART_KEY: u64 = (1 << PIECE_BITS) - 1;

/// The place and the length of the content of each piece.
pub(super) type Pieces = BTreeMap<u64, (u64, u64)>;

/// Returns the content of a piece, or `None` if it is missing or damaged.
pub(super) fn content(file: &mut File, pieces: &Pieces, k: u64) -> Option<Vec<u8>> {
    let (start, length) = *pieces.get(&k)?;
    // The length has been checked against the file's.
    let mut content = vec![0; usize::try_from(length).ok()?];
    let mut sum = [0; 4];
    file.seek(SeekFrom::Start(start)).ok()?;
    file.read_exact(&mut content).ok()?;
    file.read_exact(&mut sum).ok()?;
    (checksum(k, &content) == u32::from_le_bytes(sum)).then_some(content)
}

/// Returns the number of piece k of a part.
pub(super) fn in_part(part: u32, k: u64) -> u64 {
    u64::from(part) << PIECE_BITS | k
}

/// Adds a record; the key of a part removes all earlier pieces of this part.
pub(super) fn insert(pieces: &mut Pieces, k: u64, place: (u64, u64)) {
    if k & PART_KEY == PART_KEY {
        let part = k >> PIECE_BITS;
        pieces.retain(|other, _| other >> PIECE_BITS != part);
    }
    pieces.insert(k, place);
}

pub(super) fn checksum(k: u64, content: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&k.to_le_bytes());
    hasher.update(&(content.len() as u64).to_le_bytes());
    hasher.update(content);
    hasher.finalize()
}

/// Returns the place and length of the content of every complete record, and the end of the last one.
pub(super) fn whole_records(file: &mut File) -> io::Result<(Pieces, u64)> {
    let file_byte = file.metadata()?.len();
    let mut pieces = Pieces::new();
    let mut end = HEAD;
    file.seek(SeekFrom::Start(HEAD))?;
    let mut reader = io::BufReader::with_capacity(1 << 16, file);
    while file_byte - end >= RECORD {
        let mut head = [0; 16];
        reader.read_exact(&mut head)?;
        let [k, length] = [0, 8].map(|at| {
            let mut number = [0; 8];
            number.copy_from_slice(&head[at..at + 8]);
            u64::from_le_bytes(number)
        });
        if length > file_byte - end - RECORD {
            break;
        }
        // The content is streamed: a record may be long, and a damaged one may claim to be.
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(&head);
        let mut left = length;
        let mut buffer = [0; 1 << 14];
        while left > 0 {
            let n = usize::try_from(left.min(buffer.len() as u64)).unwrap_or(buffer.len());
            reader.read_exact(&mut buffer[..n])?;
            hasher.update(&buffer[..n]);
            left -= n as u64;
        }
        let mut sum = [0; 4];
        reader.read_exact(&mut sum)?;
        if hasher.finalize() != u32::from_le_bytes(sum) {
            break;
        }
        insert(&mut pieces, k, (end + 16, length));
        end += RECORD + length;
    }
    Ok((pieces, end))
}
