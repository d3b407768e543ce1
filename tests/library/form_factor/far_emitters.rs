//! Shadows of objects near a patch, before emitters at every distance and of every size.
//!
//! Truth is found another way than the method finds it: from points of the emitter, the shadow of the occluder is a convex polygon in the patch's own plane, and what is left of the patch is seen by
//! Lambert's formula. All lengths there are those of the patch, however far off the emitter is.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use radiosity::form_factor::{Computed, ExactMethod};
use radiosity::geometry::clip::clip_to_half_space;
use radiosity::geometry::point_form_factor::point_form_factor;
use radiosity::geometry::polygon;
use radiosity::geometry::polygon_form_factor::{PreparedPolygon, Tolerance, exchange_area};

use crate::support::rooms::{Prepared, Shapes};
use crate::support::{Uniform, n_cases};

impl Uniform {
    fn turn(&mut self) -> DQuat {
        let mut part = || self.next() - 0.5;
        let axis = DVec3::new(part(), part(), part()).normalize();
        DQuat::from_axis_angle(axis, self.between(0.0, TAU))
    }
}

/// A patch that looks up at z = 0, what stands before it, and an emitter that looks down at it.
struct Case {
    patch: Vec<DVec3>,
    /// The corners of a plate, or of a box.
    occluder: Vec<DVec3>,
    /// The emitter at the distance 1.
    emitter: Vec<DVec3>,
}

/// A convex polygon of three or four corners around a point; its normal is that of the turned xy plane.
fn polygon_at(random: &mut Uniform, centre: DVec3, turn: DQuat, size: f64) -> Vec<DVec3> {
    let n = if random.next() < 0.3 { 3 } else { 4 };
    let (a, b) = (size * random.between(0.5, 1.0), size * random.between(0.5, 1.0));
    (0..n)
        .map(|k| {
            let angle = (f64::from(k) + random.between(0.0, 0.6)) * TAU / f64::from(n);
            centre + turn * DVec3::new(a * angle.cos(), b * angle.sin(), 0.0)
        })
        .collect()
}

/// Makes an occluder that hides some of a direction, up to a few sizes off.
fn occluder(random: &mut Uniform, patch: &[DVec3], to: DVec3) -> Vec<DVec3> {
    let from = patch[0].lerp(patch[2], random.next());
    let height = random.between(0.3, 0.8);
    let size = random.scale(0.05, 0.25);
    let middle = from + to * (height / to.z.max(0.5));
    // All of it stands over the patch's plane.
    let middle = middle.with_z(middle.z.max(1.3 * size));
    let turn = random.turn();
    if random.next() < 0.5 {
        polygon_at(random, middle, turn, size)
    } else {
        let half = DVec3::new(size, 0.7 * size, 0.4 * size);
        let corner = |k: u32| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2 & 1)) * 2.0 - 1.0;
        (0..8).map(|k| middle + turn * (corner(k) * half)).collect()
    }
}

/// Returns three points in each of the n² cells of a triangle, which integrate degree 2.
fn points_in_cells([a, b, c]: [DVec3; 3], n: u32) -> impl Iterator<Item = DVec3> {
    let corner =
        move |i: u32, j: u32| a + (b - a) * (f64::from(i) / f64::from(n)) + (c - a) * (f64::from(j) / f64::from(n));
    let cells = (0..n).flat_map(move |i| {
        (0..n - i).flat_map(move |j| {
            let lower = [corner(i, j), corner(i + 1, j), corner(i, j + 1)];
            let upper = [corner(i + 1, j + 1), corner(i, j + 1), corner(i + 1, j)];
            std::iter::once(lower).chain((i + j + 1 < n).then_some(upper))
        })
    });
    cells.flat_map(|cell| (0..3).map(move |m| (cell[m] * 4.0 + cell[(m + 1) % 3] + cell[(m + 2) % 3]) / 6.0))
}

