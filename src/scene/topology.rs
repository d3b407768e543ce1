//! What the faces of a scene tell about visibility before any ray is traced.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::{FaceId, Scene};

/// Tells whether no face can stand between two others: a convex room without anything in it, or a part of one.
///
/// True if every vertex lies in front of, or on, the plane of every face. All faces then lie on the boundary of one convex set,
/// and a segment between two of them stays inside it. Conservative: a scene that is convex but for rounding above 1e-12 of its size counts as not convex.
/// Work: planes × vertices at worst, with a stop at the first vertex behind a plane.
#[must_use]
pub fn is_convex_and_empty(scene: &Scene) -> bool {
    let (low, high) = scene.bounding_box();
    let slack = 1e-12 * (high - low).length();
    let mut used: Vec<u32> = scene.faces.iter().flat_map(|f| f.corners.as_slice().to_vec()).collect();
    used.sort_unstable();
    used.dedup();
    let mut last_plane: Option<(DVec3, f64)> = None;
    scene.face_ids().all(|face| {
        let normal = scene.area_vector(face).normalize_or_zero();
        let distance = normal.dot(scene.vertices[scene.faces[face.0 as usize].corners.as_slice()[0] as usize]);
        // A finely cut wall repeats its plane: it is checked once.
        let repeated = last_plane.is_some_and(|(n, d)| (n - normal).length() < 1e-14 && (d - distance).abs() < slack);
        last_plane = Some((normal, distance));
        repeated
            || used
                .iter()
                .all(|&v| normal.dot(scene.vertices[v as usize]) - distance >= -slack)
    })
}

/// Tells whether the light that leaves any front into the open stays inside: the scene bounds a closed space.
///
/// True if every edge is shared by exactly two faces that run along it in opposite senses, and every connected piece
/// is either an enclosure that faces inwards or lies in the bounding box of one. Conservative: a closed room whose faces meet in T-junctions,
/// or a block without a bottom on a floor, counts as not closed; rays then tell by not escaping.
#[must_use]
pub fn is_watertight(scene: &Scene) -> bool {
    let mut pieces: Vec<Piece> = Vec::new();
    for (face, piece) in scene.face_ids().zip(closed_pieces(scene)) {
        let Some(piece) = piece else {
            return false;
        };
        // Pieces are numbered in the order of their first faces.
        if piece as usize == pieces.len() {
            pieces.push(Piece::default());
        }
        pieces[piece as usize].add(&scene.polygon(face));
    }
    let in_a_room = |p: &Piece| pieces.iter().any(|room| room.faces_inwards() && room.contains(p));
    !pieces.is_empty() && pieces.iter().all(|p| p.faces_inwards() || in_a_room(p))
}

/// Tells of each face whether its front may see the back of some face, \[n_faces\].
///
/// False only where it is certain: every other face either lies in front of the plane of the face, so that its back looks away, or has all of the face in front of its own,
/// or is part of a closed piece of surface whose backs are out of sight: a sheet with two sides, the piece of the face itself, or a block that faces outwards and whose bounding
/// box is clear of the face. What hides a back otherwise is not looked at. What is nearer than 1e-7 of the scene's size counts as touching.
/// Work: faces × faces at worst, with a stop at the first back.
#[must_use]
pub fn may_see_backs(scene: &Scene) -> Vec<bool> {
    let (low, high) = scene.bounding_box();
    let slack = CLEAR * (high - low).length();
    let piece_of_face = closed_pieces(scene);
    let outlines: Vec<Outline> = scene.face_ids().map(|face| Outline::new(scene, face)).collect();
    let mut pieces: HashMap<u32, ClosedPiece> = HashMap::new();
    for (face, index) in piece_of_face.iter().enumerate() {
        let Some(index) = index else { continue };
        let piece = pieces.entry(*index).or_insert_with(|| ClosedPiece {
            first: face,
            is_flat: true,
            shape: Piece::default(),
        });
        let (first, own) = (&outlines[piece.first], &outlines[face]);
        piece.is_flat &= own.corners.iter().all(|&v| first.height(v).abs() <= slack);
        piece.shape.add(&own.corners);
    }
    let is_hidden = |back: usize, front: usize| {
        let Some(index) = piece_of_face[back] else {
            return false;
        };
        let piece = &pieces[&index];
        piece_of_face[front] == Some(index)
            || piece.is_flat
            || (!piece.shape.faces_inwards() && outlines[front].is_clear_of(&piece.shape, slack))
    };
    let sees_back = |front: usize, back: usize| {
        let (here, there) = (&outlines[front], &outlines[back]);
        front != back
            && there.corners.iter().any(|&v| here.height(v) > slack)
            && here.corners.iter().any(|&v| there.height(v) < -slack)
            && !is_hidden(back, front)
    };
    let faces = (0..outlines.len()).into_par_iter();
    faces
        .map(|front| (0..outlines.len()).any(|back| sees_back(front, back)))
        .collect()
}

