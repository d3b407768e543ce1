//! Plans the storage of form factors by the memory that they and all other data need.

use std::fmt;

use serde::Serialize;

use super::whole;
use crate::matrix::{ENTRIES_AT_ONCE, Layout, Precision};
use crate::mesh::Mesh;
use crate::parameter::{Named, Parameter, plainly};
use crate::setting::ticked;
use crate::solver::registry::SOLVERS;
use crate::threads;

/// The input of the plan, before form factors are computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StorageDemand {
    /// The number of patches n.
    pub n_patches: usize,
    /// The number of channels of the system.
    pub n_channels: usize,
    /// The number of threads that work at the same time.
    pub n_threads: usize,
    /// True if the rows are computed one by one, false if pairs are and the exchange areas are stored.
    pub by_rows: bool,
    /// True if rows are made symmetric afterwards: temporarily both matrices exist, and a third.
    pub repaired: bool,
    /// The number of whole matrices that exist beside this one at the same time.
    pub n_beside: u32,
    /// An upper bound of the share of entries that are not zero.
    pub density: f64,
    /// The memory already in use: program, scene, patches and the ray tracer's tree.
    pub used_byte: u64,
    /// The memory of the method beside the rows that it emits one by one.
    pub working_byte: u64,
    /// The memory of the image.
    pub image_byte: u64,
    /// The least 1 − ρ of the patches and the tolerance of the solver, or `None` if the form factors are the result.
    pub accuracy: Option<Accuracy>,
    /// The memory limit.
    pub limit_byte: u64,
    /// The number K of ranks that share the work: each stores its rows, or the tiles of exchange areas for these, if they are in memory.
    pub n_ranks: usize,
    /// The solver, if it uses the rows one after the other, so that each rank gathers all of them.
    pub rows_for: Option<&'static str>,
}

impl StorageDemand {
    /// Returns the greatest share of the tiles on and above the diagonal that a rank stores: those in its rows or its columns.
    #[must_use]
    pub fn rank_share(&self) -> f64 {
        let n_blocks = (self.n_patches as f64 / SIDE).ceil().max(1.0);
        let own = (n_blocks / self.n_ranks.max(1) as f64).ceil();
        own * (2.0 * n_blocks + 1.0 - own) / (n_blocks * (n_blocks + 1.0))
    }

    /// Returns the greatest share of the rows that a rank stores: its own, and parts of others in tiles at both ends.
    #[must_use]
    pub fn row_share(&self) -> f64 {
        let n_blocks = (self.n_patches as f64 / SIDE).ceil().max(1.0);
        let own = (n_blocks / self.n_ranks.max(1) as f64).ceil();
        ((own + 2.0) / n_blocks).min(1.0)
    }

    /// Returns the solver for which each of several ranks gathers all rows.
    fn gathered_for(&self) -> Option<&'static str> {
        self.rows_for.filter(|_| self.n_ranks > 1)
    }
}

/// The input that decides whether 24 bits of each form factor suffice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// The least 1 − ρ.
    pub absorption_min: f64,
    /// The requested relative residual.
    pub tolerance: f64,
}

/// The user's request; `None` leaves the choice to the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StorageWish {
    /// Dense or sparse tiles.
    pub layout: Layout,
    /// The precision, f32 or f64.
    pub precision: Option<Precision>,
    /// True for a disk, false for memory.
    pub on_disk: Option<bool>,
}

/// The planned storage of form factors, with its reason.
#[derive(Clone, Debug, PartialEq)]
pub struct StoragePlan {
    /// Dense or sparse tiles.
    pub layout: Layout,
    /// The precision, f32 or f64.
    pub precision: Precision,
    /// True if they go to a scratch file.
    pub on_disk: bool,
    /// Memory for computed rows that wait to be stored: part of `memory`.
    pub waiting_byte: u64,
    /// The estimate of the whole memory.
    pub memory: MemoryEstimate,
    /// The reason.
    pub reason: String,
}

/// The parts of an estimate, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MemoryEstimate {
    /// The measured memory of program, scene, patches and the ray tracer's tree.
    pub used_byte: u64,
    /// Form factors and their errors, as many of them as exist at a time; on a disk, the index of the tiles.
    pub matrix_byte: u64,
    /// Rows that are being computed, stored or read.
    pub rows_byte: u64,
    /// Vectors of patches, of methods and solvers.
    pub vectors_byte: u64,
    /// The image.
    pub image_byte: u64,
}