impl Case {
    fn random(random: &mut Uniform, angular_size: f64, elevation: f64) -> Self {
        let size = random.between(0.3, 0.7);
        let flat = DQuat::from_rotation_z(random.between(0.0, TAU));
        let patch = polygon_at(random, DVec3::ZERO, flat, size);
        let azimuth = DQuat::from_rotation_z(random.between(0.0, TAU));
        let to = azimuth * DVec3::new(elevation.cos(), 0.0, elevation.sin());
        // Its front looks back, a little aslant.
        let aslant = DQuat::from_axis_angle(azimuth * DVec3::Y, random.between(-0.5, 0.5));
        let down = aslant * DQuat::from_rotation_arc(DVec3::Z, -to);
        let emitter = polygon_at(random, to, down, angular_size);
        Self {
            occluder: occluder(random, &patch, to),
            patch,
            emitter,
        }
    }

    /// Returns the scene with the emitter so far off, all of it turned and moved.
    fn scene(&self, distance: f64, place: &impl Fn(DVec3) -> DVec3) -> Shapes {
        let mut shapes = Shapes::default();
        let at = |corners: &[DVec3]| corners.iter().map(|&v| place(v)).collect::<Vec<_>>();
        shapes.face(&at(&self.patch));
        let emitter: Vec<DVec3> = self.emitter.iter().map(|&v| v * distance).collect();
        shapes.face(&at(&emitter));
        for side in self.sides() {
            shapes.face(&at(&side));
        }
        shapes
    }

    /// Returns the outer sides of the occluder.
    fn sides(&self) -> Vec<Vec<DVec3>> {
        if let [a, b, c, d, e, f, g, h] = self.occluder[..] {
            let sides = [
                [a, c, d, b],
                [e, f, h, g],
                [a, b, f, e],
                [c, g, h, d],
                [a, e, g, c],
                [b, d, h, f],
            ];
            return sides.map(|side| side.to_vec()).to_vec();
        }
        vec![self.occluder.clone(), self.occluder.iter().rev().copied().collect()]
    }

    /// Returns the form factor from the patch to the emitter with n × n cells on each triangle of the emitter, and without the occluder.
    fn truth(&self, distance: f64, n: u32) -> [f64; 2] {
        let emitter: Vec<DVec3> = self.emitter.iter().map(|&v| v * distance).collect();
        let above = clip_to_half_space(&emitter, DVec3::ZERO, DVec3::Z);
        let normal = polygon::area_vector(&emitter).normalize();
        let (mut visible, mut whole) = (0.0, 0.0);
        for k in 1..above.len().saturating_sub(1) {
            let [a, b, c] = [above[0], above[k], above[k + 1]];
            let area = 0.5 * (b - a).cross(c - a).length() / f64::from(n * n);
            for y in points_in_cells([a, b, c], n) {
                let [all, hidden] = self.seen_from(y, normal);
                whole += area / 3.0 * all;
                visible += area / 3.0 * (all - hidden);
            }
        }
        [visible, whole].map(|sum| sum / polygon::area_vector(&self.patch).length())
    }

    /// Returns the factors from a point of the emitter to the patch, and to the part of it in the shadow.
    fn seen_from(&self, y: DVec3, normal: DVec3) -> [f64; 2] {
        let all = point_form_factor(y, normal, &self.patch);
        // Light that a convex occluder stops would have left it on a side that looks away from its source. Only what is lower than that throws a shadow, very far from just below.
        let level = y * (1.0 - 1e-6);
        let away = self
            .sides()
            .into_iter()
            .filter(|side| polygon::area_vector(side).dot(y - side[0]) < 0.0);
        let shadows = away.map(|side| {
            let lower = clip_to_half_space(&side, level, -DVec3::Z);
            let shadow: Vec<DVec3> = lower.iter().map(|&o| o - (y - o) * (o.z / (y.z - o.z))).collect();
            let mut hidden = self.patch.clone();
            for (k, &a) in shadow.iter().enumerate() {
                // Clockwise, as it is seen from behind.
                hidden = clip_to_half_space(&hidden, a, (shadow[(k + 1) % shadow.len()] - a).cross(DVec3::Z));
            }
            if shadow.is_empty() || hidden.len() < 3 {
                0.0
            } else {
                point_form_factor(y, normal, &hidden)
            }
        });
        let hidden: f64 = shadows.sum();
        [all, hidden]
    }
}

fn factor(shapes: Shapes) -> (f64, f64, Computed) {
    factor_by(&ExactMethod::default(), shapes)
}

