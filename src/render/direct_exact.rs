//! Form factors from points to the visible parts of emitters, exactly.

use std::collections::HashMap;

use glam::DVec3;

use super::direct::DirectPoint;
use crate::form_factor::partial::VisibleFactor;
use crate::geometry::point_form_factor::point_form_factor;
use crate::mesh::{Mesh, PatchId};
use crate::scene::Scene;
use crate::visibility::blockers::{BlockerIndex, PairVisibility};

/// What is needed to find out which parts of an emitter a patch sees.
pub(super) struct ClearParts<'a> {
    mesh: &'a Mesh,
    index: BlockerIndex,
}

impl<'a> ClearParts<'a> {
    pub(super) fn new(scene: &Scene, mesh: &'a Mesh) -> Self {
        Self {
            mesh,
            index: BlockerIndex::new(scene),
        }
    }

    fn look(&self, patch: PatchId, emitter: &[DVec3]) -> Seen {
        let region = self.mesh.polygon(patch);
        match self.index.classify(&region, emitter) {
            PairVisibility::None => Seen::Not,
            PairVisibility::Full => Seen::Whole,
            PairVisibility::Partial(between) => {
                let blockers = self.index.blockers(&region, emitter, &between);
                let normal = self.mesh.patches[patch.0 as usize].normal;
                Seen::Behind(Box::new(VisibleFactor::new(&region, normal, emitter, &blockers)))
            }
        }
    }
}

/// What the points of one patch see of one emitter.
enum Seen {
    Not,
    Whole,
    Behind(Box<VisibleFactor>),
}

/// What was found out about pairs of a patch and an emitter, by one thread.
///
/// A point within the rounding of a ray's f32 coordinates (1e-7 of a face) of its patch's border may be taken for a neighbour's.
#[derive(Default)]
pub(super) struct SeenByPatch {
    seen: HashMap<(PatchId, u32), Seen>,
}

impl SeenByPatch {
    /// Returns F from a point to the visible part of an emitter, given by its number and its corners.
    pub(super) fn form_factor(&mut self, clear: &ClearParts<'_>, at: &DirectPoint, emitter: (u32, &[DVec3])) -> f64 {
        let (number, corners) = emitter;
        let seen = self
            .seen
            .entry((at.patch, number))
            .or_insert_with(|| clear.look(at.patch, corners));
        match seen {
            Seen::Not => 0.0,
            Seen::Whole => point_form_factor(at.point, at.normal, corners),
            Seen::Behind(visible) => visible.at(at.point),
        }
    }
}
