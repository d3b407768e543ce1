//! The links I(x, v), packed.
//!
//! The links of a surfel are stored for the directions in front of it, in the sphere's order, as differences: neighbouring
//! directions see neighbouring voxels. A code is 0 for a back, 1 for no hit, and otherwise 2 + the zigzag of the difference from the last
//! surfel seen; codes are written seven bits a byte, the lowest first, with the top bit set where more follow.

use std::ops::Range;
use std::path::Path;

use super::VoxelError;
use super::discretize::{Normal, VoxelScene};
use super::line::Direction;
use super::link_file::LinkFile;
use super::sight::Sight;
use super::sights::Watch;
use super::sphere::DiscreteSphere;
use crate::progress::Progress;
use crate::threads;

/// Surfels whose links are one unit of work and of storage.
pub(super) const ROWS_PER_CHUNK: usize = 256;

/// Directions in one batch: the surfels that a brick sees in them stay in a core's cache.
const DIRECTIONS_AT_ONCE: usize = 256;

const BACK: u32 = 0;
const ESCAPED: u32 = 1;
const FIRST: u32 = 2;

/// The packed links of [`ROWS_PER_CHUNK`] surfels.
#[derive(Clone, Debug, Default)]
pub(super) struct Chunk {
    /// The end of each row in `bytes`.
    pub(super) ends: Vec<u32>,
    pub(super) bytes: Vec<u8>,
    pub(super) tally: Tally,
}

/// The number of links, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(clippy::struct_field_names, reason = "counts are named n_ everywhere")]
pub(super) struct Tally {
    pub(super) n_links: u64,
    pub(super) n_backs: u64,
    pub(super) n_escaped: u64,
}

/// The place of the links between passes.
#[derive(Debug)]
enum Storage {
    Memory(Vec<Chunk>),
    Disk(LinkFile),
    /// None: each pass finds them again.
    Recompute,
}

/// All links of a scene: the first hit of each surfel in each direction in front of it.
///
/// They depend on geometry only: new materials and lights can use them again.
#[derive(Debug)]
pub struct Links {
    storage: Storage,
    directions: Vec<Direction>,
    tally: Tally,
}

impl Links {
    /// Finds all links and stores them in memory, on all threads; the result does not depend on their number.
    ///
    /// Where the caller cancels the work, links are missing.
    #[must_use]
    pub fn in_memory(scene: &VoxelScene, sphere: &DiscreteSphere, progress: &dyn Progress) -> Self {
        let directions = prepared(sphere);
        let n_chunks = scene.n_surfels().div_ceil(ROWS_PER_CHUNK);
        progress.begin("links", n_chunks as u64);
        let chunks: Vec<Chunk> = threads::collect(n_chunks, |k| {
            let chunk = if progress.is_cancelled() {
                Chunk::without_links(scene, k)
            } else {
                Chunk::new(scene, &directions, k)
            };
            progress.advance(1);
            chunk
        });
        let tally = chunks.iter().fold(Tally::default(), |sum, chunk| sum.plus(chunk.tally));
        Self {
            storage: Storage::Memory(chunks),
            directions,
            tally,
        }
    }

    /// Finds all links and streams them to a file, or reads them from it if it holds those of this geometry, resolution and radius.
    ///
    /// Each record has a checksum. A run that is killed leaves `path` with `.part` at its end, and the next one continues it; a run that fails,
    /// as for want of room, leaves nothing.
    ///
    /// # Errors
    /// [`VoxelError::LinkFile`]: the file system refuses, or `path` holds something else.
    pub fn on_disk(
        scene: &VoxelScene,
        sphere: &DiscreteSphere,
        path: &Path,
        progress: &dyn Progress,
    ) -> Result<Self, VoxelError> {
        let directions = prepared(sphere);
        let file = LinkFile::new(path, scene, &directions, progress)?;
        Ok(Self {
            tally: file.tally,
            storage: Storage::Disk(file),
            directions,
        })
    }

