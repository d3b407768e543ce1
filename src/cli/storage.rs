//! Where form factors are kept: what the user asks for, and what the plan makes of it.

use std::path::PathBuf;

use sha2::{Digest as _, Sha256};

use super::args::{PrecisionName, StorageArgs, StorageName};
use super::failure::Failure;
use super::pipeline::{Prepared, Run};
use crate::checkpoint::Checkpoint;
use crate::matrix::{Layout, Place, Precision, Scratch, StorageChoice};
use crate::plan::{Accuracy, StorageDemand, StoragePlan, StorageWish, byte_text, facing_share, plan_storage};
use crate::report::{memory_available_byte, memory_used_byte};

/// The share of the memory that is available which is used unless `--memory-limit` says otherwise.
const SHARE: f64 = 0.8;

/// What a command tells about its form factors before it has them.
#[derive(Clone, Debug, Default)]
pub(super) struct Storage {
    pub(super) args: StorageArgs,
    /// The output, beside which the scratch file goes.
    pub(super) output: Option<PathBuf>,
    /// The part of the checkpoint that form factors belong to: 0 but for later poses.
    pub(super) part: u32,
    /// The tolerance of the solver, if there is one.
    pub(super) tolerance: Option<f64>,
    /// The greatest reflectance of the lightings that there are beside the scene's own.
    pub(super) reflectance_max: f64,
    pub(super) image_byte: u64,
}

/// What is known of the matrix that is to be computed or read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Matrix {
    /// True if the method computes rows.
    pub(super) by_rows: bool,
    /// True if the rows are made symmetric then.
    pub(super) repaired: bool,
    /// The most entries that a row can have.
    pub(super) n_entries: u64,
    /// How many more there are of its kind at the same time.
    pub(super) n_beside: u32,
    /// What the method takes beside the rows that it gives away.
    pub(super) working_byte: u64,
}

/// Where form factors go.
#[derive(Clone, Debug)]
pub(super) struct Chosen {
    plan: StoragePlan,
    directory: PathBuf,
}

impl Chosen {
    pub(super) fn choice(&self) -> StorageChoice<'_> {
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
        }
    }
}

/// Returns what may be used in all, in bytes.
pub(super) fn limit_byte(args: Option<u64>) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a number that is not negative"
    )]
    let share = |available: u64| (available as f64 * SHARE) as u64;
    // What the program holds already is no longer available, and counts as used.
    let by_default = || {
        let used = memory_used_byte().unwrap_or(0);
        memory_available_byte().map_or(u64::MAX, |available| share(available).saturating_add(used))
    };
    args.unwrap_or_else(by_default)
}

/// Decides where form factors go, and notes it in the plan.
pub(super) fn choose(run: &Run, prepared: &mut Prepared, matrix: Matrix) -> Result<Chosen, Failure> {
    let Storage {
        args, output: result, ..
    } = &run.storage;
    let args = &args.memory;
    let n = prepared.mesh.n_patches();
    let materials = prepared.mesh.patches.iter().map(|p| p.material.0 as usize);
    let absorption = materials.flat_map(|m| prepared.scene.materials[m].reflectance.map(|rho| 1.0 - rho));
    let absorption_min = absorption.fold(1.0 - run.storage.reflectance_max, f64::min);
    let accuracy = |tolerance| Accuracy {
        absorption_min,
        tolerance,
    };
    let demand = StorageDemand {
        n_patches: n,
        n_channels: prepared.plan.n_channels,
        n_threads: rayon::current_num_threads(),
        by_rows: matrix.by_rows,
        repaired: matrix.repaired,
        n_beside: matrix.n_beside,
        density: facing_share(&prepared.mesh).min(matrix.n_entries as f64 / n.max(1) as f64),
        used_byte: memory_used_byte().unwrap_or(0),
        working_byte: matrix.working_byte,
        image_byte: run.storage.image_byte,
        accuracy: run.storage.tolerance.map(accuracy),
        limit_byte: limit_byte(args.memory_limit),
    };
    let (layout, on_disk) = match args.storage {
        StorageName::Auto => (Layout::Auto, None),
        StorageName::Dense => (Layout::Dense, Some(false)),
        StorageName::Symmetric => (Layout::Auto, Some(false)),
        StorageName::Sparse => (Layout::Sparse, Some(false)),
        StorageName::Disk => (Layout::Auto, Some(true)),
    };
    let wish = StorageWish {
        layout,
        precision: match args.precision {
            PrecisionName::Auto => None,
            PrecisionName::F32 => Some(Precision::F32),
            PrecisionName::F64 => Some(Precision::F64),
        },
        on_disk,
    };
    let plan = plan_storage(&demand, wish).map_err(|error| Failure::new("memory_limit", error.to_string()))?;
    let beside = result.as_deref().and_then(std::path::Path::parent);
    let beside = beside.map(|directory| {
        let here = directory.as_os_str().is_empty();
        if here { PathBuf::from(".") } else { directory.to_owned() }
    });
    let directory = args.scratch.clone().or(beside).unwrap_or_else(std::env::temp_dir);
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
    let chosen = Chosen { plan, directory };
    let choice = format!("{kind}, {}", choice_text(chosen.choice()));
    prepared.plan.decide("form factors", choice, reason);
    Ok(chosen)
}

