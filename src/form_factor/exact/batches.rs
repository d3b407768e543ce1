//! The state of the exact method between its batches, and the pairs that a batch holds.

use std::collections::HashMap;
use std::ops::Range;

use glam::DVec3;

use super::faces::FaceTree;
use super::grids::Grids;
use super::lattice::{Lattice, Repeats};
use super::method::ExactMethod;
use super::patches::Patches;
use super::table::Table;
use crate::form_factor::facing::Facing;
use crate::form_factor::journal::Journal;
use crate::form_factor::pairs::Exchange;
use crate::form_factor::rounded::Rounded;
use crate::form_factor::sight::whole_where_grazing;
use crate::form_factor::{Before, Input, PairCounts};
use crate::geometry::polygon_form_factor::exchange_area;
use crate::matrix::{Entry, FormFactors};
use crate::progress::Progress;
use crate::scene::FaceId;
use crate::threads;
use crate::visibility::occluders::{Between, Measures, OccluderId, OccluderIndex, PairVisibility};

/// All batches in the order of their rows.
pub(super) struct Batches<'a> {
    pub(super) method: &'a ExactMethod,
    pub(super) progress: &'a dyn Progress,
    pub(super) patches: Patches,
    pub(super) facing: Facing,
    pub(super) tree: FaceTree,
    /// Of the hulls of all faces.
    pub(super) measures: Vec<Measures>,
    pub(super) index: Option<OccluderIndex>,
    /// The patches of a file whose coordinates are rounded.
    pub(super) rounded: Option<Rounded>,
    /// The rows from before a change.
    pub(super) before: Option<Before<'a>>,
    /// What is to be computed more exactly than before.
    pub(super) finer: Option<Finer<'a>>,
    /// The faces of the scene, in the order of `patches.faces`.
    pub(super) face_ids: Vec<FaceId>,
    pub(super) lattices: Vec<Option<Lattice>>,
    /// The grids that the mesh comes with.
    pub(super) grids: Grids,
    /// The tables of pairs of grids whose rows are being computed.
    pub(super) grid_tables: HashMap<[u32; 2], Repeats>,
    /// The pairs of two faces that are computed together, for faces whose rows are being computed.
    pub(super) tables: HashMap<[usize; 2], Table>,
    pub(super) next_row: usize,
    /// Where the next batch ends, if ranks share them.
    pub(super) end: Option<usize>,
    pub(super) journal: Journal<'a>,
}

/// The exchange areas of an earlier computation by the same method, and the errors that are allowed now.
///
/// Partial pairs whose error is allowed are taken over; all others are computed as if for the first time.
#[derive(Clone, Copy)]
pub(super) struct Finer<'a> {
    pub(super) factors: &'a FormFactors,
    /// For each patch, the error that its exchange areas may have, m²: of two patches, the smaller one holds. The method's tolerance holds as well.
    pub(super) allowed: &'a [f64],
}

/// A later face that some patches of a face may see.
pub(super) struct FaceView {
    pub(super) face: usize,
    pub(super) known: Known,
    /// For the patches of both faces: whether each is in front of all of the other's; `None` where pairs are tested one by one.
    pub(super) fronts: Option<[Vec<Option<bool>>; 2]>,
}

/// The relation of two faces.
pub(super) enum Known {
    /// All exchange areas between them are as before a change.
    Kept,
    /// Their occluders.
    Seen(Between),
}

/// Consecutive rows.
pub(super) struct Strip {
    pub(super) first_row: usize,
    pub(super) rows: Vec<Vec<(u32, f64, f64)>>,
    pub(super) partial: Vec<PartialPair>,
    /// The occluders of all partial pairs, one after the other.
    pub(super) occluders: Vec<OccluderId>,
    pub(super) counts: PairCounts,
    /// The rows before a change, or of a less exact computation; empty without one.
    pub(super) before: Vec<Vec<Entry>>,
}

/// A pair that may be occluded, whose entry is not computed yet.
pub(super) struct PartialPair {
    pub(super) i: usize,
    pub(super) j: usize,
    /// Its place in the row of i.
    pub(super) place: usize,
    pub(super) touched: bool,
    pub(super) occluders: Range<usize>,
}