    /// Stores no links: each pass finds them again, in constant memory.
    ///
    /// The numbers of links that end at backs or leave the scene are unknown.
    #[must_use]
    pub fn recomputed(scene: &VoxelScene, sphere: &DiscreteSphere) -> Self {
        let counts = n_in_front(scene, &sphere.directions().iter().map(|d| d.vector));
        let n_links = scene.surfels.iter().map(|s| counts[s.normal as usize]).sum();
        Self {
            storage: Storage::Recompute,
            directions: prepared(sphere),
            tally: Tally {
                n_links,
                ..Tally::default()
            },
        }
    }

    /// Returns the number of links: directions in front of a surfel, over all surfels.
    #[must_use]
    pub fn n_links(&self) -> u64 {
        self.tally.n_links
    }

    /// Returns the number of links that end at a back face; `None` where links are [recomputed](Self::recomputed).
    #[must_use]
    pub fn n_backs(&self) -> Option<u64> {
        self.is_tallied().then_some(self.tally.n_backs)
    }

    /// Returns the number of links that leave the scene; `None` where links are [recomputed](Self::recomputed).
    #[must_use]
    pub fn n_escaped(&self) -> Option<u64> {
        self.is_tallied().then_some(self.tally.n_escaped)
    }

    fn is_tallied(&self) -> bool {
        !matches!(self.storage, Storage::Recompute)
    }

    /// Returns the memory, or the space on the disk, of the links.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        let of_chunk = |chunk: &Chunk| (chunk.bytes.capacity() + 4 * chunk.ends.capacity()) as u64;
        match &self.storage {
            Storage::Memory(chunks) => chunks.iter().map(of_chunk).sum(),
            Storage::Disk(file) => file.n_bytes(),
            Storage::Recompute => 0,
        }
    }

    /// Returns the first failure to read links since the last call; results computed since then are invalid.
    #[must_use]
    pub fn failure(&self) -> Option<VoxelError> {
        match &self.storage {
            Storage::Disk(file) => file.failure(),
            Storage::Memory(_) | Storage::Recompute => None,
        }
    }

    /// Calls `work` with the packed links of some surfels, all of one chunk.
    pub(super) fn with_chunk<T>(&self, scene: &VoxelScene, k: usize, work: impl FnOnce(&Chunk) -> T) -> Option<T> {
        match &self.storage {
            Storage::Memory(chunks) => Some(work(&chunks[k])),
            Storage::Disk(file) => file.chunk(k).map(|chunk| work(&chunk)),
            Storage::Recompute => Some(work(&Chunk::new(scene, &self.directions, k))),
        }
    }

    /// Returns whether single rows cost no more than their share of a chunk.
    pub(super) fn has_cheap_rows(&self) -> bool {
        matches!(self.storage, Storage::Memory(_))
    }
}

/// Counts, for each normal of a scene, the directions in front of it: the links of a surfel.
pub(super) fn n_in_front(scene: &VoxelScene, vectors: &(impl Iterator<Item = [i32; 3]> + Clone + Sync)) -> Vec<u64> {
    let of_normal = |normal: &Normal| vectors.clone().filter(|&v| is_in_front(normal, v)).count() as u64;
    threads::collect_from(&scene.normals, of_normal)
}

/// Prepares all directions of a sphere for walks.
pub(super) fn prepared(sphere: &DiscreteSphere) -> Vec<Direction> {
    sphere.directions().iter().map(|d| Direction::new(d.vector)).collect()
}

/// Returns whether a direction lies in front of a surface.
pub(super) fn is_in_front(normal: &Normal, vector: [i32; 3]) -> bool {
    normal.dot(vector) > 0
}

impl Tally {
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            n_links: self.n_links + other.n_links,
            n_backs: self.n_backs + other.n_backs,
            n_escaped: self.n_escaped + other.n_escaped,
        }
    }
}

impl Chunk {
    /// Returns a chunk whose surfels see nothing, in place of work that was cancelled.
    fn without_links(scene: &VoxelScene, k: usize) -> Self {
        let n_rows = ROWS_PER_CHUNK.min(scene.n_surfels() - k * ROWS_PER_CHUNK);
        Self {
            ends: vec![0; n_rows],
            ..Self::default()
        }
    }