fn factor_by(method: &ExactMethod, shapes: Shapes) -> (f64, f64, Computed) {
    let prepared = Prepared::new(shapes.scene(), 1);
    let computed = prepared.try_compute(method).unwrap();
    (computed.factors.get(0, 1), computed.factors.std_error(0, 1), computed)
}

/// Returns a length below the width of a polygon.
fn angular_size(corners: &[DVec3]) -> f64 {
    let longest = corners.iter().map(|v| v.distance(corners[0])).fold(0.0, f64::max);
    0.25 * polygon::area_vector(corners).length() / longest
}

/// Expects the factor at a distance to be within its stated error of the truth, and that error to be useful; returns the factor.
fn expect_truth(case: &Case, distance: f64, place: &impl Fn(DVec3) -> DVec3, what: &str) -> f64 {
    let (value, stated, computed) = factor(case.scene(distance, place));
    // Coordinates are rounded to f64 where the scene is turned and moved: beside the size of a small emitter that is seen.
    let rounded = 1e-15 * (1.0 + distance) / (distance * angular_size(&case.emitter));
    let [mut coarse, mut whole] = case.truth(distance, 8);
    // Kinks make the truth converge as 1/n² or 1/n: its error is at most about the difference, or some differences where it happens to be small.
    for n in [16, 32, 64, 128, 256, 512] {
        let fine;
        [fine, whole] = case.truth(distance, n);
        let open = 3.0 * (fine - coarse).abs() + rounded * whole;
        coarse = fine;
        let off = (value - fine).abs();
        let is_within = off <= 1.000_001 * stated + open;
        if is_within && open <= (1e-5 + rounded) * whole {
            break;
        }
        assert!(
            n < 512,
            "{what} at {distance:e}: {value:e}, not {fine:e}: off by {off:e}, stated {stated:e}, truth {open:e}, without shadow {whole:e}"
        );
    }
    assert!(
        stated <= 1e-3 * whole && computed.tolerance_met,
        "{what} at {distance:e}: {value:e} stated {stated:e}, without shadow {whole:e}"
    );
    // What it sends back is the same light.
    let areas = computed.factors.areas();
    let back = computed.factors.get(1, 0) * areas[1] / areas[0];
    assert!((back - value).abs() <= 1e-12 * value, "{what} at {distance:e}");
    value
}

/// Expects an emitter that is moved out to 1e12 at the same solid angle to keep its shadow.
fn expect_shadow_at_every_distance(seed: u64, angular_size: f64, elevation: f64) {
    let mut random = Uniform(seed);
    let case = Case::random(&mut random, angular_size, elevation);
    let (turn, shift) = (random.turn(), DVec3::new(random.next(), random.next(), random.next()));
    let place = |v: DVec3| turn * v + shift;
    let what = format!("seed {seed}, size {angular_size:e}, elevation {elevation:.3}");
    let values: Vec<(f64, f64)> = (0..13)
        .step_by(if seed.is_multiple_of(4) { 1 } else { 3 })
        .map(|k| 4.0 * 10.0_f64.powi(k))
        .map(|distance| (distance, expect_truth(&case, distance, &place, &what)))
        .collect();
    // Parallax: from a distance d a patch of size 1 sees the emitter turned and scaled by 1/d, no more.
    let &(_, last) = values.last().unwrap();
    let [_, whole] = case.truth(4e12, 2);
    for (distance, value) in values {
        let parallax = 20.0 / distance / angular_size.min(1.0);
        assert!(
            (value - last).abs() <= (parallax + 2e-3) * whole,
            "{what}: {value:e} at {distance:e}, {last:e} far off"
        );
    }
}

#[test]
fn a_near_shadow_stays_whatever_the_distance_of_a_wide_emitter() {
    for seed in 0..n_cases(6, 16) {
        let mut random = Uniform(1000 + seed);
        let (size, elevation) = (random.scale(0.05, 2.0), random.between(0.6, 1.5));
        expect_shadow_at_every_distance(seed, size, elevation);
    }
}

