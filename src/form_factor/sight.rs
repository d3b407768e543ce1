//! The pairs of patches that need rays: those that may be occluded.

use glam::DVec3;

use super::Input;
use crate::mesh::PatchId;
use crate::visibility::occluders::{OccluderIndex, PairVisibility};
use crate::visibility::shaft::Shaft;

/// The visibility of a pair before any ray is traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sight {
    /// No occluder.
    Whole,
    /// One polygon or one convex solid hides all.
    Hidden,
    /// Some occluders reach in between.
    Unknown,
}

/// The faces of a scene as occluders, read row by row.
pub(super) struct Sights<'a> {
    input: Input<'a>,
    /// `None` where nothing occludes.
    index: Option<OccluderIndex>,
}

impl<'a> Sights<'a> {
    pub(super) fn new(input: Input<'a>) -> Self {
        Self {
            input,
            index: (!input.unoccluded).then(|| OccluderIndex::new(input.scene)),
        }
    }

    /// Sets the visibility of patch `i` with each of `others`, which are in ascending order.
    ///
    /// Each patch is classified against whole faces first, then against their patches, among the occluders of the face.
    pub(super) fn row(&self, i: usize, others: &[usize], sights: &mut Vec<Sight>) {
        sights.clear();
        let Some(index) = &self.index else {
            sights.resize(others.len(), Sight::Whole);
            return;
        };
        let mesh = self.input.mesh;
        let face = |j: usize| mesh.patches[j].face;
        let corners = |j: usize| mesh.polygon(PatchId::from_index(j));
        let p = corners(i);
        for of_face in others.chunk_by(|&j, &k| face(j) == face(k)) {
            let q = match of_face {
                [j] => corners(*j),
                _ => self.input.scene.polygon(face(of_face[0])),
            };
            match whole_where_grazing(index, index.classify(&p, &q), &p, &q) {
                PairVisibility::Partial(among) if of_face.len() > 1 => sights.extend(of_face.iter().map(|&j| {
                    let patch = corners(j);
                    let view = index.classify_among(&p, &patch, &among);
                    Sight::of(&whole_where_grazing(index, view, &p, &patch))
                })),
                view => sights.resize(sights.len() + of_face.len(), Sight::of(&view)),
            }
        }
    }
}

impl Sight {
    fn of(view: &PairVisibility) -> Self {
        match view {
            PairVisibility::Full => Self::Whole,
            PairVisibility::None => Self::Hidden,
            PairVisibility::Partial(_) => Self::Unknown,
        }
    }
}

/// Makes a pair fully visible that a shaft calls hidden because all visible parts are lower than its tolerance.
///
/// Nothing fits in between there. The sides of a sheet stay hidden.
pub(super) fn whole_where_grazing(
    index: &OccluderIndex,
    found: PairVisibility,
    p: &[DVec3],
    q: &[DVec3],
) -> PairVisibility {
    if found == PairVisibility::None && Shaft::new(p, q, 0.0).is_none() && !index.are_sides_of_a_sheet(p, q) {
        PairVisibility::Full
    } else {
        found
    }
}
