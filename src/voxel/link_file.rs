//! Links on disk, written once in the order in which they are read.
//!
//! A file is a head of 56 bytes (a name of the layout, then a hash of the geometry) and one record for each chunk of surfels:
//! the lengths of `ends` and `bytes` and the three counts of the tally (u64 each), then `ends` (u32 each), `bytes`, and the CRC-32 of all that (u32); little-endian.
//! While it grows it has `.part` at the end of its name. The rest of a killed run is continued after its last whole record.

use std::ffi::OsString;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use sha2::{Digest, Sha256};

use super::VoxelError;
use super::discretize::VoxelScene;
use super::line::Direction;
use super::links::{Chunk, ROWS_PER_CHUNK, Tally, n_in_front};
use crate::input_file;
use crate::progress::Progress;
use crate::threads;

const LAYOUT: &[u8; 24] = b"radiosity voxel links 1\n";

/// Bytes of a record before `ends`.
const RECORD_HEAD: usize = 40;

/// Returns the number of chunks that are computed together before they are written, and read together before they are checked.
///
/// They are enough for all threads, and take little memory.
fn n_together() -> usize {
    8 * rayon::current_num_threads()
}

/// A file of links, open for reading at any chunk.
#[derive(Debug)]
pub(super) struct LinkFile {
    path: PathBuf,
    file: Mutex<File>,
    /// The begin of each record, and the end of the last.
    offsets: Vec<u64>,
    pub(super) tally: Tally,
    /// The first failure of a read; see [`LinkFile::failure`].
    failed: Mutex<Option<io::Error>>,
}

impl LinkFile {
    /// Opens the links of a geometry, and computes those missing in the file.
    pub(super) fn new(
        path: &Path,
        scene: &VoxelScene,
        directions: &[Direction],
        progress: &dyn Progress,
    ) -> Result<Self, VoxelError> {
        let failed = |source| VoxelError::LinkFile {
            path: path.to_owned(),
            source,
        };
        let work = Work {
            head: head(scene, directions),
            n_chunks: scene.n_surfels().div_ceil(ROWS_PER_CHUNK),
            n_in_front: n_in_front(scene, &directions.iter().map(Direction::vector)),
            scene,
            directions,
        };
        if path.exists() {
            let mut file = input_file::open(path).map_err(failed)?;
            let (offsets, tally) = work.whole_records(&mut file).map_err(failed)?;
            if offsets.len() == work.n_chunks + 1 {
                return Ok(Self::opened(path, file, offsets, tally));
            }
            // Never overwritten without a request.
            let wrong = if offsets.is_empty() {
                "it does not hold the links of this scene at this resolution and radius; name another file or remove it"
            } else {
                "it is damaged or not whole; remove it, and it is written anew"
            };
            return Err(failed(io::Error::new(io::ErrorKind::InvalidData, wrong)));
        }
        let part = part_of(path);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let growing = options.open(&part).map_err(failed)?;
        match growing.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let in_use = "another process is writing it; wait, or name another file";
                return Err(failed(io::Error::new(io::ErrorKind::WouldBlock, in_use)));
            }
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        let written = work.write_missing(growing, progress);
        let (complete, offsets, tally) = match written {
            Ok(Some(done)) => done,
            Ok(None) => return Err(VoxelError::Interrupted),
            Err(error) => {
                // Without room on the disk a part is of no use: it is removed.
                let _ = std::fs::remove_file(&part);
                return Err(failed(error));
            }
        };
        std::fs::rename(&part, path).map_err(failed)?;
        Ok(Self::opened(path, complete, offsets, tally))
    }

    fn opened(path: &Path, file: File, offsets: Vec<u64>, tally: Tally) -> Self {
        Self {
            path: path.to_owned(),
            file: Mutex::new(file),
            offsets,
            tally,
            failed: Mutex::new(None),
        }
    }

    /// Returns the size of the file.
    pub(super) fn n_bytes(&self) -> u64 {
        self.offsets.last().copied().unwrap_or(0)
    }

    /// Reads a chunk; if that fails, stores the reason and returns `None`.
    pub(super) fn chunk(&self, k: usize) -> Option<Chunk> {
        let read = || -> io::Result<Chunk> {
            let (start, end) = (self.offsets[k], self.offsets[k + 1]);
            let n = usize::try_from(end - start).map_err(io::Error::other)?;
            let mut record = vec![0; n];
            let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
            file.seek(SeekFrom::Start(start))?;
            file.read_exact(&mut record)?;
            drop(file);
            decode(&record)
        };
        match read() {
            Ok(chunk) => Some(chunk),
            Err(error) => {
                let mut failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
                failed.get_or_insert(error);
                None
            }
        }
    }

    /// Returns the first failure of a read since the last call.
    pub(super) fn failure(&self) -> Option<VoxelError> {
        let failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner).take();
        failed.map(|source| VoxelError::LinkFile {
            path: self.path.clone(),
            source,
        })
    }
}

