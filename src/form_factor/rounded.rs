//! The uncertainty of exchange areas and form factors from rounded coordinates: one place for all methods.

mod behind;
mod rows;

use std::f64::consts::PI;

use glam::DVec3;

use super::Input;
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::point_form_factor::point_form_factor_vector;
use crate::geometry::polygon;
use crate::mesh::{Mesh, PatchId, mean_value_weights};
use crate::scene::{FaceId, Scene, Written};
use crate::visibility::plane::Lean;
use crate::visibility::shaft::Shaft;
pub(super) use behind::state;
use behind::{Glance, Plane};
pub(super) use rows::RoundedRows;

/// The standard deviations that are stated, unless the worst case of all coordinates, each off by half a unit, is less.
const DEVIATIONS: f64 = 3.0;

/// The distance, in sums of radii, from which on another patch counts as a point.
const FAR: f64 = 5.0;

/// The part of the way to the middle by which points on an edge are moved inside: fields have no direction on an edge that two patches share.
const INSIDE: f64 = 1e-3;

/// Three points of Gauss's rule on \[0, 1\], and their weights.
const RULE: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 4.0 / 9.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// A vertex of the scene and how far each of its coordinates may be off, in m.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    position: DVec3,
    half: DVec3,
}

impl Vertex {
    fn new(position: DVec3, written: &Written) -> Self {
        let half = position.to_array().map(|x| 0.5 * written.unit(x.abs()));
        Self {
            position,
            half: DVec3::from_array(half),
        }
    }
}

/// The sum of both patches' border shares of their areas from which on a first order is meaningless.
const KNOWN: f64 = 2.0;

/// The same sum from which on the first order does not show the effect of occluders.
const COARSE: f64 = 0.1;

/// A patch and the vertices of its face, which its corners move with.
#[derive(Clone, Debug)]
struct End {
    face: FaceId,
    plane: Plane,
    corners: Vec<DVec3>,
    normal: DVec3,
    middle: DVec3,
    radius: f64,
    area: f64,
    perimeter: f64,
    vertices: Vec<Vertex>,
    /// The greatest distance by which a vertex may be off, in m.
    off: f64,
    /// The fraction of each vertex's displacement that a corner follows.
    shares: Vec<[f64; 4]>,
}

impl End {
    fn new(scene: &Scene, mesh: &Mesh, patch: PatchId, written: &Written) -> Self {
        let corners = mesh.polygon(patch);
        let own = &mesh.patches[patch.0 as usize];
        let outline = scene.polygon(own.face);
        let share = |corner: &DVec3| {
            let mut shares = [0.0; 4];
            mean_value_weights(&outline, *corner, |k, weight| shares[k] += weight);
            shares
        };
        let vertices: Vec<Vertex> = outline.iter().map(|&v| Vertex::new(v, written)).collect();
        let n = corners.len();
        let middle = corners.iter().sum::<DVec3>() / n as f64;
        Self {
            face: own.face,
            plane: Plane::new(&vertices, own.normal),
            normal: own.normal,
            middle,
            radius: corners.iter().map(|v| v.distance(middle)).fold(0.0, f64::max),
            area: own.area,
            perimeter: (0..n).map(|k| corners[k].distance(corners[(k + 1) % n])).sum(),
            shares: corners.iter().map(share).collect(),
            off: vertices.iter().map(|v| v.half.length()).fold(0.0, f64::max),
            vertices,
            corners,
        }
    }

    /// Returns the share of the area in a border as wide as the corners may be off.
    fn border(&self) -> f64 {
        self.off * self.perimeter / self.area
    }
}

/// The change of the form factors of two patches where a vertex moves, per m.
#[derive(Clone, Copy, Debug)]
struct Term {
    vertex: Vertex,
    /// The change of A_i F_ij.
    of_exchange: DVec3,
    /// The changes of both areas.
    of_areas: [DVec3; 2],
}

/// The terms of all vertices that a pair depends on.
#[derive(Debug, Default)]
struct Terms(Vec<Term>);

impl Terms {
    /// Returns the terms of the borders of two patches; `lit` is the part of the light without occluders that passes at a point of one.
    fn of_borders(ends: [&End; 2], lit: impl Fn(&End, DVec3) -> f64) -> Self {
        let mut terms = Self(Vec::with_capacity(8));
        for k in 0..2 {
            border_terms([ends[k], ends[1 - k]], k, |x| lit(ends[k], x), &mut terms);
        }
        terms
    }

    /// Returns the rounding error of an exchange area, m², for whichever of the two areas divides it.
    fn worst(&self, ends: [&End; 2], exchange: f64) -> f64 {
        let of_end = |k: usize| self.error(k, exchange / ends[k].area);
        of_end(0).max(of_end(1))
    }