    pub(super) fn new(scene: &VoxelScene, directions: &[Direction], k: usize) -> Self {
        let rows = k * ROWS_PER_CHUNK..((k + 1) * ROWS_PER_CHUNK).min(scene.n_surfels());
        let mut chunk = Self::default();
        for row in Row::of(scene, directions, rows) {
            chunk.bytes.extend_from_slice(&row.bytes);
            let end = u32::try_from(chunk.bytes.len()).expect("256 rows of at most 600,000 links of 5 bytes");
            chunk.ends.push(end);
            chunk.tally = chunk.tally.plus(row.tally);
        }
        chunk.bytes.shrink_to_fit();
        chunk
    }

    /// Returns whether these can be the links of chunk k.
    ///
    /// Each of its surfels must have one for each direction in front (`n_in_front`, by normal), to surfels that exist, and as many of each kind as the tally has.
    pub(super) fn fits(&self, scene: &VoxelScene, n_in_front: &[u64], k: usize) -> bool {
        let rows = k * ROWS_PER_CHUNK..((k + 1) * ROWS_PER_CHUNK).min(scene.n_surfels());
        if self.ends.len() != rows.len() {
            return false;
        }
        let mut found = Tally::default();
        for (row, surfel) in rows.enumerate() {
            let n_links = n_in_front[scene.surfels[surfel].normal as usize];
            match tally_of(self.row(row), surfel, scene.n_surfels()) {
                Some(tally) if tally.n_links == n_links => found = found.plus(tally),
                _ => return false,
            }
        }
        found == self.tally
    }

    pub(super) fn row(&self, row: usize) -> &[u8] {
        let start = if row == 0 { 0 } else { self.ends[row - 1] };
        &self.bytes[start as usize..self.ends[row] as usize]
    }
}

/// The packed links of a surfel.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) bytes: Vec<u8>,
    pub(super) tally: Tally,
    /// The last surfel seen, or the row's own at first.
    last: u32,
}

impl Row {
    /// Finds the links of some surfels, brick by brick.
    pub(super) fn of(scene: &VoxelScene, directions: &[Direction], surfels: Range<usize>) -> Vec<Self> {
        let empty = |surfel| Self {
            bytes: Vec::new(),
            tally: Tally::default(),
            last: u32::try_from(surfel).expect("surfels are counted in 32 bits"),
        };
        let mut rows: Vec<Self> = surfels.clone().map(empty).collect();
        let mut sights = Vec::new();
        let mut rest = surfels.clone();
        while !rest.is_empty() {
            let of_brick = scene.of_one_brick(rest.clone());
            let watch = Watch::new(scene, of_brick.clone());
            let rows = &mut rows[of_brick.start - surfels.start..of_brick.end - surfels.start];
            for some in directions.chunks(DIRECTIONS_AT_ONCE) {
                sights.clear();
                sights.resize(rows.len() * some.len(), None);
                watch.look(some, &mut sights);
                for (row, seen) in rows.iter_mut().zip(sights.chunks(some.len())) {
                    seen.iter().flatten().for_each(|&sight| row.push(sight));
                }
            }
            rest.start = of_brick.end;
        }
        rows
    }

    fn push(&mut self, sight: Sight) {
        self.tally.n_links += 1;
        let code = match sight {
            Sight::Surfel(seen) => {
                let code = zigzag(seen.wrapping_sub(self.last).cast_signed());
                self.last = seen;
                u64::from(code) + u64::from(FIRST)
            }
            Sight::Back => {
                self.tally.n_backs += 1;
                u64::from(BACK)
            }
            Sight::Escaped => {
                self.tally.n_escaped += 1;
                u64::from(ESCAPED)
            }
        };
        push(&mut self.bytes, code);
    }
}

/// Calls `seen` with the number of each link of surfel `surfel` that ends at the front of a surfel, and that surfel, in the links' order.
#[inline]
pub(super) fn for_each_seen(row: &[u8], surfel: usize, seen: impl FnMut(usize, usize)) {
    for_each_end(row, surfel, seen, |_| {});
}