impl MemoryEstimate {
    /// Returns the sum.
    #[must_use]
    pub fn total_byte(&self) -> u64 {
        let parts = [
            self.used_byte,
            self.matrix_byte,
            self.rows_byte,
            self.vectors_byte,
            self.image_byte,
        ];
        parts.into_iter().fold(0, u64::saturating_add)
    }
}

/// A reason why form factors cannot be stored anywhere.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StorageError {
    /// Even the rows in work do not fit.
    TooSmall {
        /// The number of patches n.
        n_patches: usize,
        /// The memory needed.
        needed_byte: u64,
        /// The limit.
        limit_byte: u64,
    },
    /// The form factors were requested in memory, and do not fit.
    NotInMemory {
        /// The number of patches n.
        n_patches: usize,
        /// The memory needed.
        needed_byte: u64,
        /// The limit.
        limit_byte: u64,
    },
    /// The solver needs all rows on each rank, and they do not fit.
    NotOnEachRank {
        /// The number of patches n.
        n_patches: usize,
        /// The solver.
        solver: &'static str,
        /// The memory needed on each rank.
        needed_byte: u64,
        /// The limit.
        limit_byte: u64,
    },
}

impl std::error::Error for StorageError {}

impl fmt::Display for StorageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(&plainly))
    }
}

impl StorageError {
    /// Returns the error as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        let name = |parameter| named(parameter, None);
        let limit_name = name(Parameter::MemoryLimit);
        match self {
            Self::TooSmall {
                n_patches,
                needed_byte,
                limit_byte,
            } => format!(
                "{n_patches} patches require {} of memory even with form factors on a disk, above the limit of {}; raise {limit_name}, or use fewer {} or patches",
                byte_text(*needed_byte),
                byte_text(*limit_byte),
                name(Parameter::Threads)
            ),
            Self::NotInMemory {
                n_patches,
                needed_byte,
                limit_byte,
            } => format!(
                "the form factors of {n_patches} patches need {} of memory, and the limit is {}; use {} or disk, or raise {limit_name}",
                byte_text(*needed_byte),
                byte_text(*limit_byte),
                named(Parameter::Storage, Some("auto"))
            ),
            Self::NotOnEachRank {
                n_patches,
                solver,
                needed_byte,
                limit_byte,
            } => {
                let others = SOLVERS
                    .iter()
                    .filter(|entry| !entry.goes_by_rows)
                    .map(|entry| entry.name);
                format!(
                    "`{solver}` goes by rows, and all form factors of {n_patches} patches need {} of memory on each rank, above the limit of {}; use {}, or {}",
                    byte_text(*needed_byte),
                    byte_text(*limit_byte),
                    ticked(others),
                    named(Parameter::Storage, Some("disk"))
                )
            }
        }
    }
}

/// The greatest relative change of radiosities by rounding form factors to f32, times 1 − ρ: each form factor changes by at most 2⁻²⁴ of itself.
///
/// Equal patches are all rounded alike, and closed boxes of them showed half of this; rooms with a sphere showed a thousandth.
const F32_ERROR: f64 = 0.5 * f32::EPSILON as f64;

/// The share of the tolerance that rounding may use.
const F32_SHARE: f64 = 0.1;

/// The greatest memory for computed rows that wait: more does not speed up the work.
const WAITING_BYTE: u64 = 256_000_000;

/// Bytes of an entry that waits to be stored: its column, value and error.
const ENTRY_BYTE: f64 = 24.0;

/// The rows of a tile.
const SIDE: f64 = 64.0;