fn part_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".part");
    path.with_file_name(name)
}

/// The links of one geometry in a file.
struct Work<'a> {
    head: Vec<u8>,
    n_chunks: usize,
    n_in_front: Vec<u64>,
    scene: &'a VoxelScene,
    directions: &'a [Direction],
}

impl Work<'_> {
    /// Computes and writes the missing links; returns `None` if the caller cancels that.
    fn write_missing(&self, mut file: File, progress: &dyn Progress) -> io::Result<Option<(File, Vec<u64>, Tally)>> {
        let (mut offsets, mut tally) = self.whole_records(&mut file)?;
        let mut end = offsets.last().copied().unwrap_or(0);
        file.set_len(end)?;
        file.seek(SeekFrom::Start(end))?;
        if offsets.is_empty() {
            file.write_all(&self.head)?;
            end = self.head.len() as u64;
            offsets.push(end);
        }
        progress.begin("links", self.n_chunks as u64);
        let first = offsets.len() - 1;
        progress.advance(first as u64);
        let n_together = n_together();
        for batch in (first..self.n_chunks).step_by(n_together) {
            let last = (batch + n_together).min(self.n_chunks);
            let records: Option<Vec<(Vec<u8>, Tally)>> = threads::collect(last - batch, |k| {
                if progress.is_cancelled() {
                    return None;
                }
                let chunk = Chunk::new(self.scene, self.directions, batch + k);
                progress.advance(1);
                Some((encode(&chunk), chunk.tally))
            })
            .into_iter()
            .collect();
            let Some(records) = records else {
                return Ok(None);
            };
            for (record, of_chunk) in records {
                file.write_all(&record)?;
                end += record.len() as u64;
                offsets.push(end);
                tally = tally.plus(of_chunk);
            }
        }
        file.sync_all()?;
        Ok(Some((file, offsets, tally)))
    }

    /// Returns the begins of the whole records, and the end of the last; none if the head differs.
    fn whole_records(&self, file: &mut File) -> io::Result<(Vec<u64>, Tally)> {
        let file_byte = file.metadata()?.len();
        file.seek(SeekFrom::Start(0))?;
        let mut reader = BufReader::new(file);
        let mut found = vec![0; self.head.len()];
        let mut tally = Tally::default();
        if !read_whole(&mut reader, &mut found)? || found != self.head {
            return Ok((Vec::new(), tally));
        }
        let mut offsets = vec![self.head.len() as u64];
        let mut end = self.head.len() as u64;
        let n_together = n_together();
        loop {
            let mut records = Vec::new();
            let mut left = file_byte.saturating_sub(end);
            while records.len() < n_together.min(self.n_chunks + 1 - offsets.len())
                && let Some(record) = next_record(&mut reader, left)?
            {
                left -= record.len() as u64;
                records.push(record);
            }
            let first = offsets.len() - 1;
            let tallies = threads::collect(records.len(), |k| self.tally_of(&records[k], first + k));
            for (record, of_chunk) in records.iter().zip(&tallies) {
                let Some(of_chunk) = of_chunk else {
                    return Ok((offsets, tally));
                };
                tally = tally.plus(*of_chunk);
                end += record.len() as u64;
                offsets.push(end);
            }
            if records.len() < n_together {
                return Ok((offsets, tally));
            }
        }
    }

    /// Returns the counts of a record of chunk k, if it holds links of this scene.
    ///
    /// A right checksum does not prove that, and the links are not checked again.
    fn tally_of(&self, record: &[u8], k: usize) -> Option<Tally> {
        let chunk = decode(record).ok()?;
        chunk.fits(self.scene, &self.n_in_front, k).then_some(chunk.tally)
    }
}

