//! What the faces of a scene tell about visibility before any ray is traced.

use std::collections::HashMap;

use glam::DVec3;

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