    fn at(&mut self, vertex: Vertex) -> &mut Term {
        let found = self.0.iter().position(|term| term.vertex.position == vertex.position);
        let k = found.unwrap_or_else(|| {
            self.0.push(Term {
                vertex,
                of_exchange: DVec3::ZERO,
                of_areas: [DVec3::ZERO; 2],
            });
            self.0.len() - 1
        });
        &mut self.0[k]
    }

    /// Returns the rounding error of A_i F_ij, m², where A_i is off as well: `k` is the place of i, `factor` F_ij.
    ///
    /// Coordinates are off by up to half a unit, each by itself, or all of the same value in one direction alike, as those of a wall along an axis: whichever is more.
    fn error(&self, k: usize, factor: f64) -> f64 {
        let (mut most, mut square) = (0.0, 0.0);
        let mut alike: Vec<(usize, f64, f64)> = Vec::with_capacity(3 * self.0.len());
        for term in &self.0 {
            let off = (term.of_exchange - factor * term.of_areas[k]) * term.vertex.half;
            most += off.abs().element_sum();
            square += off.length_squared();
            for (axis, (x, off_by)) in term
                .vertex
                .position
                .to_array()
                .into_iter()
                .zip(off.to_array())
                .enumerate()
            {
                match alike
                    .iter_mut()
                    .find(|known| known.0 == axis && known.1.to_bits() == x.to_bits())
                {
                    Some(known) => known.2 += off_by,
                    None => alike.push((axis, x, off_by)),
                }
            }
        }
        let square_alike: f64 = alike.iter().map(|known| known.2 * known.2).sum();
        // The variance of a number that is uniform up to x is x² / 3.
        (DEVIATIONS * (square.max(square_alike) / 3.0).sqrt()).min(most)
    }
}

/// An occluder between two patches.
struct Standing<'a> {
    corners: &'a [DVec3],
    /// The greatest distance by which a corner may be off, in m.
    off: f64,
}

impl<'a> Standing<'a> {
    fn new(corners: &'a [DVec3], written: &Written) -> Self {
        let off = corners.iter().map(|&v| Vertex::new(v, written).half.length());
        Self {
            corners,
            off: off.fold(0.0, f64::max),
        }
    }

    /// Returns whether a point that may be off by `off`, m, may lie on it.
    fn may_touch(&self, x: DVec3, off: f64) -> bool {
        polygon::distance(x, self.corners) <= off + self.off
    }
}

/// A face beside an edge.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// The unit normal, turned so that faces on both sides of an outline have the same sign.
    normal: DVec3,
    /// The sine of the angle by which the face may lean.
    lean: f64,
}

impl Side {
    /// Returns whether light in a direction certainly passes the face from its back to its front.
    fn is_met_by(&self, flux: DVec3) -> bool {
        self.normal.dot(flux) > self.lean * flux.length()
    }
}

/// Patches whose corners were rounded in the file.
pub(super) struct Rounded {
    written: Written,
    ends: Vec<End>,
    glances: Vec<Glance>,
}

impl Rounded {
    /// Returns the patches of a scene whose file [shows that it was rounded](Written::shows_rounding); `None` for any other.
    pub(super) fn new(input: Input<'_>) -> Option<Self> {
        let written = input.scene.rounded()?;
        let patches = (0..input.mesh.n_patches()).map(PatchId::from_index);
        let ends: Vec<End> = patches
            .map(|patch| End::new(input.scene, input.mesh, patch, &written))
            .collect();
        Some(Self {
            glances: ends.iter().map(Glance::new).collect(),
            ends,
            written,
        })
    }

    /// Returns a first-order bound of the rounding error of an exchange area, m², with so many occluders about as long as the patches.
    ///
    /// It serves where that error is negligible. The irradiance vector of a patch at a distance r is at most A / (π r²), and at most 1.
    pub(super) fn rough(&self, [i, j]: [usize; 2], exchange: f64, n_occluders: usize) -> f64 {
        let [from, to] = [i, j].map(|k| &self.ends[k]);
        let nearest = (from.middle.distance(to.middle) - from.radius - to.radius).max(0.0);
        let most = |end: &End| (end.area / (PI * nearest * nearest)).min(1.0);
        let swept = from.off * from.perimeter * most(to) + to.off * to.perimeter * most(from);
        // Few rays may have found more than the greatest possible exchange.
        let exchange = exchange.min(from.area * most(to)).min(to.area * most(from));
        swept * (1 + n_occluders) as f64 + (from.border() + to.border()) * exchange
    }

