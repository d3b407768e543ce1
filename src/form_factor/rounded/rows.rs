//! Errors of rounding for the rows of methods that ignore it.

use std::ops::Range;

use super::Rounded;
use super::behind::state;
use crate::form_factor::Input;
use crate::form_factor::facing::{self, Facing};
use crate::geometry::polygon_form_factor::{PreparedPolygon, Tolerance, exchange_area};
use crate::matrix::{Entry, UpperBounds};
use crate::mesh::PatchId;
use crate::visibility::occluders::{OccluderId, OccluderIndex, PairVisibility};

/// The part of rounding in the errors of methods that ignore it.
pub(in crate::form_factor) struct RoundedRows<'a> {
    input: Input<'a>,
    rounded: Rounded,
    /// `None` where nothing occludes.
    index: Option<OccluderIndex>,
    polygons: Vec<PreparedPolygon>,
    facing: Facing,
}

/// The part of the error without rounding below which a rough estimate of rounding is enough.
///
/// A fifth of the noise of a few rays is no more than their number can show.
const NEGLIGIBLE: f64 = 0.2;

/// The form factor up to which patches behind each other are not stated.
const LEAST: f64 = 1e-8;

/// The number of occluders that the rough estimate assumes.
const FEW: usize = 3;

impl<'a> RoundedRows<'a> {
    /// Returns the error terms of a scene's rounded coordinates; `None` for a scene whose coordinates are exact.
    pub(in crate::form_factor) fn new(input: Input<'a>) -> Option<Self> {
        Some(Self {
            input,
            rounded: Rounded::new(input)?,
            index: (!input.unoccluded).then(|| OccluderIndex::new(input.scene)),
            polygons: facing::prepared(input.mesh),
            facing: Facing::new(input.mesh),
        })
    }

    /// Adds the error of rounding to the entries of row i.
    ///
    /// Entries are in units of 1 / `scale` m²: 1 for exchange areas, A_i for form factors. Patches among `columns` that do not face patch i, but may do so as they were meant, get entries of 0 with an error.
    ///
    /// Work: a search for occluders between the patch and each face with patches whose rounding is refined, and some µs for each of these.
    pub(in crate::form_factor) fn add(&self, i: usize, scale: f64, columns: Range<usize>, entries: &mut Vec<Entry>) {
        self.add_to_entries(i, scale, entries);
        self.add_behind(i, scale, columns, entries);
    }

    /// Adds entries of 0 with an error where patches among `columns` do not face patch i, but may do so as they were meant.
    fn add_behind(&self, i: usize, scale: f64, columns: Range<usize>, entries: &mut Vec<Entry>) {
        let n_found = entries.len();
        let least = LEAST * self.rounded.ends[i].area;
        self.rounded.behind(&self.facing, i, columns, |j, most| {
            if most > least {
                state(entries, n_found, PatchId::from_index(j).0, most / scale);
            }
        });
        entries.sort_unstable_by_key(|entry| entry.0);
    }

    /// Adds entries of 0 for patches that no ray of patch i hit, where rounding may hide more of them than the rays could miss.
    ///
    /// Occluders barely hide these patches, or barely do not. `by_count` is the part of F_ij that the number of rays leaves open.
    pub(in crate::form_factor) fn add_unhit(
        &self,
        i: usize,
        by_count: f64,
        bounds: &dyn UpperBounds,
        entries: &mut Vec<Entry>,
    ) {
        if self.index.is_none() {
            return;
        }
        let area = self.rounded.ends[i].area;
        let mut unhit = Vec::new();
        let mut found = entries.iter().map(|entry| entry.0 as usize).peekable();
        for j in 0..self.rounded.ends.len() {
            if found.next_if_eq(&j).is_some() || j == i {
                continue;
            }
            if self.rounded.rough([i, j], 0.0, FEW) > by_count * area && bounds.are_facing(i, j) {
                let missed = bounds.missed(i, j, by_count);
                // Where the patches exchange less than that without occluders, rounding adds little to it.
                if missed >= by_count {
                    unhit.push((PatchId::from_index(j).0, 0.0, missed));
                }
            }
        }
        let by_rays: Vec<f64> = unhit.iter().map(|entry| entry.2).collect();
        self.add_to_entries(i, area, &mut unhit);
        entries.extend(
            unhit
                .into_iter()
                .zip(by_rays)
                .filter(|(entry, by_rays)| entry.2 > *by_rays)
                .map(|(entry, _)| entry),
        );
        entries.sort_unstable_by_key(|entry| entry.0);
    }

    fn add_to_entries(&self, i: usize, scale: f64, entries: &mut [Entry]) {
        let mesh = self.input.mesh;
        let face = |entry: &Entry| mesh.patches[entry.0 as usize].face;
        let n_rough = if self.index.is_some() { FEW } else { 0 };
        for of_face in entries.chunk_by_mut(|one, other| face(one) == face(other)) {
            let mut between: Option<Option<Vec<OccluderId>>> = None;
            for entry in of_face {
                let j = entry.0 as usize;
                let exchange = scale * entry.1;
                let rough = self.rounded.rough([i, j], exchange, n_rough);
                if j == i || rough <= NEGLIGIBLE * scale * entry.2 {
                    entry.2 += rough / scale;
                    continue;
                }
                if let Some(occluders) = between.get_or_insert_with(|| self.between(i, j)) {
                    entry.2 += self.closely([i, j], exchange, occluders) / scale;
                }
            }
        }
    }

    /// Returns the occluders between patch i and the face of patch j; `None` if they hide it for certain.
    fn between(&self, i: usize, j: usize) -> Option<Vec<OccluderId>> {
        let Some(index) = &self.index else {
            return Some(Vec::new());
        };
        let face = self.input.scene.polygon(self.input.mesh.patches[j].face);
        match index.classify(self.polygons[i].corners(), &face) {
            PairVisibility::Partial(occluders) => Some(occluders),
            PairVisibility::Full => Some(Vec::new()),
            PairVisibility::None => None,
        }
    }

    fn closely(&self, [i, j]: [usize; 2], exchange: f64, occluders: &[OccluderId]) -> f64 {
        let whole = if occluders.is_empty() {
            exchange
        } else {
            let tolerance = Tolerance { rel: 1e-2, abs: 0.0 };
            exchange_area(&self.polygons[i], &self.polygons[j], tolerance).value
        };
        let standing = self
            .index
            .iter()
            .flat_map(|index| occluders.iter().map(|&id| index.corners(id)));
        self.rounded.error([i, j], exchange, whole, standing)
    }
}
