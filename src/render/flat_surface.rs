//! Planar surfaces and their bounding rectangles.

use glam::{DVec2, DVec3};

use crate::geometry::polygon;
use crate::scene::{FaceId, Scene, SurfaceId};

/// The greatest distance of a planar surface's vertices from its plane, relative to its size, which allows for the rounding of a scene file.
const PLANARITY_TOLERANCE: f64 = 1e-6;

/// A surface whose faces lie in one plane and face the same way.
#[derive(Clone, Debug)]
pub(super) struct FlatSurface {
    pub(super) surface: SurfaceId,
    pub(super) name: String,
    pub(super) normal: DVec3,
    /// The largest distance of a vertex from the plane through the first one, in m.
    pub(super) deviation: f64,
    /// Whether the convex hull is a rectangle, to the same tolerance.
    pub(super) is_rectangle: bool,
    pub(super) natural: Oriented,
    /// The corners of the convex hull.
    hull: Vec<DVec3>,
}

/// A surface's bounding rectangle in a given orientation.
#[derive(Clone, Debug)]
pub(super) struct Oriented {
    /// The top left corner.
    pub(super) corner: DVec3,
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    /// Lengths along right and up.
    pub(super) size: [f64; 2],
}

impl FlatSurface {
    /// Returns the smallest bounding rectangle, its right side nearest to the first edge of the first face.
    /// Returns the bounding rectangle with sides along two given orthogonal unit vectors in the surface's plane.
    pub(super) fn oriented(&self, right: DVec3, up: DVec3) -> Oriented {
        bounding_rectangle(&self.hull, right, up)
    }
}

/// Returns the planar surfaces in file order, and the names of the others; surfaces without faces are in neither list.
pub(super) fn flat_surfaces(scene: &Scene) -> (Vec<FlatSurface>, Vec<String>) {
    let mut faces_of: Vec<Vec<FaceId>> = vec![Vec::new(); scene.surfaces.len()];
    for face in scene.face_ids() {
        faces_of[scene.faces[face.0 as usize].surface.0 as usize].push(face);
    }
    let (mut flat, mut others) = (Vec::new(), Vec::new());
    for ((id, surface), faces) in (0..).zip(&scene.surfaces).zip(&faces_of) {
        if faces.is_empty() {
            continue;
        }
        match flatten(scene, SurfaceId(id), &surface.name, faces) {
            Some(surface) => flat.push(surface),
            None => others.push(surface.name.clone()),
        }
    }
    (flat, others)
}

fn flatten(scene: &Scene, surface: SurfaceId, name: &str, faces: &[FaceId]) -> Option<FlatSurface> {
    let polygons: Vec<Vec<DVec3>> = faces.iter().map(|&face| scene.polygon(face)).collect();
    let total: DVec3 = polygons.iter().map(|corners| polygon::area_vector(corners)).sum();
    let normal = total.normalize_or_zero();
    let origin = polygons[0][0];
    let (mut deviation, mut extent) = (0.0_f64, 0.0_f64);
    for corners in &polygons {
        if polygon::area_vector(corners).dot(normal) <= 0.0 {
            return None;
        }
        for &v in corners {
            deviation = deviation.max(normal.dot(v - origin).abs());
            extent = extent.max((v - origin).length());
        }
    }
    if deviation > PLANARITY_TOLERANCE * extent {
        return None;
    }
    let first_edge = polygons[0][1] - origin;
    let x = (first_edge - normal * normal.dot(first_edge)).normalize();
    let y = normal.cross(x);
    let hull: Vec<DVec3> = convex_hull(polygons.iter().flatten().map(|&v| {
        let local = DVec2::new(x.dot(v - origin), y.dot(v - origin));
        (local, v)
    }));
    let natural = smallest_rectangle(&hull, normal, x);
    let missing = natural.size[0] * natural.size[1] - polygon::area_vector(&hull).length();
    Some(FlatSurface {
        is_rectangle: missing <= PLANARITY_TOLERANCE * extent * extent,
        surface,
        name: name.to_owned(),
        normal,
        deviation,
        natural,
        hull,
    })
}

/// Returns the smallest bounding rectangle of a convex polygon; a rectangle along `first` wins against equal ones.
///
/// One side of the smallest rectangle lies along an edge of the hull ([`FREEMAN_SHAPIRA_1975`](crate::references::FREEMAN_SHAPIRA_1975)).
fn smallest_rectangle(hull: &[DVec3], normal: DVec3, first: DVec3) -> Oriented {
    let edges = (0..hull.len()).map(|k| (hull[(k + 1) % hull.len()] - hull[k]).normalize_or_zero());
    let mut best = bounding_rectangle(hull, first, normal.cross(first));
    let area = |oriented: &Oriented| oriented.size[0] * oriented.size[1];
    for edge in edges.filter(|edge| *edge != DVec3::ZERO) {
        let candidate = bounding_rectangle(hull, edge, normal.cross(edge));
        if area(&candidate) < area(&best) * (1.0 - 1e-9) {
            best = candidate;
        }
    }
    let (r, u) = (best.right, best.up);
    let mut turned = r;
    for side in [u, -r, -u] {
        if side.dot(first) > turned.dot(first) {
            turned = side;
        }
    }
    bounding_rectangle(hull, turned, normal.cross(turned))
}

fn bounding_rectangle(points: &[DVec3], right: DVec3, up: DVec3) -> Oriented {
    let origin = points[0];
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for &v in points {
        let local = DVec2::new(right.dot(v - origin), up.dot(v - origin));
        low = low.min(local);
        high = high.max(local);
    }
    Oriented {
        corner: origin + right * low.x + up * high.y,
        right,
        up,
        size: (high - low).to_array(),
    }
}

/// Returns the convex hull's corners counter-clockwise (Andrew's monotone chain, 1979).
fn convex_hull(points: impl Iterator<Item = (DVec2, DVec3)>) -> Vec<DVec3> {
    let mut points: Vec<(DVec2, DVec3)> = points.collect();
    points.sort_by(|(a, _), (b, _)| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |sorted: &mut dyn Iterator<Item = &(DVec2, DVec3)>| {
        let mut hull: Vec<(DVec2, DVec3)> = Vec::new();
        for &p in sorted {
            while let [.., (a, _), (b, _)] = hull[..] {
                if (b - a).perp_dot(p.0 - a) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter());
    hull.extend(chain(&mut points.iter().rev()));
    hull.into_iter().map(|(_, v)| v).collect()
}
