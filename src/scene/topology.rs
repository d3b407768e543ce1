//! What the faces of a scene tell about visibility before any ray is traced.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{FaceId, Positions, Scene};
use crate::geometry::box_pairs::overlapping_pairs;
use crate::geometry::polygon;

/// Tells whether no face can stand between two others: a convex room without anything in it, or a part of one.
///
/// True if every vertex lies in front of, or on, the plane of every face. All faces then lie on the boundary of one convex set,
/// and a segment between two of them stays inside it. Conservative: a scene that is convex but for rounding above 1e-12 of its size, or 1e-9 of its smallest face, counts as not convex,
/// and so does one that is no higher over a face than rounded coordinates explain: a sheet, whose sides rounding may have parted.
/// Work: planes × vertices at worst, with a stop at the first vertex behind a plane.
#[must_use]
pub fn is_convex_and_empty(scene: &Scene) -> bool {
    let (low, high) = scene.bounding_box();
    // What is far off, and makes a scene large, must not make small things vanish.
    let tolerance = (1e-12 * (high - low).length()).min(1e-9 * smallest_face(scene));
    let slack = scene.slack();
    let mut used: Vec<u32> = scene.faces.iter().flat_map(|f| f.corners.as_slice().to_vec()).collect();
    used.sort_unstable();
    used.dedup();
    let mut last_plane: Option<(DVec3, f64)> = None;
    scene.face_ids().all(|face| {
        let normal = scene.area_vector(face).normalize_or_zero();
        let distance = normal.dot(scene.vertices[scene.faces[face.0 as usize].corners.as_slice()[0] as usize]);
        // A finely cut wall repeats its plane: it is checked once.
        let repeated =
            last_plane.is_some_and(|(n, d)| (n - normal).length() < 1e-14 && (d - distance).abs() < tolerance);
        last_plane = Some((normal, distance));
        let height = |v: &u32| normal.dot(scene.vertices[*v as usize]) - distance;
        repeated
            || used.iter().all(|v| height(v) >= -tolerance) && (slack == 0.0 || used.iter().any(|v| height(v) > slack))
    })
}

/// Tells whether the light that leaves any front stays inside: the scene bounds a closed space.
///
/// True if every edge is shared by exactly two faces that run along it in opposite senses, and the front of every connected piece
/// lies inside of one that faces inwards. Conservative: a closed room whose faces meet in T-junctions,
/// or a block without a bottom on a floor, counts as not closed; rays then tell by not escaping.
#[must_use]
pub fn is_watertight(scene: &Scene) -> bool {
    Enclosure::of(scene).watertight
}

/// How the closed pieces of a scene's surface stand in one another.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Enclosure {
    /// See [`is_watertight`].
    pub watertight: bool,
    /// The first face of each closed piece that faces inwards although it stands in the open space of another that does: a block that is wound the wrong way.
    pub turned: Vec<FaceId>,
}

/// Points that tell on which side of the other pieces a piece lies.
const POINTS_OF_PIECE: usize = 8;

impl Enclosure {
    /// Looks at a few points of each piece.
    ///
    /// Work: O(n log n).
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let piece_of_face = closed_pieces(scene);
        let mut faces_of_piece: BTreeMap<u32, Vec<FaceId>> = BTreeMap::new();
        for (face, piece) in scene.face_ids().zip(&piece_of_face) {
            if let Some(piece) = piece {
                faces_of_piece.entry(*piece).or_default().push(face);
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
        let found = sides(scene, &piece_of_face, &points);
        let mut watertight = !piece_of_face.is_empty() && !piece_of_face.contains(&None);
        let mut turned = Vec::new();
        let mut rest = points.iter().zip(&found).peekable();
        for (piece, faces) in &faces_of_piece {
            let (mut n_clear, mut n_turned) = (0, 0);
            while let Some((_, sides)) = rest.next_if(|((face, _), _)| piece_of_face[face.0 as usize] == Some(*piece)) {
                let Some(Sides { front, back }) = sides else {
                    continue;
                };
                n_clear += 1;
                watertight &= front.iter().any(|around| around.1 < 0);
                let faces_inwards = front.iter().any(|around| around.0 == *piece && around.1 < 0);
                // Solid and open space take turns: inwards, outwards, inwards.
                n_turned += usize::from(faces_inwards && back.iter().map(|around| around.1).sum::<i32>() < 0);
            }
            watertight &= n_clear > 0;
            if 2 * n_turned > n_clear {
                turned.push(faces[0]);
            }
        }
        Self { watertight, turned }
    }
}

/// A part of space: the closed pieces of surface around it with their winding numbers, −1 for one that faces inwards; empty in the open.
type Region = Vec<(u32, i32)>;

/// What lies in front of a face, and behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Sides {
    front: Region,
    back: Region,
}

