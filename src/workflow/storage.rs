//! The storage of form factors: the request, and the choice by the plan.

use std::path::PathBuf;
use std::sync::Arc;

use sha2::{Digest as _, Sha256};

use super::{Context, Model, WorkflowError};
use crate::matrix::{Among, Layout, Place, Precision, Scratch, StorageChoice, Team};
use crate::plan::{
    Accuracy, StorageDemand, StoragePlan, StorageWish, byte_text, facing_patches, facing_share, plan_storage,
};
use crate::report::{memory_available_byte, memory_used_byte};
use crate::solver::registry;

/// The share of the available memory that is used by default.
const SHARE: f64 = 0.8;

/// How form factors are laid out, and where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Storage {
    /// In memory if they fit, else on a disk; dense or sparse tile by tile.
    #[default]
    Auto,
    /// In memory, every entry of each tile.
    Dense,
    /// In memory, the upper triangle of the exchange areas; rows are averaged and balanced for it.
    Symmetric,
    /// In memory, the entries that are not zero.
    Sparse,
    /// In a scratch file.
    Disk,
}

/// The memory limit, and the storage of form factors.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// The memory limit, in bytes; `None`: 80 % of the available memory.
    pub limit_byte: Option<u64>,
    /// Layout and place.
    pub storage: Storage,
    /// The precision; `None`: f64, or f32 where that keeps a system in memory and suffices for its tolerance.
    pub precision: Option<Precision>,
    /// The directory of the scratch file; `None`: that of the output, else the system's for temporary files.
    pub scratch: Option<PathBuf>,
    /// The number of other ranks on this machine that share the available memory.
    pub n_others: usize,
}

impl Memory {
    /// Returns the memory limit, in bytes.
    #[must_use]
    pub fn limit(&self) -> u64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a number that is not negative"
        )]
        let share = |available: u64| (available as f64 * SHARE / (self.n_others + 1) as f64) as u64;
        // The program's own memory is no part of the available memory, and counts as used.
        let by_default = || {
            let used = memory_used_byte().unwrap_or(0);
            memory_available_byte().map_or(u64::MAX, |available| share(available).saturating_add(used))
        };
        self.limit_byte.unwrap_or_else(by_default)
    }

    fn wish(&self) -> StorageWish {
        let (layout, on_disk) = match self.storage {
            Storage::Auto => (Layout::Auto, None),
            Storage::Dense => (Layout::Dense, Some(false)),
            Storage::Symmetric => (Layout::Auto, Some(false)),
            Storage::Sparse => (Layout::Sparse, Some(false)),
            Storage::Disk => (Layout::Auto, Some(true)),
        };
        StorageWish {
            layout,
            precision: self.precision,
            on_disk,
        }
    }
}

/// The known properties of the matrix to be computed or read.
#[derive(Clone, Copy, Debug)]
pub struct MatrixDemand {
    /// True if the method computes rows.
    pub by_rows: bool,
    /// True if the rows are then made symmetric.
    pub repaired: bool,
    /// The greatest number of entries of a row.
    pub n_entries: u64,
    /// The number of further matrices of this kind at the same time.
    pub n_beside: u32,
    /// The memory of the method beside its finished rows.
    pub working_byte: u64,
}

/// The chosen storage of form factors.
#[derive(Clone, Debug)]
pub struct ChosenStorage {
    plan: StoragePlan,
    directory: PathBuf,
    /// The ranks that share the matrix; `None` for a single one.
    team: Option<Arc<Team>>,
}

impl ChosenStorage {
    /// Returns the choice for methods.
    #[must_use]
    pub fn choice(&self) -> StorageChoice<'_> {
        let place = if self.plan.on_disk {
            Place::Disk(Scratch {
                directory: &self.directory,
                memory_byte: self.plan.waiting_byte,
            })
        } else {
            Place::Memory {
                waiting_byte: self.plan.waiting_byte,
            }
        };
        StorageChoice {
            layout: self.plan.layout,
            precision: self.plan.precision,
            place,
            ranks: self.team.as_ref().map(Among),
        }
    }
}

