//! Streets as building models have them, turned and moved, and written with few digits: houses that touch, doors on walls, boxes on roofs, awnings of two sides, and a far sun.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write as _;

use glam::{DQuat, DVec3};
use radiosity::form_factor::ExactMethod;
use radiosity::matrix::SurfaceFormFactors;
use radiosity::scene::{Scene, load};

use crate::support::rooms::{Prepared, with_digits};
use crate::support::{Uniform, n_cases};

/// The edge of the ground, m.
const GROUND: f64 = 20.0;

/// An outline, and whether it may be written as two triangles.
type Outline = (Vec<DVec3>, bool);

fn pick<T: Copy>(random: &mut Uniform, among: &[T]) -> T {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "below the length"
    )]
    let k = (random.next() * among.len() as f64) as usize;
    among[k]
}

/// Returns the sides of a box that stands on something, without its bottom.
fn house(low: DVec3, high: DVec3) -> [Vec<DVec3>; 5] {
    let at = |x: usize, y: usize, z: usize| {
        let of = [low, high];
        DVec3::new(of[x].x, of[y].y, of[z].z)
    };
    let wall = |a: [usize; 2], b: [usize; 2]| {
        vec![
            at(a[0], a[1], 0),
            at(b[0], b[1], 0),
            at(b[0], b[1], 1),
            at(a[0], a[1], 1),
        ]
    };
    [
        vec![at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)],
        wall([0, 0], [1, 0]),
        wall([1, 0], [1, 1]),
        wall([1, 1], [0, 1]),
        wall([0, 1], [0, 0]),
    ]
}

/// Returns a street, with a sun up to 1e8 m off where `with_sun` says so.
fn street(random: &mut Uniform, with_sun: bool) -> Vec<Outline> {
    let ground = |low: f64, high: f64| {
        [(low, 0.0), (high, 0.0), (high, GROUND), (low, GROUND)]
            .map(|(x, y)| DVec3::new(x, y, 0.0))
            .to_vec()
    };
    let part = GROUND / pick(random, &[1.0, 2.0, 3.0]);
    let mut outlines: Vec<Outline> = Vec::new();
    let mut low = 0.0;
    while low < GROUND - 1.0 {
        outlines.push((ground(low, low + part), true));
        low += part;
    }
    for _ in 0..pick(random, &[1, 2]) {
        let cell = [pick(random, &[0.0, 1.0, 2.0]), pick(random, &[0.0, 1.0, 2.0])];
        let corner = DVec3::new(1.0 + 6.0 * cell[0], 1.0 + 6.0 * cell[1], 0.0);
        let is_taken = |(outline, _): &Outline| {
            outline
                .iter()
                .any(|v| v.z > 0.0 && (*v - corner - DVec3::new(3.0, 3.0, v.z)).abs().max_element() < 3.1)
        };
        if outlines.iter().any(is_taken) {
            continue;
        }
        let margin = pick(random, &[0.0, 0.5, 1.0]);
        let from = corner + DVec3::new(margin, margin, 0.0);
        let to = corner + DVec3::new(6.0, 6.0 - margin, random.between(2.0, 7.0));
        outlines.extend(house(from, to).map(|side| (side, true)));
        let upright = |x: [f64; 2], z: [f64; 2]| {
            [(0, 0), (1, 0), (1, 1), (0, 1)]
                .map(|(i, k)| DVec3::new(x[i], from.y, z[k]))
                .to_vec()
        };
        if random.next() < 0.5 {
            let x = [
                from.x + (to.x - from.x) * random.between(0.1, 0.4),
                to.x - (to.x - from.x) * random.between(0.1, 0.4),
            ];
            outlines.push((upright(x, [to.z * pick(random, &[0.0, 0.2]), 0.7 * to.z]), false));
        }
        if random.next() < 0.4 {
            let awning: Vec<DVec3> = [(from.x, 0.6), (to.x, 0.6), (to.x, 0.0), (from.x, 0.0)]
                .map(|(x, out)| DVec3::new(x, from.y - out, 0.8 * to.z))
                .to_vec();
            outlines.push((awning.iter().rev().copied().collect(), true));
            outlines.push((awning, true));
        }
        if random.next() < 0.5 {
            let middle = 0.5 * (from + to);
            let half = DVec3::new(random.between(0.3, 1.0), random.between(0.3, 1.0), 0.0);
            let up = DVec3::Z * random.between(0.3, 1.0);
            let base = middle.with_z(to.z);
            outlines.extend(house(base - half, base + half + up).map(|side| (side, true)));
        }
    }
    if with_sun {
        let (distance, angle, height) = (
            random.scale(1e2, 1e8),
            random.between(0.0, TAU),
            random.between(0.1, 1.4),
        );
        let towards = DVec3::new(height.cos() * angle.cos(), height.cos() * angle.sin(), height.sin());
        let (across, radius) = (towards.any_orthonormal_vector(), distance * random.scale(0.005, 0.5));
        let up = towards.cross(across);
        let corner = |quarters: f64| {
            let (sine, cosine) = (0.3 + quarters * FRAC_PI_2).sin_cos();
            distance * towards + radius * (cosine * up + sine * across)
        };
        outlines.push(([0.0, 1.0, 2.0, 3.0].map(corner).to_vec(), false));
    }
    outlines
}