/// Where the rays go that tell winding numbers: askew to all that is built along axes and diagonals.
const ASKEW: DVec3 = DVec3::new(0.417_022, 0.300_114, 0.857_913);

/// Finds the regions on both sides of faces at points of them; `None` where a face of another piece touches the point, and in faces of open pieces.
///
/// A ray from the point crosses a piece as often from back to front as from front to back, but for its winding number around the point. Edges are shared to the
/// last bit, so that a ray through one crosses exactly one of its faces.
/// Work: O(n log n) and the number of crossings.
pub(crate) fn sides(scene: &Scene, piece_of_face: &[Option<u32>], points: &[(FaceId, DVec3)]) -> Vec<Option<Sides>> {
    let (low, high) = scene.bounding_box();
    let middle = low.midpoint(high);
    let along = ASKEW.normalize();
    let across = along.any_orthonormal_vector();
    let frame = DMat3::from_cols(across, along.cross(across), along).transpose();
    let slack = touching(scene);
    let faces: Vec<FaceId> = scene
        .face_ids()
        .filter(|face| piece_of_face[face.0 as usize].is_some())
        .collect();
    let outlines: Vec<(Positions, DVec3)> = faces
        .iter()
        .map(|face| {
            let mut corners = scene.positions(&scene.faces[face.0 as usize]);
            corners.iter_mut().for_each(|v| *v = frame * (*v - middle));
            let normal = polygon::area_vector(&corners).normalize_or_zero();
            (corners, normal)
        })
        .collect();
    let at: Vec<DVec3> = points.iter().map(|&(_, point)| frame * (point - middle)).collect();
    // Seen along the rays, which are points then.
    let of_faces = outlines.iter().map(|(corners, _)| corners.bounding_box());
    let boxes = of_faces.chain(at.iter().map(|&v| (v, v)));
    let boxes = boxes
        .map(|(least, most)| (least.with_z(0.0), most.with_z(0.0)))
        .collect();
    let mut crossings: Vec<Option<Region>> = points
        .iter()
        .map(|(face, _)| piece_of_face[face.0 as usize].map(|_| Region::new()))
        .collect();
    overlapping_pairs(boxes, |a, b| {
        let (face, point) = (a.min(b) as usize, a.max(b) as usize);
        if face >= faces.len() || point < faces.len() {
            return;
        }
        let point = point - faces.len();
        let (own, here) = (points[point].0, at[point]);
        let Some(found) = &mut crossings[point] else {
            return;
        };
        let (corners, normal) = &outlines[face];
        let turns = turns_around(corners, here);
        if turns == 0 || faces[face] == own {
            return;
        }
        let piece = piece_of_face[faces[face].0 as usize];
        let height = normal.dot(corners[0] - here);
        let is_ahead = if height.abs() > slack {
            height * normal.z > 0.0
        } else {
            let own_normal = frame * scene.area_vector(own);
            if piece != piece_of_face[own.0 as usize] || own_normal.dot(*normal) > 0.0 {
                crossings[point] = None;
                return;
            }
            // The other face of a sheet lies behind the one that the point is on.
            own_normal.z < 0.0
        };
        if is_ahead && let Some(piece) = piece {
            found.push((piece, turns));
        }
    });
    crossings
        .into_iter()
        .zip(points)
        .map(|(found, &(own, _))| {
            let (mut front, piece) = found.zip(piece_of_face[own.0 as usize])?;
            if along.dot(scene.area_vector(own)) < 0.0 {
                front.push((piece, -1));
            }
            let mut back = front.clone();
            back.push((piece, 1));
            Some(Sides {
                front: summed(front),
                back: summed(back),
            })
        })
        .collect()
}

