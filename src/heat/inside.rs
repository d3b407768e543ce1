//! Detects points inside solids.

use std::f64::consts::PI;

use glam::DVec3;

use crate::geometry::polygon::solid_angle;
use crate::scene::topology::Pieces;
use crate::scene::{FaceId, Scene};

/// The winding number from which a point counts as inside: that at the edge of a piece's only flat opening.
const INSIDE: f64 = 0.5 + 1e-9;

/// The connected pieces of a scene's surface, with the caps of those that stand on others.
pub(crate) struct Solids {
    pieces: Pieces,
    /// The faces of each piece.
    faces: Vec<Vec<Vec<DVec3>>>,
}

impl Solids {
    pub(crate) fn of(scene: &Scene) -> Self {
        let pieces = Pieces::of(scene);
        let mut faces = vec![Vec::new(); pieces.len()];
        for face in scene.face_ids() {
            faces[pieces.of_face(face) as usize].push(scene.polygon(face));
        }
        for (piece, cap) in pieces.caps() {
            faces[*piece as usize].push(cap.clone());
        }
        Self { pieces, faces }
    }

    /// Returns the piece that a face belongs to.
    pub(super) fn piece_of(&self, face: FaceId) -> u32 {
        self.pieces.of_face(face)
    }

    /// Returns whether a point is inside one of the pieces whose backs it sees.
    ///
    /// The criterion is the winding number Σ Ω / 4π over the faces of a piece, positive where their backs are seen: 1 inside a closed piece that faces outwards and 0 outside of it, above 1/2 also
    /// inside one with a single flat opening. Source: A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers", ACM Transactions on Graphics
    /// 32(4), 2013. Departures: none.
    pub(super) fn contain(&self, seen_from_behind: &mut Vec<u32>, point: DVec3) -> bool {
        seen_from_behind.sort_unstable();
        seen_from_behind.dedup();
        seen_from_behind.iter().any(|&piece| self.contains(piece, point))
    }

    fn contains(&self, piece: u32, point: DVec3) -> bool {
        let of_face = |corners: &Vec<DVec3>| {
            let seen: Vec<DVec3> = corners.iter().map(|corner| corner - point).collect();
            solid_angle(&seen)
        };
        let angle: f64 = self.faces[piece as usize].iter().map(of_face).sum();
        angle > INSIDE * 4.0 * PI
    }
}
