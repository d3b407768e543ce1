//! Whether light leaves a scene, and which rows of form factors sum to 1.

use glam::DVec3;
use thiserror::Error;

use super::Input;
use super::backs::{Outline, Sheets, places_of_patches};
use super::probe::Probe;
use crate::geometry::polygon;
use crate::matrix::RowTally;
use crate::mesh::PatchId;
use crate::printable::printable;
use crate::scene::topology::{Backs, Pieces, Place};
use crate::threads;

/// How to decide whether a scene is closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Closure {
    /// By the shape of the scene, and by the rays of the form factors where there are any.
    #[default]
    Detect,
    /// It is closed: refused where rays show otherwise.
    Closed,
    /// It is open: no row has to sum to 1.
    Open,
}

/// Whether light leaves a scene, and which rows of its form factors sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Enclosed {
    /// True if no light leaves the scene.
    pub closed: bool,
    /// True if that follows from the shape of the scene or was stated, false if it follows from counted rays.
    pub certain: bool,
    /// The rows that sum to 1, as all light of their patches arrives at front faces, \[n\].
    pub rows: Vec<bool>,
    /// Upper bounds of the fraction of each patch's light that may leave all the same, \[n\].
    ///
    /// It may leave through joints no wider than 1e-8 of a face, and as far as rays leave that open where closure was stated. 0 where no face misses another by more than the rounding of the coordinates.
    pub may_escape: Vec<f64>,
}

/// Light leaves a scene that was stated to be closed.
#[derive(Clone, Debug, Error, PartialEq)]
#[error(
    "`{surface}` ({face}): {escaped:.1e} of the light of its patch at ({:.6}, {:.6}, {:.6}) leaves the scene, first near ({:.6}, {:.6}, {:.6})",
    from.x, from.y, from.z, exit.x, exit.y, exit.z
)]
#[non_exhaustive]
pub struct Leak {
    /// The name of the surface.
    pub surface: String,
    /// The name of its face, as in `line 12`.
    pub face: Box<str>,
    /// The middle of the patch, m.
    pub from: DVec3,
    /// Where one of its rays leaves the box around the scene, m.
    pub exit: DVec3,
    /// The fraction of its rays that leave.
    pub escaped: f64,
}

/// The fraction of the light of a patch that may leave a scene stated to be closed.
pub const MAX_ESCAPED: f64 = 1e-3;

/// Rays that test whether a scene is closed, for all patches together, and the least and the most for each.
const RAYS: usize = 1 << 24;
const MIN_RAYS: usize = 256;
const MAX_RAYS: usize = 4096;

/// The fewest rays that show that light leaves: single ones may slip through the joint between two faces.
const MIN_ESCAPED: u64 = 3;

/// Standard deviations by which the fraction of rays that escape may lie below the true fraction.
const SIGMAS: f64 = 8.0;

/// A slit of width w lets out up to this many times w P / A of the light of a patch with perimeter P and area A.
///
/// Slits along all of its border take w P / A, more distant ones less.
const SLITS: f64 = 8.0;

/// Decides whether light leaves a scene, and which of its rows sum to 1.
///
/// `watertight`: see [`is_watertight`](crate::scene::topology::is_watertight). `tallies`: of the rows of form factors, \[n\]. Rows sum to 1 by the shape of the scene
/// ([`closed_rows`]), and in a closed scene also where none of a patch's rays met a back face. Rays are traced for [`Closure::Closed`] alone, where the shape does not show it.
///
/// # Errors
/// [`Leak`] for [`Closure::Closed`], if more than [`MAX_ESCAPED`] of the rays of a patch hit nothing; of a scene of up to 4096 patches 4096 are traced from each.
pub fn enclosed(input: Input<'_>, watertight: bool, tallies: &[RowTally], closure: Closure) -> Result<Enclosed, Leak> {
    if closure == Closure::Open {
        return Ok(Enclosed {
            closed: false,
            certain: false,
            rows: vec![false; input.mesh.n_patches()],
            may_escape: vec![0.0; input.mesh.n_patches()],
        });
    }
    let pieces = Pieces::of(input.scene);
    let mut rows = rows_among(input, &pieces);
    let mut may_escape = by_slits(input, pieces.misfit());
    let has_rays = tallies.iter().any(|tally| tally.n_rays > 0);
    let by_rays = has_rays && tallies.iter().all(|tally| tally.n_escaped == 0);
    let certain = watertight || closure == Closure::Closed;
    let closed = certain || by_rays;
    if !watertight && closure == Closure::Closed {
        let probes = probed(input)?;
        for ((row, bound), probe) in rows.iter_mut().zip(&mut may_escape).zip(probes) {
            if !*row {
                *bound += most_escaped(&probe);
            }
            *row |= probe.n_absorbed == 0 && share(&probe) <= MAX_ESCAPED;
        }
    }
    for (row, tally) in rows.iter_mut().zip(tallies) {
        // A patch that meets back faces may lie under a block without a bottom.
        *row |= closed && tally.n_rays > 0 && tally.n_absorbed + tally.n_escaped == 0;
    }
    Ok(Enclosed {
        closed,
        certain,
        rows,
        may_escape,
    })
}