/// Chooses the storage of form factors, and records it in the plan.
///
/// # Errors
/// [`WorkflowError::Storage`].
pub fn choose_storage(cx: &Context, model: &mut Model, matrix: MatrixDemand) -> Result<ChosenStorage, WorkflowError> {
    let n = model.mesh.n_patches();
    let materials = model.mesh.patches.iter().map(|p| p.material.0 as usize);
    let absorption = materials.flat_map(|m| model.scene.materials[m].reflectance.map(|rho| 1.0 - rho));
    let absorption_min = absorption.fold(1.0 - cx.demand.reflectance_max, f64::min);
    let room = cx.room(memory_used_byte().unwrap_or(0));
    let accuracy = |tolerance| Accuracy {
        absorption_min,
        tolerance,
    };
    let solver = cx
        .demand
        .solver
        .as_deref()
        .and_then(|name| registry::by_name(name).ok());
    let facing = facing_patches(&model.mesh);
    let demand = StorageDemand {
        n_patches: n,
        n_channels: model.plan.n_channels,
        n_threads: room.n_threads,
        by_rows: matrix.by_rows,
        repaired: matrix.repaired,
        n_beside: matrix.n_beside,
        density: facing_share(&model.mesh, &facing).min(matrix.n_entries as f64 / n.max(1) as f64),
        used_byte: room.used_byte,
        working_byte: matrix.working_byte,
        image_byte: cx.demand.image_byte,
        accuracy: cx.demand.tolerance.map(accuracy),
        limit_byte: room.limit_byte,
        n_ranks: cx.ranks.size(),
        rows_for: solver.filter(|entry| entry.goes_by_rows).map(|entry| entry.name),
    };
    let plan = plan_storage(&demand, cx.memory.wish()).map_err(WorkflowError::Storage)?;
    let beside = cx.demand.output.as_deref().and_then(std::path::Path::parent);
    let beside = beside.map(|directory| {
        let here = directory.as_os_str().is_empty();
        if here { PathBuf::from(".") } else { directory.to_owned() }
    });
    let directory = cx.memory.scratch.clone().or(beside);
    let directory = directory.unwrap_or_else(std::env::temp_dir);
    let kind = if matrix.by_rows && !matrix.repaired {
        "rows"
    } else {
        "symmetric"
    };
    let memory = plan.memory;
    let reason = format!(
        "{}; {n} patches, at most {:.0} % filled: matrix {}, rows in work {}, vectors {}, picture {}, program and scene {}",
        plan.reason,
        100.0 * demand.density,
        byte_text(memory.matrix_byte),
        byte_text(memory.rows_byte),
        byte_text(memory.vectors_byte),
        byte_text(memory.image_byte),
        byte_text(memory.used_byte),
    );
    // Rows have as much work as entries, but where each place is stored they have equal sizes.
    let work: Vec<f64> = match plan.layout {
        Layout::Dense => Vec::new(),
        Layout::Auto | Layout::Sparse => facing.iter().map(|&count| 1.0 + count as f64).collect(),
    };
    let chosen = ChosenStorage {
        plan,
        directory,
        team: (cx.ranks.size() > 1).then(|| Arc::new(Team::new(&cx.ranks, &work))),
    };
    let choice = format!("{kind}, {}", choice_text(chosen.choice()));
    model.plan.decide("form factors", choice, reason);
    if cx.ranks.size() > 1 {
        let rest_byte = memory.total_byte() - memory.matrix_byte;
        let gathers = demand.rows_for.is_some();
        let parts = match (demand.by_rows, gathers) {
            (true, false) => "each stores its rows;",
            (true, true) => "each stores its rows, and gathers all for the solver;",
            (false, false) => "each stores the tiles that its rows need;",
            (false, true) => "each stores the tiles that its rows need, and gathers all for the solver;",
        };
        let (share, of) = if demand.by_rows {
            (demand.row_share(), "the rows")
        } else {
            (demand.rank_share(), "exchange areas")
        };
        let what = if chosen.plan.on_disk {
            "to find them in its scratch file"
        } else {
            "of form factors on each"
        };
        let why = format!(
            "work is shared; {parts} {} {what}, {:.0} % of {of}; whole on each are scene, trees and vectors: {}",
            byte_text(memory.matrix_byte),
            100.0 * share,
            byte_text(rest_byte)
        );
        model.plan.revise("ranks", cx.ranks.size().to_string(), why);
    }
    Ok(chosen)
}

/// Returns layout, precision and place as text.
#[must_use]
pub fn choice_text(choice: StorageChoice<'_>) -> String {
    let tiles = match choice.layout {
        Layout::Auto => "dense or sparse by tile",
        Layout::Dense => "dense",
        Layout::Sparse => "sparse",
    };
    format!("{tiles}, {}", place_text(choice))
}

/// Returns precision and place as text.
#[must_use]
pub fn place_text(choice: StorageChoice<'_>) -> String {
    let digits = if choice.precision == Precision::F32 {
        "f32"
    } else {
        "f64"
    };
    let place = match choice.place {
        Place::Memory { .. } => "in memory".to_owned(),
        Place::Disk(scratch) => format!("a scratch file in {}", scratch.directory.display()),
    };
    format!("{digits}, {place}")
}

/// Refuses ranks that would compute other form factors, and opens the requested checkpoint, unless it is open.
///
/// The checkpoint has the key of the patches and settings of the first form factors; those of a later pose are a part of their own.
pub(super) fn open_checkpoint(cx: &mut Context, model: &Model) -> Result<(), WorkflowError> {
    let geometry = model.mesh.geometry_hash();
    let mut key = Sha256::new();
    key.update(&geometry);
    key.update(env!("CARGO_PKG_VERSION"));
    for (name, value) in cx.settings.record() {
        key.update(format!("{name}={value};"));
    }
    let key: [u8; 32] = key.finalize().into();
    cx.expect_same("mesh, version or settings", &key)?;
    let Some(path) = cx.checkpoint_file.clone() else {
        return Ok(());
    };
    if let Some(checkpoint) = &cx.checkpoint {
        checkpoint.begin_part(cx.demand.part, &Sha256::digest(geometry).into());
        return Ok(());
    }
    cx.open_checkpoint(&path, &key)
}
