//! Form factors between surfaces, within the memory limit.

use super::{Context, FormFactorStudy, Model, Parameter};
use crate::matrix::SurfaceRow;
use crate::plan::byte_text;
use crate::report::memory_used_byte;

/// Memory for a form factor between two surfaces and its error, as numbers and in a document, where 79 bytes were measured.
const ENTRY_BYTE: u64 = 96;

/// Form factors between the surfaces of a scene.
#[derive(Clone, Debug)]
pub enum SurfaceTable {
    /// The form factors between all of them.
    Whole(Vec<SurfaceRow>),
    /// 1 − Σ_T F_ST of each surface S, if the form factors between them do not fit into memory or are more than requested.
    Lost(Vec<f64>),
    /// None requested.
    NotWanted,
}

impl SurfaceTable {
    /// The greatest number of surfaces in a table for readers.
    pub const MAX_READ: usize = 12;

    /// The greatest number of surfaces in a document; more would make one of several MB.
    pub const MAX_PRINTED: usize = 200;

    /// Calculates form factors between up to `n_wanted` surfaces; the plan records if there are more or they do not fit into memory.
    ///
    /// If `n_wanted` is at most [`MAX_READ`](Self::MAX_READ), a greater number of surfaces has no table at all.
    #[must_use]
    pub fn new(model: &mut Model, study: &FormFactorStudy, cx: &Context, n_wanted: usize) -> Self {
        let n = model.scene.surfaces.len();
        if n > n_wanted && n_wanted <= Self::MAX_READ {
            return Self::NotWanted;
        }
        let surface_of_patch: Vec<u32> = model.mesh.patches.iter().map(|p| p.surface.0).collect();
        let rows = study.factors.surface_rows(&surface_of_patch, n);
        let file = (cx.naming)(Parameter::Output, Some("F.csv"));
        if n > n_wanted {
            model.plan.left_out.push(format!(
                "surface_form_factor and surface_error: {n} × {n} surfaces are more than {n_wanted} × {n_wanted}; {} prints them, {file} writes them row by row",
                (cx.naming)(Parameter::Full, None)
            ));
            return Self::Lost(rows.lost_factors());
        }
        let needed = ENTRY_BYTE.saturating_mul((n as u64).saturating_pow(2));
        // The room of the rank that has the least, as all ranks calculate the same.
        let room = cx.room(memory_used_byte().unwrap_or(0));
        if n <= Self::MAX_READ || needed <= room.limit_byte.saturating_sub(room.used_byte) {
            return Self::Whole(rows.iter().collect());
        }
        model.plan.left_out.push(format!(
            "surface_form_factor and surface_error: those of {n} × {n} surfaces need {} of memory; {file} writes them row by row",
            byte_text(needed)
        ));
        Self::Lost(rows.lost_factors())
    }

    /// Returns the form factors from each surface, if they were calculated.
    #[must_use]
    pub fn rows(&self) -> Option<&[SurfaceRow]> {
        match self {
            Self::Whole(rows) => Some(rows),
            Self::Lost(_) | Self::NotWanted => None,
        }
    }

    /// Returns 1 − Σ_T F_ST of each surface S, if that was calculated.
    #[must_use]
    pub fn lost_factors(&self) -> Option<Vec<f64>> {
        match self {
            Self::Whole(rows) => Some(rows.iter().map(|row| row.lost_factor).collect()),
            Self::Lost(lost) => Some(lost.clone()),
            Self::NotWanted => None,
        }
    }
}