#[test]
fn a_near_shadow_stays_whatever_the_distance_of_a_sun() {
    for seed in 0..n_cases(6, 16) {
        let mut random = Uniform(2000 + seed);
        let (size, elevation) = (random.scale(1e-4, 0.02), random.between(0.3, 1.5));
        expect_shadow_at_every_distance(seed, size, elevation);
    }
}

#[test]
fn a_near_shadow_stays_before_an_emitter_half_behind_the_horizon() {
    for seed in 0..n_cases(6, 16) {
        let mut random = Uniform(3000 + seed);
        let size = random.scale(0.02, 0.5);
        let elevation = size * random.between(-0.15, 0.6);
        expect_shadow_at_every_distance(seed, size, elevation);
    }
}

#[test]
fn an_emitter_of_a_millionth_of_the_patch_or_less_keeps_its_shadow() {
    for seed in 0..24 {
        let mut random = Uniform(4000 + seed);
        let size = random.scale(1e-6, 1e-3);
        let case = Case::random(&mut random, size, 1.0);
        let (turn, scale) = (random.turn(), random.scale(1e-3, 1e3));
        let distance = random.between(2.5, 4.0);
        expect_truth(&case, distance, &|v| scale * (turn * v), &format!("tiny, seed {seed}"));
    }
}

/// Returns the form factor between two polygons with nothing in between.
fn open_factor(p: &[DVec3], q: &[DVec3]) -> f64 {
    let [p, q] = [p, q].map(PreparedPolygon::new);
    exchange_area(&p, &q, Tolerance::default()).value / p.area()
}