/// Tells of each place on faces whether all that can be seen from it are fronts: it lies inside of a piece, and no face has its back there.
///
/// Regions are told apart by what is around them, so that two rooms that are parts of one piece count as one.
pub(crate) fn see_fronts_alone(places: &[Option<Sides>]) -> Vec<bool> {
    let behind: HashSet<&Region> = places.iter().flatten().map(|place| &place.back).collect();
    let is_closed = |place: &Sides| !place.front.is_empty() && !behind.contains(&place.front);
    places
        .iter()
        .map(|place| place.as_ref().is_some_and(is_closed))
        .collect()
}

/// Returns the diameter of the smallest face, in m.
fn smallest_face(scene: &Scene) -> f64 {
    let sizes = scene.faces.iter().map(|face| {
        let (low, high) = scene.positions(face).bounding_box();
        low.distance(high)
    });
    sizes.fold(f64::INFINITY, f64::min)
}

/// Returns how near two pieces are that count as touching, in m: less than f32 resolves in a scene of this size, and than a thousandth of its smallest face.
pub(crate) fn touching(scene: &Scene) -> f64 {
    let (low, high) = scene.bounding_box();
    (1e-7 * low.distance(high)).min(1e-3 * smallest_face(scene))
        + 8.0 * f64::EPSILON * low.abs().max(high.abs()).max_element()
}

/// Adds up the winding numbers of each piece.
fn summed(crossings: Region) -> Region {
    let mut sums: BTreeMap<u32, i32> = BTreeMap::new();
    for (piece, turns) in crossings {
        *sums.entry(piece).or_default() += turns;
    }
    sums.into_iter().filter(|(_, turns)| *turns != 0).collect()
}

/// Returns how often an outline turns around the line through a point along z, counter-clockwise.
///
/// An edge is looked at from its lower end whichever way it is run along, so that those of two faces along it cancel to the last bit.
fn turns_around(corners: &[DVec3], point: DVec3) -> i32 {
    let mut from = corners[corners.len() - 1];
    let mut turns = 0;
    for &to in corners {
        let (a, b) = (from.truncate(), to.truncate());
        let rises = b.y > a.y;
        let (lower, upper) = if rises { (a, b) } else { (b, a) };
        let p = point.truncate();
        if lower.y <= p.y && p.y < upper.y && (upper - lower).perp_dot(p - lower) > 0.0 {
            turns += if rises { 1 } else { -1 };
        }
        from = to;
    }
    turns
}

/// Tells of each face whether its front may see the back of some face, \[n_faces\].
///
/// False only where it is certain: every other face either lies in front of the plane of the face, so that its back looks away, or has all of the face in front of its own,
/// or is part of a closed piece of surface whose backs are out of sight: a sheet with two sides, the piece of the face itself, or a block that faces outwards and whose bounding
/// box is clear of the face. What hides a back otherwise is not looked at. What is nearer than 1e-7 of the scene's size counts as touching.
/// Work: faces × faces at worst, with a stop at the first back; of a flat ground O(n).
#[must_use]
pub fn may_see_backs(scene: &Scene) -> Vec<bool> {
    let slack = touching(scene);
    let piece_of_face = closed_pieces(scene);
    let outlines: Vec<Outline> = scene.face_ids().map(|face| Outline::new(scene, face)).collect();
    let mut pieces: HashMap<u32, ClosedPiece> = HashMap::new();
    for (face, index) in piece_of_face.iter().enumerate() {
        let Some(index) = index else { continue };
        let piece = pieces.entry(*index).or_insert_with(|| ClosedPiece {
            first: face,
            is_flat: true,
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
            volume: 0.0,
        });
        let (first, own) = (&outlines[piece.first], &outlines[face]);
        piece.is_flat &= own.corners.iter().all(|&v| first.height(v).abs() <= slack);
        piece.add(&own.corners, first.corners[0]);
    }
    let is_hidden = |back: usize, front: usize| {
        let Some(index) = piece_of_face[back] else {
            return false;
        };
        let piece = &pieces[&index];
        piece_of_face[front] == Some(index)
            || piece.is_flat
            || (piece.volume >= 0.0 && outlines[front].is_clear_of(piece, slack))
    };
    let boxes = Boxes::new(outlines.iter().map(|outline| outline.corners.bounding_box()).collect());
    let sees_back = |front: usize, back: usize| {
        let (here, there) = (&outlines[front], &outlines[back]);
        front != back
            && there.corners.iter().any(|&v| here.height(v) > slack)
            && here.corners.iter().any(|&v| there.height(v) < -slack)
            && !is_hidden(back, front)
    };
    let faces = (0..outlines.len()).into_par_iter();
    faces
        .map(|front| {
            let here = &outlines[front];
            let may_be_above = |(low, high): (DVec3, DVec3)| {
                let reach = here.normal.abs().dot(high - low) * 0.5;
                here.height(low.midpoint(high)) + reach > slack
            };
            boxes.any(may_be_above, |back| sees_back(front, back))
        })
        .collect()
}