/// Returns the scene of a file whose surfaces are some outlines; those that `in_halves` picks are two triangles.
fn written(outlines: &[Outline], mut in_halves: impl FnMut() -> bool, place: impl Fn(DVec3) -> [String; 3]) -> Scene {
    let mut text = String::new();
    let mut n = 0;
    for (k, (corners, may_be_cut)) in outlines.iter().enumerate() {
        let _ = writeln!(text, "o outline{k}");
        for &corner in corners {
            let _ = writeln!(text, "v {}", place(corner).join(" "));
        }
        let [a, b, c, d] = [1, 2, 3, 4].map(|corner| n + corner);
        let _ = if *may_be_cut && in_halves() {
            writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}")
        } else {
            writeln!(text, "f {a} {b} {c} {d}")
        };
        n += corners.len();
    }
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("street.obj");
    std::fs::write(&path, text).unwrap();
    load(&path).unwrap().scene
}

/// Returns the form factors between outlines.
fn compute(scene: Scene, tolerance: f64) -> SurfaceFormFactors {
    let method = ExactMethod {
        tolerance,
        ..ExactMethod::default()
    };
    let prepared = Prepared::new(scene, 1);
    prepared.by_surface(&prepared.compute(&method))
}

/// Each number of a file: by its decimals, in m, by its digits, or in full.
#[derive(Clone, Copy, Debug)]
enum Format {
    Full,
    Decimals(usize),
    Millimetres,
    Digits(usize),
}

impl Format {
    fn write(self, x: f64) -> String {
        match self {
            Self::Full => x.to_string(),
            Self::Decimals(n) => format!("{x:.n$}"),
            Self::Millimetres => format!("{:.0}", 1e3 * x),
            Self::Digits(n) => with_digits(n, x),
        }
    }
}

/// Streets in which rounding puts a patch into the solid that it stands on, or turns the plane of a roof's edge by more than the height of a far sun over it.
const TELLING: [u64; 6] = [44, 369, 428, 521, 2698, 3556];

#[test]
fn streets_are_the_same_wherever_they_stand_and_however_they_are_written() {
    let (mut n, mut n_missed) = (0, 0);
    for seed in (0..n_cases(40, 600)).chain(TELLING) {
        let mut random = Uniform(seed);
        let outlines = street(&mut random, seed % 2 == 0);
        let in_full = |v: DVec3| v.to_array().map(|x| x.to_string());
        let truth = compute(written(&outlines, || false, in_full), 1e-6);
        for _ in 0..2 {
            let format = pick(
                &mut random,
                &[
                    Format::Full,
                    Format::Full,
                    Format::Decimals(3),
                    Format::Decimals(4),
                    Format::Decimals(6),
                    Format::Millimetres,
                    Format::Digits(8),
                ],
            );
            // Numbers in full are rounded to f64 alone; decimals of a scene along the axes fit together, and are exact.
            let shift = match format {
                Format::Full => pick(&mut random, &[0.0, 1e3, 2e5]),
                _ => pick(&mut random, &[0.0, 10.0]),
            };
            let axis = DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), 1.0).normalize();
            let turn = DQuat::from_axis_angle(axis, random.between(0.2, 6.0));
            let shift = DVec3::new(shift, -0.7 * shift, 0.3 * shift);
            let place = |v: DVec3| (turn * v + shift).to_array().map(|x| format.write(x));
            let mut in_halves = Uniform(seed);
            let file = written(&outlines, || in_halves.next() < 0.3, place);
            let found = compute(file, pick(&mut random, &[1e-3, 1e-4, 1e-6]));
            let of_f64 = 1e-13 + 1e-14 * shift.x;
            for k in 0..outlines.len() * outlines.len() {
                let off = (found.form_factor[k] - truth.form_factor[k]).abs();
                let stated = found.error[k] + truth.error[k] + of_f64;
                let case = || {
                    format!(
                        "{seed} {format:?} {shift} {k}: {} {} {off:e} {stated:e}",
                        found.form_factor[k], truth.form_factor[k]
                    )
                };
                // Beyond three standard deviations, and of a second order.
                assert!(off <= 2.0 * stated + 2e-7, "{}", case());
                n += 1;
                n_missed += usize::from(off > stated);
            }
        }
    }
    // What rounding takes is stated by three standard deviations.
    assert!(2000 * n_missed <= n, "{n_missed} of {n}");
}