/// As [`for_each_seen`], and calls `unseen` with the number of each link that ends at a back or leaves the scene.
#[inline]
pub(super) fn for_each_end(
    row: &[u8],
    surfel: usize,
    mut seen: impl FnMut(usize, usize),
    mut unseen: impl FnMut(usize),
) {
    #[expect(clippy::cast_possible_truncation, reason = "surfels are counted in 32 bits")]
    let mut last = surfel as u32;
    let mut bytes = row.iter();
    let mut k = 0;
    while let Some(&byte) = bytes.next() {
        let mut code = u64::from(byte);
        if byte >= 128 {
            code &= 127;
            let mut shift = 7;
            for &more in bytes.by_ref() {
                code |= u64::from(more & 127) << shift;
                if more < 128 {
                    break;
                }
                shift += 7;
            }
        }
        if code >= u64::from(FIRST) {
            #[expect(clippy::cast_possible_truncation, reason = "a code is 2 + 32 bits")]
            let difference = unzigzag((code - u64::from(FIRST)) as u32);
            last = last.wrapping_add(difference.cast_unsigned());
            seen(k, last as usize);
        } else {
            unseen(k);
        }
        k += 1;
    }
}

/// Counts the links of a row; `None` for bytes that [`encode_row`] does not write.
fn tally_of(row: &[u8], surfel: usize, n_surfels: usize) -> Option<Tally> {
    let mut tally = Tally::default();
    let mut last = u32::try_from(surfel).ok()?;
    let mut bytes = row.iter();
    while let Some(&first) = bytes.next() {
        let mut code = u64::from(first & 127);
        let (mut goes_on, mut shift) = (first >= 128, 7);
        while goes_on {
            let more = *bytes.next()?;
            // Five bytes hold the greatest code.
            if shift >= 35 {
                return None;
            }
            code |= u64::from(more & 127) << shift;
            (goes_on, shift) = (more >= 128, shift + 7);
        }
        tally.n_links += 1;
        match u32::try_from(code) {
            Ok(BACK) => tally.n_backs += 1,
            Ok(ESCAPED) => tally.n_escaped += 1,
            _ => {
                let difference = unzigzag(u32::try_from(code - u64::from(FIRST)).ok()?);
                last = last.wrapping_add(difference.cast_unsigned());
                if last as usize >= n_surfels {
                    return None;
                }
            }
        }
    }
    Some(tally)
}

fn push(bytes: &mut Vec<u8>, mut code: u64) {
    while code >= 128 {
        #[expect(clippy::cast_possible_truncation, reason = "the lowest seven bits")]
        bytes.push(code as u8 & 127 | 128);
        code >>= 7;
    }
    #[expect(clippy::cast_possible_truncation, reason = "below 128")]
    bytes.push(code as u8);
}

fn zigzag(difference: i32) -> u32 {
    (difference << 1 ^ difference >> 31).cast_unsigned()
}

fn unzigzag(code: u32) -> i32 {
    (code >> 1).cast_signed() ^ -((code & 1).cast_signed())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_read_back() {
        let seen = [7_u32, 7, 8, 70, u32::MAX, 0, 5, 1 << 31, 3];
        let mut row = Vec::new();
        let mut last = 12_u32;
        for (k, &s) in seen.iter().enumerate() {
            push(
                &mut row,
                u64::from(zigzag(s.wrapping_sub(last).cast_signed())) + u64::from(FIRST),
            );
            last = s;
            if k % 3 == 0 {
                push(&mut row, u64::from(BACK));
                push(&mut row, u64::from(ESCAPED));
            }
        }
        let mut read = Vec::new();
        for_each_seen(&row, 12, |k, s| read.push((k, s)));
        let places = [0, 3, 4, 5, 8, 9, 10, 13, 14];
        let expected: Vec<_> = places.into_iter().zip(seen.map(|s| s as usize)).collect();
        assert_eq!(read, expected);
    }
}