/// Plans the storage of form factors.
///
/// In memory as f64 if they fit. Else in memory as f32, if that changes the radiosities by less than a tenth of the solver's tolerance.
/// Else on a disk. A wish replaces its part of the choice.
/// Accuracy: an upper bound, provided that the density is one, except for the allocator's own losses.
///
/// # Errors
/// [`StorageError::TooSmall`], [`StorageError::NotInMemory`], [`StorageError::NotOnEachRank`].
pub fn plan_storage(demand: &StorageDemand, wish: StorageWish) -> Result<StoragePlan, StorageError> {
    let wide = wish.precision.unwrap_or(Precision::F64);
    let narrow_suffices = wish.precision.is_none()
        && demand
            .accuracy
            .is_some_and(|a| F32_ERROR <= F32_SHARE * a.tolerance * a.absorption_min);
    let plan_for = |precision, on_disk, reason: String| {
        let memory = estimate(demand, wish.layout, precision, on_disk);
        StoragePlan {
            layout: wish.layout,
            precision,
            on_disk,
            waiting_byte: 0,
            memory,
            reason,
        }
    };
    let limit = byte_text(demand.limit_byte);
    let in_memory = plan_for(wide, false, String::new());
    let needed = in_memory.memory.total_byte();
    let fits = |plan: &StoragePlan| plan.memory.total_byte() <= demand.limit_byte;
    // Half of the rest, which leaves some for the allocator.
    let said = |mut plan: StoragePlan, reason| {
        let left = demand.limit_byte - plan.memory.total_byte();
        plan.waiting_byte = (left / 2).min(WAITING_BYTE).min(all_rows_byte(demand));
        plan.memory.rows_byte += plan.waiting_byte;
        Ok(StoragePlan { reason, ..plan })
    };
    if wish.on_disk != Some(true) {
        if fits(&in_memory) {
            let reason = format!("all together takes at most {} of {limit}", byte_text(needed));
            return said(in_memory, reason);
        }
        let narrow = plan_for(Precision::F32, false, String::new());
        if narrow_suffices && fits(&narrow) {
            let reason = format!(
                "f64 would take {} of {limit}, f32 takes {}, and its rounding stays below a tenth of the tolerance",
                byte_text(needed),
                byte_text(narrow.memory.total_byte())
            );
            return said(narrow, reason);
        }
        let in_parts = StorageDemand {
            rows_for: None,
            ..*demand
        };
        let fits_in_parts = estimate(&in_parts, wish.layout, wide, false).total_byte() <= demand.limit_byte;
        if let Some(solver) = demand.gathered_for().filter(|_| fits_in_parts) {
            return Err(StorageError::NotOnEachRank {
                n_patches: demand.n_patches,
                solver,
                needed_byte: needed,
                limit_byte: demand.limit_byte,
            });
        }
        if wish.on_disk == Some(false) {
            return Err(StorageError::NotInMemory {
                n_patches: demand.n_patches,
                needed_byte: needed,
                limit_byte: demand.limit_byte,
            });
        }
    }
    let on_disk = plan_for(wide, true, String::new());
    if !fits(&on_disk) {
        return Err(StorageError::TooSmall {
            n_patches: demand.n_patches,
            needed_byte: on_disk.memory.total_byte(),
            limit_byte: demand.limit_byte,
        });
    }
    let mut reason = format!("in memory all together would take {} of {limit}", byte_text(needed));
    if wish.on_disk == Some(true) {
        "asked for".clone_into(&mut reason);
    } else if wish.precision.is_none() && demand.accuracy.is_some() && !narrow_suffices {
        reason += ", and 1 − ρ is too small for f32";
    }
    said(on_disk, reason)
}