/// Returns upper bounds of the fractions of the light of patches that slits of such a width let out, \[n\].
fn by_slits(input: Input<'_>, width: f64) -> Vec<f64> {
    let patches = input.mesh.patches.iter().enumerate();
    let bounds = patches.map(|(i, patch)| {
        let perimeter = polygon::perimeter(&input.mesh.polygon(PatchId::from_index(i)));
        (SLITS * width * perimeter / patch.area).min(1.0)
    });
    bounds.collect()
}

/// Returns an upper bound of the light that escapes: the fraction of rays that hit nothing, and 8 standard deviations.
fn most_escaped(probe: &Probe) -> f64 {
    let n = probe.n_rays as f64;
    let likely = (probe.n_escaped as f64 + 1.0) / (n + 2.0);
    share(probe) + SIGMAS * (likely * (1.0 - likely) / n).sqrt()
}

/// Returns the fraction of rays that hit nothing.
fn share(probe: &Probe) -> f64 {
    probe.n_escaped as f64 / probe.n_rays as f64
}

/// Shoots rays from all patches, and refuses a scene if more than [`MAX_ESCAPED`] of those of a patch leave it: the error names the patch that loses the most.
fn probed(input: Input<'_>) -> Result<Vec<Probe>, Leak> {
    let n = input.mesh.n_patches();
    let n_rays = (RAYS / n.max(1)).clamp(MIN_RAYS, MAX_RAYS);
    let probes: Vec<Probe> =
        threads::collect_with(n, Probe::buffers, |buffers, i| Probe::shoot(input, i, n_rays, buffers));
    let outlines: Vec<Outline> = input
        .scene
        .face_ids()
        .map(|face| Outline::new(input.scene.polygon(face)))
        .collect();
    let sheets = Sheets::new(input.scene, &outlines);
    // A patch flat on another face, such as the bottom of a block, sees nothing: its rays begin beyond that face.
    let lies_on_another = |i: usize| sheets.uncovered(input.mesh.patches[i].face.0 as usize).is_empty();
    let leaks = |i: usize, probe: &Probe| {
        let is_leak = probe.n_escaped >= MIN_ESCAPED && share(probe) > MAX_ESCAPED;
        is_leak && !(probe.n_escaped == probe.n_rays && lies_on_another(i))
    };
    let leaking = probes.iter().enumerate().filter(|&(i, probe)| leaks(i, probe));
    let Some((i, probe)) = leaking.max_by(|a, b| share(a.1).total_cmp(&share(b.1)).then(b.0.cmp(&a.0))) else {
        return Ok(probes);
    };
    let patch = &input.mesh.patches[i];
    Err(Leak {
        surface: printable(&input.scene.surfaces[patch.surface.0 as usize].name),
        face: input
            .scene
            .numbering
            .label(input.scene.faces[patch.face.0 as usize].line)
            .into(),
        from: patch.centroid,
        exit: probe.exit,
        escaped: share(probe),
    })
}

/// Returns for each patch whether all of its light arrives at front faces, so that its row sums to 1, \[n\].
///
/// That holds if its front lies in a region that closed pieces of surface bound, by their winding numbers around it, and where no patch has its back: inside an enclosure, but not
/// in the open space around it, nor beside a block that is wound inwards. Where faces of other pieces reach a patch inside its border, such as a wall that stands on it, the winding numbers of these
/// pieces are unknown for part of it: its row may sum to any number from 0 to 1.
///
/// Work: O(n log n).
#[must_use]
pub fn closed_rows(input: Input<'_>) -> Vec<bool> {
    rows_among(input, &Pieces::of(input.scene))
}

fn rows_among(input: Input<'_>, pieces: &Pieces) -> Vec<bool> {
    let of_patches = places_of_patches(input, pieces);
    let backs = Backs::of(&of_patches);
    let is_closed = |place: &Place| place.front.is_enclosed() && backs.are_hidden_from(&place.front);
    threads::collect_from(&of_patches, is_closed)
}