/// Reads the next record, if one of its stated length fits into the `left` bytes of the file.
fn next_record(reader: &mut impl Read, left: u64) -> io::Result<Option<Vec<u8>>> {
    let mut record = vec![0; RECORD_HEAD];
    if !read_whole(reader, &mut record)? {
        return Ok(None);
    }
    let (n_ends, n_bytes) = (number(&record, 0), number(&record, 8));
    // A length beyond the greatest of a chunk, or the rest of the file, is damage, and must not allocate as much memory.
    if n_ends > ROWS_PER_CHUNK as u64 || n_bytes > u64::from(u32::MAX) {
        return Ok(None);
    }
    let rest = 4 * n_ends + n_bytes + 4;
    if rest > left.saturating_sub(RECORD_HEAD as u64) {
        return Ok(None);
    }
    let rest = usize::try_from(rest).map_err(io::Error::other)?;
    record.resize(RECORD_HEAD + rest, 0);
    Ok(read_whole(reader, &mut record[RECORD_HEAD..])?.then_some(record))
}

/// Fills `bytes`; returns false if the file ends before.
fn read_whole(reader: &mut impl Read, bytes: &mut [u8]) -> io::Result<bool> {
    match reader.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// Returns the head of the file of a geometry, with a hash of everything that the links depend on.
fn head(scene: &VoxelScene, directions: &[Direction]) -> Vec<u8> {
    let mut hash = Sha256::new();
    let mut add = |numbers: &[i32]| numbers.iter().for_each(|n| hash.update(n.to_le_bytes()));
    add(&scene.grid.n_voxels);
    for (k, surfel) in scene.surfels.iter().enumerate() {
        add(&surfel.voxel());
        add(&[i32::from(surfel.facing_bits()), surfel.normal.cast_signed()]);
        if scene.is_thin(k) {
            add(&[i32::from(scene.nodes(k)), i32::from(scene.crossed(k))]);
        }
    }
    for normal in &scene.normals {
        add(&normal.integer);
    }
    for direction in directions {
        add(&direction.vector());
    }
    [&LAYOUT[..], hash.finalize().as_slice()].concat()
}

fn encode(chunk: &Chunk) -> Vec<u8> {
    let tally = chunk.tally;
    let lengths = [chunk.ends.len() as u64, chunk.bytes.len() as u64];
    let counts = [tally.n_links, tally.n_backs, tally.n_escaped];
    let mut record: Vec<u8> = lengths.into_iter().chain(counts).flat_map(u64::to_le_bytes).collect();
    record.extend(chunk.ends.iter().flat_map(|end| end.to_le_bytes()));
    record.extend_from_slice(&chunk.bytes);
    let sum = crc32fast::hash(&record);
    record.extend(sum.to_le_bytes());
    record
}

fn decode(record: &[u8]) -> io::Result<Chunk> {
    let damaged = || {
        io::Error::new(
            io::ErrorKind::InvalidData,
            "it is damaged; remove it, and it is written anew",
        )
    };
    let (content, sum) = record.split_last_chunk::<4>().ok_or_else(damaged)?;
    if content.len() < RECORD_HEAD || crc32fast::hash(content) != u32::from_le_bytes(*sum) {
        return Err(damaged());
    }
    let n_ends = usize::try_from(number(content, 0)).map_err(io::Error::other)?;
    let (ends, bytes) = content[RECORD_HEAD..]
        .split_at_checked(4 * n_ends)
        .ok_or_else(damaged)?;
    let ends: Vec<u32> = ends.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
    let consistent = ends.is_sorted() && ends.last().is_none_or(|&end| end as usize == bytes.len());
    if !consistent {
        return Err(damaged());
    }
    Ok(Chunk {
        ends,
        bytes: bytes.to_vec(),
        tally: Tally {
            n_links: number(content, 16),
            n_backs: number(content, 24),
            n_escaped: number(content, 32),
        },
    })
}

/// Returns the u64 at an offset in a record's head.
fn number(record: &[u8], at: usize) -> u64 {
    let mut bytes = [0; 8];
    bytes.copy_from_slice(&record[at..at + 8]);
    u64::from_le_bytes(bytes)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::sphere::{DiscreteSphere, SolidAngle};
    use super::*;
    use crate::progress::Silent;
    use crate::scene::builtin;

    /// A record with a right checksum and links of another scene is rejected: in a part it is written anew, a whole file is refused.
    #[test]
    fn records_with_right_checksums_and_wrong_links_are_not_believed() {
        let scene = VoxelScene::new(&builtin::build("cube", None).unwrap().scene, 7).unwrap();
        let sphere = DiscreteSphere::new(2, SolidAngle::Centre).unwrap();
        let directions = super::super::links::prepared(&sphere);
        let directory = tempfile::tempdir().unwrap();
        let [path, part] = ["l", "l.part"].map(|name| directory.path().join(name));
        drop(LinkFile::new(&path, &scene, &directions, &Silent).unwrap());
        let whole = std::fs::read(&path).unwrap();
        let head = &whole[..56];
        let right = Chunk::new(&scene, &directions, 0);
        let changed = |change: &dyn Fn(&mut Chunk)| {
            let mut chunk = right.clone();
            change(&mut chunk);
            encode(&chunk)
        };
        let same_length = |bytes: &mut Vec<u8>, with: &[u8]| bytes[..with.len()].copy_from_slice(with);
        for record in [
            changed(&|chunk| chunk.tally.n_links += 1),
            changed(&|chunk| chunk.tally.n_backs += 1),
            // To a surfel that does not exist.
            changed(&|chunk| same_length(&mut chunk.bytes, &[0xff, 0xff, 0xff, 0xff, 0x0f])),
            // A code without an end.
            changed(&|chunk| chunk.bytes.fill(0xff)),
            // More links than directions, or fewer.
            changed(&|chunk| chunk.bytes.fill(0)),
            changed(&|chunk| {
                chunk.bytes.clear();
                chunk.ends.fill(0);
            }),
            // One row too few, and none.
            changed(&|chunk| {
                chunk.ends.pop();
                chunk.bytes.truncate(chunk.ends[chunk.ends.len() - 1] as usize);
            }),
            encode(&Chunk::default()),
            // More bytes than exist, with a head that states them.
            [&u64::from(u32::MAX - 7).to_le_bytes(), &[0; 32][..]].concat(),
            [&0_u64.to_le_bytes()[..], &u64::from(u32::MAX).to_le_bytes(), &[0; 40]].concat(),
        ] {
            let file = [head, &record, &whole[56 + record.len().min(whole.len() - 56)..]].concat();
            std::fs::write(&path, &file).unwrap();
            let refused = LinkFile::new(&path, &scene, &directions, &Silent).unwrap_err();
            assert!(refused.to_string().contains("it is damaged"), "{refused}");
            assert_eq!(std::fs::read(&path).unwrap(), file, "left as it is");
            std::fs::rename(&path, &part).unwrap();
            drop(LinkFile::new(&path, &scene, &directions, &Silent).unwrap());
            assert!(std::fs::read(&path).unwrap() == whole && !part.exists());
        }
    }
}
