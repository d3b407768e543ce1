//! Methods between pairs where patches are near each other, or an occluder is near them: true errors against stated ones.

use glam::{DQuat, DVec3};
use radiosity::form_factor::{ExactMethod, FormFactorMethod, MethodSettings, POINTS, method};

use crate::support::rooms::{Prepared, Shapes};
use crate::support::{Uniform, n_cases};

fn with_points(name: &str, q: usize) -> Box<dyn FormFactorMethod> {
    let settings = MethodSettings::default().with(&POINTS, q as u64);
    method(name, &settings).unwrap()
}

/// A rectangle around a point with the normal `turn` · Z.
fn rectangle(middle: DVec3, half: [f64; 2], turn: DQuat) -> [DVec3; 4] {
    let (x, y) = (turn * DVec3::X * half[0], turn * DVec3::Y * half[1]);
    [middle - x - y, middle + x - y, middle + x + y, middle - x + y]
}

fn prepared(faces: &[[DVec3; 4]]) -> Prepared {
    let mut shapes = Shapes::default();
    for face in faces {
        shapes.face(face);
    }
    Prepared::new(shapes.scene(), 1)
}

impl Uniform {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }

    /// Returns a turn of Z along an axis, or any.
    fn turn_of_z(&mut self, is_along_axis: bool) -> DQuat {
        if is_along_axis {
            let axis = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z][self.below(6)];
            return DQuat::from_rotation_arc(DVec3::Z, axis);
        }
        let mut component = || self.between(-1.0, 1.0);
        DQuat::from_xyzw(component(), component(), component(), component()).normalize()
    }
}

/// A share of sorted values.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    let k = (share * sorted.len() as f64) as usize;
    sorted[k.min(sorted.len() - 1)]
}

/// A strip of 3 m over a plate of 1 m, 0.1 mm apart: a third of it lies over the plate.
#[test]
fn a_narrow_strip_over_a_plate_receives_no_more_than_is_sent_to_it() {
    for (width, gap, expected) in [(1e-3, 1e-4, 1.0 / 3.0), (0.05, 0.05, 0.332)] {
        let plate = rectangle(DVec3::new(0.5, 0.5, 0.0), [0.5, 0.5], DQuat::IDENTITY);
        let over = DQuat::from_rotation_x(std::f64::consts::PI);
        let strip = rectangle(DVec3::new(0.5, 0.5, gap), [1.5, 0.5 * width], over);
        for faces in [[plate, strip], [strip, plate]] {
            let scene = prepared(&faces);
            let of_strip = usize::from(faces[1] == strip);
            for q in [1, 2, 5, 10] {
                let factors = scene.compute(&*with_points("gauss-lambert", q));
                let (value, error) = (
                    factors.get(of_strip, 1 - of_strip),
                    factors.std_error(of_strip, 1 - of_strip),
                );
                // The expected value of the wider strip is given to three digits.
                assert!((value - expected).abs() < 1.5e-3, "{width} {q}: {value}");
                assert!(error < 1e-3, "{width} {q}: {error:e}");
            }
        }
    }
}

/// Patches of very different shapes, mostly nearer than they are large: plates, strips and specks.
#[test]
fn gauss_points_on_one_of_two_near_patches_are_off_by_no_more_than_they_state() {
    let mut random = Uniform(1);
    let (mut relative, mut n_beyond, mut n) = (Vec::new(), 0, 0);
    while n < 400 {
        let first = rectangle(
            DVec3::ZERO,
            [random.scale(1e-3, 1.0), random.scale(1e-3, 1.0)],
            DQuat::IDENTITY,
        );
        let middle = DVec3::new(
            random.between(-1.0, 1.0),
            random.between(-1.0, 1.0),
            random.scale(1e-4, 1.0),
        );
        let is_along_axis = random.next() < 0.5;
        let turn = random.turn_of_z(is_along_axis);
        let second = rectangle(middle, [random.scale(1e-3, 2.0), random.scale(1e-3, 2.0)], turn);
        let scene = prepared(&[first, second]);
        let truth = scene.compute(&ExactMethod::default());
        // Patches that do not face each other, and those that pass through each other.
        if truth.get(0, 1) <= 1e-9 || second.iter().any(|corner| corner.z < 0.0) {
            continue;
        }
        n += 1;
        for q in [2, 5] {
            let factors = scene.compute(&*with_points("gauss-lambert", q));
            for (i, j) in [(0, 1), (1, 0)] {
                let (value, exact) = (factors.get(i, j), truth.get(i, j));
                let off = (value - exact).abs();
                assert!((0.0..=1.0 + 1e-14).contains(&value), "{value}");
                // Errors are stored in f32.
                n_beyond += usize::from(off > 1.000_001 * factors.std_error(i, j) + truth.std_error(i, j));
                relative.push(off / exact);
            }
        }
    }
    assert_eq!(n_beyond, 0);
    relative.sort_by(f64::total_cmp);
    // The rule is cut until it is within 0.001 of the entry; there are pairs for which no number of points that one waits for is enough.
    let [median, most, worst] = [0.5, 0.97, 1.0].map(|share| quantile(&relative, share));
    assert!(
        median <= 1e-3 && most <= 1.01e-3 && worst <= 0.03,
        "{median:e} {most:e} {worst:e}"
    );
}