/// Returns layout, precision and place as people read them.
pub(super) fn choice_text(choice: StorageChoice<'_>) -> String {
    let tiles = match choice.layout {
        Layout::Auto => "dense or sparse by tile",
        Layout::Dense => "dense",
        Layout::Sparse => "sparse",
    };
    format!("{tiles}, {}", place_text(choice))
}

/// Returns precision and place as people read them.
pub(super) fn place_text(choice: StorageChoice<'_>) -> String {
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

/// Opens the checkpoint that is asked for, unless it is open: it belongs to the patches and the settings of the first form factors.
///
/// Form factors of a later pose are a part of their own.
pub(super) fn open_checkpoint(run: &mut Run, prepared: &Prepared) -> Result<(), Failure> {
    let Some(path) = &run.storage.args.checkpoint else {
        return Ok(());
    };
    let geometry = prepared.mesh.geometry_hash();
    if let Some(checkpoint) = &run.progress.checkpoint {
        checkpoint.begin_part(run.storage.part, &Sha256::digest(geometry).into());
        return Ok(());
    }
    let mut key = Sha256::new();
    key.update(geometry);
    key.update(env!("CARGO_PKG_VERSION"));
    for (name, value) in &run.settings {
        key.update(format!("{name}={value};"));
    }
    run.progress.checkpoint = Some(Checkpoint::open(path, &key.finalize().into())?);
    run.interrupt.note_checkpoint(path);
    Ok(())
}

/// Reads a number of bytes: `512MiB`, `2G`, `1.5GB`, or a plain number. K, M, G and T count in 1024, as do KiB to TiB; KB to TB in 1000.
pub(super) fn parse_byte(text: &str) -> Result<u64, String> {
    let trimmed = text.trim();
    let digits = trimmed
        .find(|c: char| !c.is_ascii_digit() && c != '.')
        .unwrap_or(trimmed.len());
    let (number, unit) = trimmed.split_at(digits);
    let bad = || "give a number of bytes, as in 512MiB, 2G or 1500000000".to_owned();
    let number: f64 = number.parse().map_err(|_| bad())?;
    let factor = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kib" => 1024.0,
        "m" | "mib" => 1024.0 * 1024.0,
        "g" | "gib" => 1024.0 * 1024.0 * 1024.0,
        "t" | "tib" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        _ => return Err(bad()),
    };
    let byte = number * factor;
    if !(1.0..=1e18).contains(&byte) {
        return Err(bad());
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 1 and 1e18"
    )]
    Ok(byte as u64)
}

#[cfg(test)]
mod tests {
    use super::parse_byte;

    #[test]
    fn bytes_are_read_as_people_write_them() {
        for (text, byte) in [
            ("512MiB", 512 << 20),
            ("2G", 2 << 30),
            ("1.5k", 1536),
            ("3 kB", 3000),
            ("1500000000", 1_500_000_000),
            ("0.5gib", 1 << 29),
            ("7b", 7),
        ] {
            assert_eq!(parse_byte(text), Ok(byte), "{text}");
        }
        for text in ["", "G", "0", "-1", "1e9", "1.2.3M", "5 apples", "1000000T", "NaN"] {
            assert!(parse_byte(text).is_err(), "{text}");
        }
    }
}