    /// Returns the error of A_i F_ij of two patches by the rounding of coordinates, m².
    ///
    /// Divided by A_i and A_j it is that of F_ij and F_ji. With Φ the irradiance vector of patch j, A_i F_ij is its flux through patch i.
    /// Where a corner of i moves, A_i F_ij changes by the flux through the area that the two edges at the corner sweep, ∮ Φ · (δx × dx).
    /// The same holds for j and for edges of occluders, where only light from one patch to the other counts. The sums go by vertices of the scene: a vertex that several of them share moves them all.
    ///
    /// `exchange` is A_i F_ij, m², and `whole` the same without occluders.
    ///
    /// Accuracy: of the first order in half a unit over the size of the patches, some 10 % off where these touch.
    /// In partly visible pairs the light at the borders of patches is (`exchange` / `whole`)^½ of that without occluders, which is between none and all, and all of it where an occluder is no farther than it may be off:
    /// a patch that stands on an occluder may reach through it.
    /// Where patches are few units wide, a hidden part may be seen: as large a share of the whole exchange without occluders as the border is of the patches.
    /// Source: [`ARVO_1994`](crate::references::ARVO_1994), which follows vertices in the same way at a point. Departures: the flux through what edges sweep, for two patches.
    pub(super) fn error<'a>(
        &self,
        pair: [usize; 2],
        exchange: f64,
        whole: f64,
        occluders: impl IntoIterator<Item = &'a [DVec3]>,
    ) -> f64 {
        let ends = pair.map(|k| &self.ends[k]);
        let occluders: Vec<Standing<'_>> = occluders
            .into_iter()
            .map(|corners| Standing::new(corners, &self.written))
            .collect();
        let visible = if whole > 0.0 { (exchange / whole).min(1.0) } else { 1.0 };
        let share = visible.sqrt();
        let lit = |end: &End, x: DVec3| {
            let touches = |occluder: &Standing<'_>| occluder.may_touch(x, end.off);
            if occluders.iter().any(touches) { 1.0 } else { share }
        };
        let mut terms = Terms::of_borders(ends, lit);
        let is_hidden_in_part = self.occluder_terms(ends, &occluders, &mut terms);
        let meant = behind::meant(ends);
        let most = ends
            .iter()
            .map(|end| end.area * (1.0 + end.border()))
            .fold(meant.most, f64::min);
        let first_order = terms.worst(ends, exchange);
        // As much again for the higher orders where patches are some units wide; of patches hardly wider than a unit nothing is certain.
        let border = ends[0].border() + ends[1].border();
        if border >= KNOWN {
            return exchange.max(most - exchange);
        }
        let beyond = (1.0 + border).max(1.0 / (1.0 - border / KNOWN));
        let of_shadows = if is_hidden_in_part && border > COARSE {
            border * (whole + Terms::of_borders(ends, |_, _| 1.0).worst(ends, whole))
        } else {
            0.0
        };
        let of_tilt = if meant.is_grazing { meant.most } else { 0.0 };
        let nothing = if meant.may_be_none { exchange } else { 0.0 };
        (beyond * first_order + of_tilt)
            .max(nothing)
            .max(of_shadows)
            .min(exchange.max(most - exchange).max(0.0))
    }

    /// Adds the terms that the edges of occluders sweep; returns whether there are any.
    fn occluder_terms(&self, [from, to]: [&End; 2], occluders: &[Standing<'_>], terms: &mut Terms) -> bool {
        // Each edge once, with the normals of the faces on its sides, turned round for faces that run along it the other way, and the sines by which they may lean.
        let mut edges: Vec<([DVec3; 2], Vec<Side>)> = Vec::new();
        for &Standing { corners, off } in occluders {
            let normal = polygon::area_vector(corners).normalize_or_zero();
            let lean = Lean::of(corners).sine(off);
            let normal = Side { normal, lean };
            for (k, &a) in corners.iter().enumerate() {
                let b = corners[(k + 1) % corners.len()];
                if let Some(known) = edges.iter_mut().find(|known| known.0 == [b, a]) {
                    known.1.push(Side {
                        normal: -normal.normal,
                        lean,
                    });
                } else if let Some(known) = edges.iter_mut().find(|known| known.0 == [a, b]) {
                    known.1.push(normal);
                } else {
                    edges.push(([a, b], vec![normal]));
                }
            }
        }
        let is_any = !edges.is_empty();
        let Some(shaft) = is_any.then(|| Shaft::new(&from.corners, &to.corners, 0.0)).flatten() else {
            return is_any;
        };
        for ([a, b], normals) in edges {
            let vertices = [a, b].map(|v| Vertex::new(v, &self.written));
            // Both may be off: the edge, and the patches between which it stands.
            let off = vertices[0].half.length().max(vertices[1].half.length()) + from.off.max(to.off);
            let Some([start, end]) = shaft.part_within(a, b, off) else {
                continue;
            };
            let across = normals[0].normal.cross(b - a).normalize_or_zero();
            for (s, weight) in RULE {
                let t = start + s * (end - start);
                let x = a + t * (b - a);
                // An occluder that barely hides all, or nothing, may pass or hide the light within the width by which the edge may be off.
                let beside = [DVec3::ZERO, off * across, -off * across].map(|step| flux_through(x + step, from, to));
                let flux = beside.into_iter().fold(DVec3::ZERO, |most, flux| {
                    if flux.length_squared() > most.length_squared() {
                        flux
                    } else {
                        most
                    }
                });
                // On one side of both faces, light that passes the edge inside one face meets the other anyway.
                let sign = normals[0].normal.dot(flux).signum();
                let any_is_met = |towards: DVec3| normals.iter().any(|side| side.is_met_by(towards));
                if any_is_met(flux) && any_is_met(-flux) {
                    continue;
                }
                let swept = -sign * weight * (end - start) * (b - a).cross(flux);
                terms.at(vertices[0]).of_exchange += (1.0 - t) * swept;
                terms.at(vertices[1]).of_exchange += t * swept;
            }
        }
        is_any
    }
}

