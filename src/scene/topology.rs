//! Visibility that follows from the faces of a scene without rays.

mod caps;
mod pieces;
mod regions;

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use super::{FaceId, Scene};
use crate::geometry::polygon;
pub(crate) use pieces::{Pieces, joint};
use regions::Sides;
pub(crate) use regions::{Backs, Place, View, places};

/// Returns whether no face can occlude one from another, as in an empty convex room or a part of one.
///
/// True if every vertex lies in front of, or on, the plane of every face. All faces then lie on the boundary of one convex set,
/// and a segment between two of them stays inside it.
///
/// Conservative: a scene that is convex up to rounding above 1e-12 of its size, or 1e-9 of its smallest face, counts as not convex.
/// A scene whose height over a face is within the rounding of its coordinates also counts as not convex: it may be a sheet whose sides rounding has parted.
/// Work: planes × vertices at worst, with a stop at the first vertex behind a plane.
#[must_use]
pub fn is_convex_and_empty(scene: &Scene) -> bool {
    let (low, high) = scene.bounding_box();
    // Distant objects enlarge the scene, and must not make small ones vanish.
    let tolerance = (1e-12 * (high - low).length()).min(1e-9 * smallest_face(scene));
    let slack = scene.slack();
    let mut used: Vec<u32> = scene.faces.iter().flat_map(|f| f.corners.as_slice().to_vec()).collect();
    used.sort_unstable();
    used.dedup();
    let mut last_plane: Option<(DVec3, f64)> = None;
    scene.face_ids().all(|face| {
        let normal = scene.area_vector(face).normalize_or_zero();
        let distance = normal.dot(scene.vertices[scene.faces[face.0 as usize].corners.as_slice()[0] as usize]);
        // The repeated plane of a finely cut wall is checked once.
        let repeated =
            last_plane.is_some_and(|(n, d)| (n - normal).length() < 1e-14 && (d - distance).abs() < tolerance);
        last_plane = Some((normal, distance));
        let height = |v: &u32| normal.dot(scene.vertices[*v as usize]) - distance;
        repeated
            || used.iter().all(|v| height(v) >= -tolerance) && (slack == 0.0 || used.iter().any(|v| height(v) > slack))
    })
}

/// Returns whether the scene bounds a closed space, in which all light that leaves a front stays.
///
/// True if the fronts of all faces lie inside of pieces that are closed and face inwards. A piece is closed if faces run along every part of its edges as often in one sense as in
/// the other, also in T-junctions and where vertices miss each other by the rounding of coordinates, or by 1e-8 of the smallest face around them. A piece that ends on faces of others
/// which cover its opening is closed too, as a block without a bottom on a floor.
///
/// Conservative: where faces of several pieces lie on each other, or where a sheet pierces a wall, a closed room may count as not closed; rays that do not escape then show it.
#[must_use]
pub fn is_watertight(scene: &Scene) -> bool {
    Enclosure::of(scene).watertight
}

/// The nesting of the closed pieces of a scene's surface.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Enclosure {
    /// See [`is_watertight`].
    pub watertight: bool,
    /// The first face of each closed piece that faces inwards although it stands in the open space of another such piece: a block with reversed winding.
    pub turned: Vec<FaceId>,
}

/// The number of points that decide on which side of the other pieces a piece lies.
const POINTS_OF_PIECE: usize = 8;

impl Enclosure {
    /// Examines a few points of each closed piece, and every face of the others.
    ///
    /// Work: O(n log n).
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let pieces = Pieces::of(scene);
        let mut faces_of_piece: BTreeMap<u32, Vec<FaceId>> = BTreeMap::new();
        let mut of_open = Vec::new();
        for face in scene.face_ids() {
            match pieces.closed(face) {
                Some(piece) => faces_of_piece.entry(piece).or_default().push(face),
                None => of_open.push((face, scene.polygon(face))),
            }
        }
        let points: Vec<(FaceId, DVec3)> = faces_of_piece
            .values()
            .flat_map(|faces| {
                let n = faces.len().min(POINTS_OF_PIECE);
                (0..n).map(move |k| faces[k * faces.len() / n])
            })
            .map(|face| (face, polygon::centroid(&scene.polygon(face))))
            .collect();
        let found = regions::sides(scene, &pieces, &points);
        let mut watertight = !faces_of_piece.is_empty();
        let mut turned = Vec::new();
        let mut rest = points.iter().zip(&found).peekable();
        for (piece, faces) in &faces_of_piece {
            let (mut n_clear, mut n_turned) = (0, 0);
            while let Some((_, sides)) = rest.next_if(|((face, _), _)| pieces.of_face(*face) == *piece) {
                let Sides { front, back, touching } = sides;
                if !touching.is_empty() {
                    continue;
                }
                n_clear += 1;
                watertight &= front.iter().any(|around| around.1 < 0);
                let faces_inwards = front.iter().any(|around| around.0 == *piece && around.1 < 0);
                // Solid and open space alternate: inwards, outwards, inwards.
                n_turned += usize::from(faces_inwards && back.iter().map(|around| around.1).sum::<i32>() < 0);
            }
            watertight &= n_clear > 0;
            // A sheet has no inside.
            if 2 * n_turned > n_clear && !pieces.is_sheet(*piece) {
                turned.push(faces[0]);
            }
        }
        watertight = watertight
            && places(scene, &pieces, &of_open)
                .iter()
                .all(|place| place.front.is_enclosed());
        Self { watertight, turned }
    }
}

/// Returns the diameter of the smallest face, in m.
fn smallest_face(scene: &Scene) -> f64 {
    let sizes = scene.faces.iter().map(|face| {
        let (low, high) = scene.positions(face).bounding_box();
        low.distance(high)
    });
    sizes.fold(f64::INFINITY, f64::min)
}

/// Returns the least and the greatest corner of the box around a polygon.
pub(crate) fn bounding_box(corners: &[DVec3]) -> (DVec3, DVec3) {
    polygon::bounds(corners)
}

/// Returns a number of faces or pieces as a u32.
fn index(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(u32::MAX)
}

/// Returns, for each directed edge, the first face that runs along it, and whether it is the only one.
pub(crate) fn edge_runs(scene: &Scene) -> HashMap<(u32, u32), (u32, bool)> {
    let mut runs = HashMap::new();
    for face in scene.face_ids() {
        for edge in edges(scene, face) {
            runs.entry(edge)
                .and_modify(|run: &mut (u32, bool)| run.1 = false)
                .or_insert((face.0, true));
        }
    }
    runs
}

/// Returns the vertices at the ends of a face's edges, in the order of its corners.
pub(crate) fn edges(scene: &Scene, face: FaceId) -> impl Iterator<Item = (u32, u32)> + use<> {
    let corners = scene.faces[face.0 as usize].corners;
    let n = corners.as_slice().len();
    (0..n).map(move |k| (corners.as_slice()[k], corners.as_slice()[(k + 1) % n]))
}