/// Estimates the memory of all data.
fn estimate(demand: &StorageDemand, layout: Layout, precision: Precision, on_disk: bool) -> MemoryEstimate {
    let n = demand.n_patches as f64;
    let value = if precision == Precision::F32 { 4.0 } else { 8.0 };
    let (full, density) = (value + 4.0, demand.density.min(1.0));
    // Bytes for each place, an upper bound for any distribution of the entries: tiles stored in full are at least half full.
    // The places of a square tile take 16 bytes for each of its four strips with an entry, and 2 for each row of one with an entry; those of rows at most 4 for each entry.
    let place = |square: bool| {
        let places = if square {
            (576.0 / SIDE.powi(2)).min(18.0 * density)
        } else {
            4.0 * density
        };
        match layout {
            Layout::Dense => full,
            Layout::Sparse => full * density + places,
            Layout::Auto => full.min(2.0 * full * density + places),
        }
    };
    let (rows, upper) = (n * n * place(on_disk), 0.5 * n * (n + SIDE) * place(true));
    let n_tiles = (n / SIDE).ceil().powi(2);
    let (n_rows, mut n_upper) = if demand.by_rows { (1.0, 0.0) } else { (0.0, 1.0) };
    if demand.repaired {
        n_upper += 2.0;
    }
    let n_beside = f64::from(demand.n_beside);
    let slot = 40.0;
    // On a disk, the places of the tiles are in memory.
    let (rows, upper) = if on_disk {
        (slot * n_tiles, 0.5 * slot * n_tiles)
    } else {
        (rows, upper)
    };
    let gathered = match demand.gathered_for() {
        None => 0.0,
        Some(_) if n_upper > 0.0 => upper,
        Some(_) => rows,
    };
    let headers = if on_disk { 0.0 } else { 112.0 * n_tiles };
    let matrix =
        (n_rows * demand.row_share() + n_beside) * rows + n_upper * demand.rank_share() * upper + gathered + headers;
    // Columns that ranks send one another, once as received and once decoded.
    let sent = if demand.by_rows && demand.n_ranks > 1 {
        2.0 * ENTRY_BYTE * ENTRIES_AT_ONCE.max(SIDE * n * density)
    } else {
        0.0
    };
    // While 64 rows are cut into tiles, they take 24 to 32 bytes an entry more. At least 16 rows a thread wait.
    let in_work = SIDE * n * demand.density.min(1.0);
    let threads = demand.n_threads as f64;
    let waiting = threads * in_work * ENTRY_BYTE / 4.0;
    let repaired = if demand.repaired { 56.0 } else { 0.0 };
    let bands = if on_disk { 2.0 * SIDE * n * full } else { 0.0 };
    let rows_in_work = sent + waiting + in_work * (ENTRY_BYTE + 32.0 + 12.0) + threads * (in_work * repaired + bands);
    // Prepared polygons, some 25 vectors of a solver, and the partial sums of a pass.
    let n_pieces = (n / SIDE / 4.0).ceil().min(64.0);
    let vectors = n * (2048.0 + threads * 64.0 + 8.0 * demand.n_channels as f64 * (25.0 + n_pieces));
    MemoryEstimate {
        used_byte: demand.used_byte,
        matrix_byte: whole(matrix),
        rows_byte: whole(rows_in_work).saturating_add(demand.working_byte),
        vectors_byte: whole(vectors),
        image_byte: demand.image_byte,
    }
}

/// Returns the memory of all computed rows before they are stored, in bytes.
fn all_rows_byte(demand: &StorageDemand) -> u64 {
    let n = demand.n_patches as f64;
    whole(n * n * ENTRY_BYTE * demand.density.min(1.0))
}

/// Returns an upper bound of the share of entries that are not zero, by what [`facing_patches`] counted.
#[must_use]
pub fn facing_share(mesh: &Mesh, counts: &[usize]) -> f64 {
    let n_seen = counts.len() * mesh.n_patches();
    let n_facing: usize = counts.iter().sum();
    // A sample has an error; a bound that is a tenth too high does little harm.
    (1.1 * n_facing as f64 / n_seen.max(1) as f64).min(1.0)
}

/// Counts the patches that face each of up to 256, at equal distances in their order: either lies in front of the other's plane.
#[must_use]
pub fn facing_patches(mesh: &Mesh) -> Vec<usize> {
    const SAMPLES: usize = 256;
    let n = mesh.n_patches();
    let in_front = |i: usize, j: usize| {
        let (from, normal) = (mesh.patches[i].centroid, mesh.patches[i].normal);
        let mut corners = mesh.patches[j].corners.as_slice().iter();
        corners.any(|&corner| normal.dot(mesh.vertices[corner as usize] - from) > 0.0)
    };
    let samples: Vec<usize> = (0..n).step_by(n.div_ceil(SAMPLES).max(1)).collect();
    let of_sample = |i: usize| (0..n).filter(|&j| in_front(i, j) && in_front(j, i)).count();
    threads::collect_from(&samples, |&i| of_sample(i))
}

/// Returns a number of bytes as text.
#[must_use]
pub fn byte_text(byte: u64) -> String {
    let mut value = byte as f64;
    for unit in ["B", "KiB", "MiB"] {
        if value < 1024.0 {
            return format!("{value:.0} {unit}");
        }
        value /= 1024.0;
    }
    format!("{value:.1} GiB")
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