/// The wall begins beside the patch, and is up to 3e10 times as large as the patch.
#[test]
fn a_plate_before_a_wall_that_begins_beside_the_patch_hides_what_it_would_receive() {
    for seed in 0..40 {
        let mut random = Uniform(6000 + seed);
        let size = random.scale(1e3, 3e10);
        let [left, right, top] = [0; 3].map(|_| size * random.scale(0.03, 1.0));
        let foot = if random.next() < 0.5 { 0.0 } else { -random.next() * top };
        // Three corners are flat wherever they are rounded to.
        let wall = [(1.0 + right, foot), (-left, foot), (0.5, top)];
        let (low, high) = (random.between(0.01, 0.1), random.between(0.2, 0.5));
        let plate = [(0.8, low), (0.2, low), (0.2, high), (0.8, high)];
        let at = |x: f64, corners: &[(f64, f64)]| corners.iter().map(|&(y, z)| DVec3::new(x, y, z)).collect();
        let case = Case {
            patch: [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
                .map(|(x, y)| DVec3::new(x, y, 0.0))
                .to_vec(),
            occluder: at(1.2, &plate),
            emitter: at(1.5, &wall),
        };
        let (turn, scale) = (random.turn(), random.scale(1e-3, 1e3));
        let (value, stated, _) = factor(case.scene(1.0, &|v| scale * (turn * v)));
        let whole = open_factor(&case.patch, &case.emitter);
        // From everywhere on the patch the wall is behind all of the plate.
        let truth = whole - open_factor(&case.patch, &case.occluder);
        let off = (value - truth).abs();
        // Turned coordinates are rounded, and the wall with them.
        let rounded = 1e-15 * left.max(right).max(top).max(-foot);
        assert!(
            off <= 1.000_001 * stated + 1e-11 + rounded && stated <= 1e-3 * whole + rounded,
            "seed {seed}, {left:e} {right:e} {top:e} {foot:e}: {value} {truth} off {off:e} stated {stated:e}"
        );
    }
}

#[test]
fn a_plate_before_an_emitter_up_to_a_billion_times_as_large_hides_what_it_would_receive() {
    for seed in 0..26 {
        let mut random = Uniform(5000 + seed);
        let height = random.between(2.0, 3.0);
        let size = random.scale(3.0, 3e8);
        let mut case = Case::random(&mut random, 0.1, 1.5);
        let turn = random.turn();
        // Light from the whole patch that the plate stops was on its way to the emitter: it is that wide.
        let down =
            DQuat::from_rotation_x(0.1 * random.next() * 2.0 / size) * DQuat::from_rotation_x(std::f64::consts::PI);
        let aslant = DQuat::from_axis_angle(DVec3::X, random.between(-0.3, 0.3));
        case.occluder = polygon_at(&mut random, DVec3::new(0.1, 0.1, 0.7), aslant, 0.3);
        case.emitter = polygon_at(&mut random, DVec3::Z * height, down, 20.0 * size);
        let scale = random.scale(1e-3, 1e3);
        let (value, stated, _) = factor(case.scene(1.0, &|v| scale * (turn * v)));
        let below: Vec<DVec3> = case.occluder.iter().rev().copied().collect();
        let whole = open_factor(&case.patch, &case.emitter);
        let truth = whole - open_factor(&case.patch, &below);
        let off = (value - truth).abs();
        assert!(
            off <= 1.000_001 * stated + 1e-11 && stated <= 1e-3 * whole,
            "seed {seed}, size {size:e}: {value} {truth} off {off:e} stated {stated:e}"
        );
    }
}

/// Returns the form factor from a patch to what it sees of an emitter beyond the edges of a ground at z = 0, with n² cells on each triangle of the patch.
fn above_the_horizon(patch: &[DVec3], emitter: &[DVec3], ground: &[DVec3; 4], n: u32) -> f64 {
    let normal = polygon::area_vector(patch).normalize();
    let seen = |x: DVec3| {
        // Behind the ground is a pyramid with its apex at the point.
        let mut behind = clip_to_half_space(emitter, ground[0], -DVec3::Z);
        for k in 0..4 {
            let [a, b] = [k, (k + 1) % 4].map(|k| ground[k] - x);
            behind = clip_to_half_space(&behind, x, b.cross(a));
        }
        point_form_factor(x, normal, emitter) - point_form_factor(x, normal, &behind)
    };
    let sum: f64 = points_in_cells([patch[0], patch[1], patch[2]], n).map(seen).sum();
    sum / f64::from(3 * n * n)
}

/// The ground is up to 1e6 times as wide as the patch above it, and the emitter up to 1e11 times as far off, on both sides of the horizon.
#[test]
fn a_patch_over_a_wide_ground_sees_what_is_above_the_horizon() {
    for seed in 0..n_cases(400_u64, 4000) {
        let mut random = Uniform(7000 + seed);
        let turn = random.turn();
        let (wide, far) = (random.scale(1e2, 1e6), random.scale(1e3, 1e11));
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::new(0.3, 0.8, 0.0)].map(|v| turn * v);
        let lowest = triangle.iter().map(|v| v.z).fold(f64::INFINITY, f64::min);
        let height = random.scale(0.01, 10.0) - lowest;
        let patch = triangle.map(|v| v + DVec3::Z * height);
        let ground = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0) * wide);
        let to = DQuat::from_rotation_z(random.between(0.0, TAU)) * DVec3::new(1.0, 0.0, random.between(-0.3, 0.3));
        let back = DQuat::from_rotation_arc(DVec3::Z, -to.normalize());
        let size = random.scale(0.1, 5.0);
        let emitter: Vec<DVec3> = polygon_at(&mut random, to, back, size)
            .into_iter()
            .map(|v| v * far.max(10.0 * wide))
            .collect();
        let place = if seed % 3 == 0 { DQuat::IDENTITY } else { random.turn() };
        let mut shapes = Shapes::default();
        for corners in [&patch[..], &emitter, &ground] {
            shapes.face(&corners.iter().map(|&v| place * v).collect::<Vec<_>>());
        }
        let method = ExactMethod {
            tolerance: if seed % 2 == 0 { 1e-8 } else { 1e-6 },
            ..ExactMethod::default()
        };
        let (value, stated, _) = factor_by(&method, shapes);
        let [coarse, truth] = [8, 16].map(|n| above_the_horizon(&patch, &emitter, &ground, n));
        // Turned coordinates are rounded, and the ground with them.
        let open = 3.0 * (truth - coarse).abs() + 1e-12 + 1e-15 * wide;
        let off = (value - truth).abs();
        assert!(
            off <= 1.000_001 * stated + open && stated <= 1e-5,
            "seed {seed}, {wide:e} {far:e} {height:e}: {value} {truth} off {off:e} stated {stated:e} truth {open:e}"
        );
    }
}