/// What is nearer than this share of the scene's size counts as touching, as [`may_see_backs`] says: less than f32 resolves.
const CLEAR: f64 = 1e-7;

/// A closed piece of surface: its first face, and whether all of it lies in the plane of that.
struct ClosedPiece {
    first: usize,
    is_flat: bool,
    shape: Piece,
}

/// A face, with its plane.
struct Outline {
    corners: Vec<DVec3>,
    normal: DVec3,
}

impl Outline {
    fn new(scene: &Scene, face: FaceId) -> Self {
        Self {
            corners: scene.polygon(face),
            normal: scene.area_vector(face).normalize_or_zero(),
        }
    }

    /// Returns how far a point is in front of the plane.
    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }

    /// Tells whether the bounding box is clear of that of a piece.
    fn is_clear_of(&self, piece: &Piece, margin: f64) -> bool {
        let (low, high) = self
            .corners
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &v| {
                (low.min(v), high.max(v))
            });
        (low - margin).cmpgt(piece.high).any() || (high + margin).cmplt(piece.low).any()
    }
}

/// Returns for each face its connected piece of surface, if that is closed: if every edge is run along once in each sense.
///
/// Pieces are numbered from 0, open ones too, in the order of their first faces.
pub(crate) fn closed_pieces(scene: &Scene) -> Vec<Option<u32>> {
    let mut runs: HashMap<(u32, u32), (u32, bool)> = HashMap::new();
    for face in scene.face_ids() {
        for edge in edges(scene, face) {
            runs.entry(edge)
                .and_modify(|run| run.1 = false)
                .or_insert((face.0, true));
        }
    }
    let mut piece: Vec<Option<u32>> = vec![None; scene.faces.len()];
    let mut closed = Vec::new();
    for seed in scene.face_ids() {
        if piece[seed.0 as usize].is_some() {
            continue;
        }
        let index = u32::try_from(closed.len()).ok();
        let mut is_closed = true;
        let mut stack = vec![seed.0];
        piece[seed.0 as usize] = index;
        while let Some(face) = stack.pop() {
            for (a, b) in edges(scene, FaceId(face)) {
                let once = runs.get(&(a, b)).is_some_and(|run| run.1);
                match runs.get(&(b, a)) {
                    Some(&(neighbour, true)) if once => {
                        if piece[neighbour as usize].is_none() {
                            piece[neighbour as usize] = index;
                            stack.push(neighbour);
                        }
                    }
                    _ => is_closed = false,
                }
            }
        }
        closed.push(is_closed);
    }
    for entry in &mut piece {
        *entry = entry.filter(|&k| closed[k as usize]);
    }
    piece
}

fn edges(scene: &Scene, face: FaceId) -> impl Iterator<Item = (u32, u32)> + use<> {
    let corners = scene.faces[face.0 as usize].corners;
    let n = corners.as_slice().len();
    (0..n).map(move |k| (corners.as_slice()[k], corners.as_slice()[(k + 1) % n]))
}

/// A connected closed surface: its box and its signed volume.
struct Piece {
    low: DVec3,
    high: DVec3,
    /// Six times the volume that the normals point out of.
    volume: f64,
    anchor: Option<DVec3>,
}

impl Default for Piece {
    fn default() -> Self {
        Self {
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
            volume: 0.0,
            anchor: None,
        }
    }
}

impl Piece {
    fn add(&mut self, corners: &[DVec3]) {
        let anchor = *self.anchor.get_or_insert(corners[0]);
        for &v in corners {
            self.low = self.low.min(v);
            self.high = self.high.max(v);
        }
        for w in corners[1..].windows(2) {
            self.volume += (corners[0] - anchor).dot((w[0] - anchor).cross(w[1] - anchor));
        }
    }

    fn faces_inwards(&self) -> bool {
        self.volume < 0.0
    }

    fn contains(&self, other: &Self) -> bool {
        self.low.cmple(other.low).all() && self.high.cmpge(other.high).all()
    }
}