/// Items of a box, and boxes of the next one.
const PER_BOX: usize = 16;

/// Boxes around consecutive items, around consecutive boxes of these, and so on: those that belong together mostly follow one another in a file.
struct Boxes(Vec<Vec<(DVec3, DVec3)>>);

impl Boxes {
    /// Takes the boxes of the items.
    fn new(of_items: Vec<(DVec3, DVec3)>) -> Self {
        let mut levels = vec![of_items];
        while let Some(last) = levels.last()
            && last.len() > 1
        {
            let around = |boxes: &[(DVec3, DVec3)]| {
                let joined = boxes.iter().copied();
                joined.fold(boxes[0], |(low, high), (l, h)| (low.min(l), high.max(h)))
            };
            levels.push(last.chunks(PER_BOX).map(around).collect());
        }
        Self(levels)
    }

    /// Tells whether any item in the boxes that `may` hold one `is` one.
    fn any(&self, may: impl Fn((DVec3, DVec3)) -> bool, is: impl Fn(usize) -> bool) -> bool {
        let top = self.0.len() - 1;
        let mut open: Vec<(usize, usize)> = (0..self.0[top].len()).map(|k| (top, k)).collect();
        while let Some((level, k)) = open.pop() {
            if !may(self.0[level][k]) {
                continue;
            }
            if level == 0 {
                if is(k) {
                    return true;
                }
            } else {
                let first = k * PER_BOX;
                open.extend((first..self.0[level - 1].len().min(first + PER_BOX)).map(|next| (level - 1, next)));
            }
        }
        false
    }
}

/// A closed piece of surface.
struct ClosedPiece {
    /// Its first face.
    first: usize,
    /// Whether all of it lies in the plane of that.
    is_flat: bool,
    low: DVec3,
    high: DVec3,
    /// Six times the volume that the normals point out of.
    volume: f64,
}

impl ClosedPiece {
    /// Adds a face; volumes are those of pyramids from `apex`.
    fn add(&mut self, corners: &[DVec3], apex: DVec3) {
        for &v in corners {
            self.low = self.low.min(v);
            self.high = self.high.max(v);
        }
        for w in corners[1..].windows(2) {
            self.volume += (corners[0] - apex).dot((w[0] - apex).cross(w[1] - apex));
        }
    }
}

/// A face, with its plane.
struct Outline {
    corners: Positions,
    normal: DVec3,
}

impl Outline {
    fn new(scene: &Scene, face: FaceId) -> Self {
        Self {
            corners: scene.positions(&scene.faces[face.0 as usize]),
            normal: scene.area_vector(face).normalize_or_zero(),
        }
    }

    /// Returns how far a point is in front of the plane.
    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }

    /// Tells whether the bounding box is clear of that of a piece.
    fn is_clear_of(&self, piece: &ClosedPiece, margin: f64) -> bool {
        let (low, high) = self.corners.bounding_box();
        (low - margin).cmpgt(piece.high).any() || (high + margin).cmplt(piece.low).any()
    }
}

/// Returns for each face its connected piece of surface, if that is closed: if every edge is run along once in each sense.
///
/// Pieces are numbered from 0, open ones too, in the order of their first faces.
pub(crate) fn closed_pieces(scene: &Scene) -> Vec<Option<u32>> {
    let runs = edge_runs(scene);
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

/// Returns, for each edge from one vertex to another, the first face that runs along it so, and whether no other does.
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