/// Adds the terms that the border of an end sweeps, of the part of the light from the other end that is `lit` at a point, and of its own area.
///
/// `k` is the number of the end in its pair.
fn border_terms([end, other]: [&End; 2], k: usize, lit: impl Fn(DVec3) -> f64, terms: &mut Terms) {
    let n = end.corners.len();
    let height = |v: &DVec3| end.normal.dot(*v - end.middle);
    let is_far = end.middle.distance(other.middle) > FAR * (end.radius + other.radius);
    let in_front;
    let source: &[DVec3] = if other.corners.iter().all(|v| height(v) >= 0.0) {
        &other.corners
    } else {
        in_front = clip_to_half_space(&other.corners, end.middle, end.normal);
        &in_front
    };
    let towards = |x: DVec3| {
        if is_far && source.len() == other.corners.len() {
            let way = other.middle - x;
            let square = way.length_squared();
            (-other.normal.dot(way)).max(0.0) * other.area / (PI * square * square) * way
        } else {
            let inside = x + INSIDE * (end.middle - x);
            // In a strip that is hardly in front of the other's plane, the point may be behind it.
            let is_in_front = other.normal.dot(inside - other.middle) > 0.0;
            point_form_factor_vector(if is_in_front { inside } else { x }, source)
        }
    };
    let mut of_corners = [(DVec3::ZERO, DVec3::ZERO); 4];
    for c in 0..n {
        let (a, b) = (end.corners[c], end.corners[(c + 1) % n]);
        let edge = b - a;
        let of_area = 0.5 * edge.cross(end.normal);
        of_corners[c].1 += of_area;
        of_corners[(c + 1) % n].1 += of_area;
        // The part of the edge in front of the other's plane.
        let [high, low] = [a, b].map(|v| other.normal.dot(v - other.middle));
        if (high <= 0.0 && low <= 0.0) || source.len() < 3 {
            continue;
        }
        let cut = if (high < 0.0) == (low < 0.0) {
            0.0
        } else {
            high / (high - low)
        };
        let [start, length] = if high < 0.0 {
            [cut, 1.0 - cut]
        } else if low < 0.0 {
            [0.0, cut]
        } else {
            [0.0, 1.0]
        };
        for (s, weight) in RULE {
            let t = start + s * length;
            let x = a + t * edge;
            let swept = lit(x) * weight * length * edge.cross(towards(x));
            of_corners[c].0 += (1.0 - t) * swept;
            of_corners[(c + 1) % n].0 += t * swept;
        }
    }
    for (shares, (of_exchange, of_area)) in end.shares.iter().zip(of_corners) {
        for (vertex, share) in end.vertices.iter().zip(shares).filter(|(_, share)| share.abs() > 0.0) {
            let term = terms.at(*vertex);
            term.of_exchange += *share * of_exchange;
            term.of_areas[k] += *share * of_area;
        }
    }
}

/// Returns the irradiance vector, at a point between two ends, of the light from one end to the other.
fn flux_through(x: DVec3, from: &End, to: &End) -> DVec3 {
    let mut seen = to.corners.clone();
    let n = from.corners.len();
    for k in 0..n {
        let inward = (from.corners[k] - x).cross(from.corners[(k + 1) % n] - x);
        let sign = inward.dot(from.middle - x).signum();
        seen = clip_to_half_space(&seen, x, -sign * inward);
        if seen.len() < 3 {
            return DVec3::ZERO;
        }
    }
    point_form_factor_vector(x, &seen)
}