impl<'a> Batches<'a> {
    pub(super) fn new(
        method: &'a ExactMethod,
        input: Input<'a>,
        before: Option<Before<'a>>,
        progress: &'a dyn Progress,
    ) -> Self {
        let (mut index, (facing, mut patches)) = rayon::join(
            || (!input.unoccluded).then(|| OccluderIndex::new(input.scene)),
            || {
                let facing = Facing::new(input.mesh);
                let patches = Patches::new(input.mesh, &facing, !input.unoccluded);
                (facing, patches)
            },
        );
        if let Some(index) = &mut index {
            index.expect_reach(patches.least_reach());
        }
        patches.loosen_cut_ones(input.mesh, index.as_ref().map_or(0.0, OccluderIndex::slack));
        let grids = Grids::find(&patches, method.shared_off(patches.least_reach()));
        Self {
            method,
            progress,
            measures: threads::collect_from(&patches.faces, |face| Measures::of(&face.runs[0].hull)),
            tree: FaceTree::new(&patches, &facing),
            facing,
            lattices: threads::collect_from(&patches.faces, |face| Lattice::find(&patches.corners, face.range())),
            index,
            rounded: Rounded::new(input),
            before,
            finer: None,
            face_ids: input
                .mesh
                .patches
                .chunk_by(|a, b| a.face == b.face)
                .map(|own| own[0].face)
                .collect(),
            patches,
            grids,
            grid_tables: HashMap::new(),
            tables: HashMap::new(),
            next_row: 0,
            end: None,
            journal: Journal::new(progress),
        }
    }

    /// Returns the error that a pair may have, m².
    pub(super) fn goal(&self, pair: [usize; 2]) -> f64 {
        self.goal_of(self.method, pair)
    }

    /// Returns the error that a pair may have by a method that may differ from the one asked for, m².
    pub(super) fn goal_of(&self, method: &ExactMethod, pair: [usize; 2]) -> f64 {
        let goal = method.tolerance * self.smaller_area(pair);
        self.finer.map_or(goal, |finer| {
            pair.iter().fold(goal, |goal, &k| goal.min(finer.allowed[k]))
        })
    }

    pub(super) fn smaller_area(&self, pair: [usize; 2]) -> f64 {
        let [a, b] = pair.map(|k| self.patches.areas[k]);
        a.min(b)
    }

    pub(super) fn kernel(&self, i: usize, j: usize) -> Exchange {
        let [p, q] = [i, j].map(|k| &self.patches.prepared[k]);
        let exchange = exchange_area(p, q, self.method.full_tolerance(p.area().min(q.area())));
        Exchange {
            area: exchange.value,
            error: exchange.error,
        }
    }

    /// Returns whether any patches of two faces may face each other.
    pub(super) fn faces_face(&self, f: usize, g: usize) -> bool {
        let [from, to] = [f, g].map(|k| &self.patches.faces[k]);
        self.facing.any(from.range(), to.range())
    }

    /// Returns whether the exchange between two parts of faces that stayed in place is the same as before a change.
    pub(super) fn is_kept(&self, p: &[DVec3], q: &[DVec3]) -> bool {
        self.before.is_some_and(|before| !before.change.may_come_between(p, q))
    }

    /// Returns whether no exchange area between patches of two faces can be the same as before.
    pub(super) fn any_moved(&self, faces: [usize; 2]) -> bool {
        self.before.is_none_or(|before| {
            let mut ids = faces.map(|f| self.face_ids[f]).into_iter();
            ids.any(|face| before.change.moves(face))
        })
    }

    /// Returns the rows of a run from before a change, or from a less exact computation.
    pub(super) fn rows_before(&self, rows: &Range<usize>) -> Vec<Vec<Entry>> {
        let of_change = self.before.map(|before| before.factors);
        let known = of_change.or(self.finer.map(|finer| finer.factors));
        known.map_or_else(Vec::new, |factors| {
            // Only symmetric storage is reused.
            rows.clone()
                .map(|i| factors.exchange_row(i).unwrap_or_default())
                .collect()
        })
    }

    /// Finds the occluders between two polygons, among some or all.
    pub(super) fn between(&self, p: &[DVec3], q: &[DVec3], among: Option<&[OccluderId]>) -> Between {
        let Some(index) = &self.index else {
            return Between::certain(PairVisibility::Full);
        };
        if self.progress.is_late() {
            // The result will not be read.
            return Between::certain(PairVisibility::Partial(Vec::new()));
        }
        let found = among.map_or_else(|| index.between(p, q), |among| index.between_among(p, q, among));
        Between {
            visibility: whole_where_grazing(index, found.visibility, p, q),
            ..found
        }
    }
}