/// Two patches and a plate near one of them, or anywhere in between: what their rays miss of its shadow is seldom more than they say, and they say something.
#[test]
fn shadows_of_near_occluders_are_within_the_stated_errors() {
    let methods = ["gauss-lambert", "contour", "pdm"].map(|name| (name, with_points(name, 5)));
    for (is_near, seed) in [(true, 2), (false, 3)] {
        let mut random = Uniform(seed);
        let mut ratios = [Vec::new(), Vec::new(), Vec::new()];
        while ratios[0].len() < n_cases(150, 300) {
            let is_along_axis = random.next() < 0.5;
            let size = random.scale(0.3, 2.0);
            let half = [size, size * random.scale(0.3, 1.0)];
            let first = rectangle(DVec3::ZERO, half, DQuat::IDENTITY);
            let (small, height) = if is_near {
                let small = random.scale(0.03, 0.5);
                (small, small * random.scale(0.5, 6.0))
            } else {
                (random.scale(0.2, 2.0), random.scale(0.5, 4.0))
            };
            let across = |extent: f64, numbers: &mut Uniform| 1.2 * extent * numbers.between(-1.0, 1.0);
            let middle = DVec3::new(across(half[0], &mut random), across(half[1], &mut random), height);
            let second = rectangle(
                middle,
                [small, small * random.scale(0.3, 1.0)],
                random.turn_of_z(is_along_axis),
            );
            let mut between = || {
                let mut of = |[a, b, _, d]: [DVec3; 4]| a + random.next() * (b - a) + random.next() * (d - a);
                let (from, to) = (of(first), of(second));
                let near = random.scale(0.01, 0.5);
                let share = match (is_near, random.next() < 0.5) {
                    (true, true) => near,
                    (true, false) => 1.0 - near,
                    (false, _) => random.next(),
                };
                from + share * (to - from)
            };
            let of_occluder = between();
            let extent = small.min(size) * random.scale(0.2, 2.0);
            let occluder = rectangle(
                of_occluder,
                [extent, extent * random.scale(0.3, 1.0)],
                random.turn_of_z(is_along_axis),
            );
            let behind = |of: &[DVec3; 4]| {
                let normal = (of[1] - of[0]).cross(of[3] - of[0]).normalize();
                occluder.iter().any(|corner| normal.dot(corner - of[0]) < 1e-3)
            };
            if behind(&first) || behind(&second) {
                continue;
            }
            let scene = prepared(&[first, second, occluder]);
            let truth = scene.compute(&ExactMethod::default());
            let whole = prepared(&[first, second]).compute(&ExactMethod::default()).get(0, 1);
            // Only where there is a shadow, and light beside it.
            let visible = truth.get(0, 1) / whole;
            if whole < 1e-6 || !(0.01..0.99).contains(&visible) {
                continue;
            }
            for ((_, method), of_method) in methods.iter().zip(&mut ratios) {
                let factors = scene.compute(&**method);
                let off = (factors.get(0, 1) - truth.get(0, 1)).abs();
                of_method.push(off / (factors.std_error(0, 1) + truth.std_error(0, 1)));
            }
        }
        for ((name, _), mut of_method) in methods.iter().zip(ratios) {
            of_method.sort_by(f64::total_cmp);
            let [median, most, nearly_all] = [0.5, 0.97, 0.99].map(|share| quantile(&of_method, share));
            assert!(most < 2.0 && nearly_all < 3.0, "{is_near} {name}: {most} {nearly_all}");
            // An error that says nothing would be easy. Of a normal distribution it would be 0.67; these have longer tails.
            assert!(median > 0.1, "{is_near} {name}: {median}");
        }
    }
}

/// A needle narrower than f32 rays resolve sees past itself: no ray meets its back, and what is in front has its share of them.
#[test]
fn rays_from_a_needle_do_not_meet_its_back() {
    let mut uniform = Uniform(9);
    for width in [1e-3, 1e-4, 2e-5] {
        let turn = uniform.turn_of_z(false);
        let needle = rectangle(DVec3::new(-1.1, 0.6, 0.4), [1.4, width], turn);
        let screen = rectangle(
            DVec3::new(-1.1, 0.6, 0.4) + turn * DVec3::Z,
            [0.9, 0.7],
            turn * DQuat::from_rotation_x(std::f64::consts::PI),
        );
        let room = prepared(&[needle, screen]);
        let truth = room.compute(&ExactMethod::default()).get(0, 1);
        for name in ["sr", "qmc", "hemicube"] {
            let computed = room.compute(&*method(name, &MethodSettings::default()).unwrap());
            assert_eq!(computed.tallies()[0].n_absorbed, 0, "{name} {width}");
            let (found, error) = (computed.get(0, 1), computed.std_error(0, 1));
            assert!(
                (found - truth).abs() <= 4.0 * error + 2e-3,
                "{name} {width}: {found} for {truth}"
            );
        }
    }
}
