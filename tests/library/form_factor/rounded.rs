//! The error of form factors by rounded coordinates: `exact` states it, and does not claim a tolerance that it exceeds.

use std::path::Path;

use glam::{DQuat, DVec3};
use radiosity::form_factor::{Computed, ExactMethod, FormFactorMethod};
use radiosity::matrix::FormFactors;
use radiosity::scene::{Scene, builtin};

use crate::support::rooms::{Prepared, Shapes, ground, moved, quick, with_decimals, with_digits, written_as};
use crate::support::{Uniform, n_above, n_cases, worst_error};

/// A corner of a room on a map of a country, in metres.
const ON_A_MAP: DVec3 = DVec3::new(500_000.0, 5_600_000.0, 100.0);

/// A room with two boxes that stand on its floor, turned against its walls.
fn room() -> Scene {
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0), DQuat::IDENTITY, true);
    for (low, high, angle) in [
        (DVec3::new(1.0, 1.5, 0.0), DVec3::new(2.2, 3.0, 1.2), 0.3),
        (DVec3::new(2.7, 0.5, 0.0), DVec3::new(3.4, 1.2, 0.8), 0.1),
    ] {
        shapes.cuboid(low, high, DQuat::from_rotation_z(angle), false);
    }
    shapes.scene()
}

fn compute(scene: Scene, subdivide: u32, tolerance: f64) -> Computed {
    let method = ExactMethod {
        tolerance,
        ..ExactMethod::default()
    };
    Prepared::new(scene, subdivide).try_compute(&method).unwrap()
}

#[test]
fn a_tolerance_that_rounding_breaks_is_not_met() {
    let upright = DQuat::from_rotation_z(0.4);
    let tilted = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
    for (turn, places, subdivide, tolerance) in [
        (upright, 3, 1, 1e-6),
        (upright, 3, 2, 1e-4),
        (upright, 6, 1, 1e-6),
        (tilted, 6, 1, 1e-8),
    ] {
        let case = format!("{turn} {places} {subdivide}");
        let scene = with_decimals(places, &moved(&room(), turn, 1.0, ON_A_MAP));
        let computed = compute(scene, subdivide, tolerance);
        let pairs = computed.pairs.unwrap();
        let (n, worst) = (n_above(&computed.factors, tolerance), worst_error(&computed.factors));
        assert!(n > 0 && !computed.tolerance_met, "{case}: {pairs:?}");
        assert_eq!((pairs.n_above_by_rounding, pairs.n_above_tolerance), (n, 0), "{case}");
        // Integrals and rounding make up what is stated together; the areas of bent quads differ by how they are taken.
        let of_rounding = pairs.rounding_error_max;
        assert!(
            of_rounding > 0.0 && of_rounding <= worst * (1.0 + 1e-6) && worst <= of_rounding + tolerance,
            "{case}: {of_rounding:e} {worst:e}"
        );
        if turn == tilted {
            // Pairs in full view, of quads that are bent, count as well.
            assert!(n > pairs.partial, "{case}: {n} {pairs:?}");
        }
    }
}

/// The scenes of the repository, as its users load them, and what files with short decimals or all digits have.
#[test]
fn ordinary_scenes_meet_their_tolerance() {
    let of_repository = ["cube", "room-box", "cornell-box", "corridor", "lewis-room"].map(|name| {
        let path = format!("{}/scenes/{name}/scene.obj", env!("CARGO_MANIFEST_DIR"));
        (name, radiosity::scene::load(Path::new(&path)).unwrap().scene)
    });
    let room_box = builtin::build("room-box", None).unwrap().scene;
    let thirds = moved(&room_box, DQuat::IDENTITY, 1.0 / 3.0, DVec3::ZERO);
    let turned = moved(&room(), DQuat::from_rotation_z(0.4), 1.0, DVec3::ZERO);
    let halves = moved(&room_box, DQuat::IDENTITY, 0.5, DVec3::new(3.0, 10.0, 0.25));
    let others = [
        ("zeros after short decimals", with_decimals(6, &halves)),
        ("all digits along the axes", written_as(|x| x.to_string(), &thirds)),
        ("all digits", with_decimals(15, &turned)),
    ];
    for (name, scene) in of_repository.into_iter().chain(others) {
        for tolerance in [ExactMethod::DEFAULT_TOLERANCE, 1e-9] {
            let computed = compute(scene.clone(), 1, tolerance);
            let pairs = computed.pairs.unwrap();
            assert!(computed.tolerance_met, "{name} {tolerance:e}: {pairs:?}");
            assert_eq!(
                (pairs.n_above_tolerance, pairs.n_above_by_rounding),
                (0, 0),
                "{name} {tolerance:e}"
            );
            assert!(pairs.rounding_error_max <= 0.0, "{name} {tolerance:e}");
            assert_eq!(n_above(&computed.factors, tolerance), 0, "{name} {tolerance:e}");
        }
    }
}

/// Integrals leave room for what rounding adds: where that alone is within the tolerance, both together are.
#[test]
fn rounding_below_the_tolerance_does_not_break_it() {
    for angle in [0.2, 0.4, 0.6] {
        let turned = moved(&room(), DQuat::from_rotation_z(angle), 1.0, DVec3::ZERO);
        for (places, tolerance) in [(6, 1e-4), (7, 1e-5), (8, 1e-6)] {
            let computed = compute(with_decimals(places, &turned), 2, tolerance);
            assert!(
                computed.tolerance_met && n_above(&computed.factors, tolerance) == 0,
                "{angle} {places}: {:?}",
                computed.pairs
            );
        }
    }
}

/// How a file writes its numbers.
type Format = (&'static str, fn(f64) -> String);

#[expect(clippy::cast_possible_truncation, reason = "files from f32 are meant")]
fn single(x: f64) -> String {
    (x as f32).to_string()
}

const TWO_PLACES: Format = ("%.2f", |x| format!("{x:.2}"));
const THREE_PLACES: Format = ("%.3f", |x| format!("{x:.3}"));
const SIX_PLACES: Format = ("%.6f", |x| format!("{x:.6}"));
const SIX_DIGITS: Format = ("%.6g", |x| with_digits(6, x));
const SEVEN_DIGITS: Format = ("%.7g", |x| with_digits(7, x));
const EIGHT_DIGITS: Format = ("%.8g", |x| with_digits(8, x));
const SINGLE: Format = ("f32", single);

/// A room with two boxes, of random sizes, one of them on the floor and one above.
fn random_room(random: &mut Uniform, turned_boxes: bool) -> Scene {
    let mut shapes = Shapes::default();
    let mut between = |low: f64, high: f64| low + (high - low) * random.next();
    let size = DVec3::new(between(3.0, 5.0), between(4.0, 6.0), between(2.4, 3.4));
    shapes.cuboid(DVec3::ZERO, size, DQuat::IDENTITY, true);
    for (x, y, z) in [(0.1, 0.1, 0.0), (0.55, 0.5, 0.3)] {
        let low = size * DVec3::new(x, y, 0.0) + DVec3::new(between(0.1, 0.3), between(0.1, 0.3), z);
        let high = low + DVec3::new(between(0.5, 0.9), between(0.6, 1.2), between(0.4, 1.3));
        let angle = if turned_boxes { between(0.0, 0.8) } else { 0.0 };
        shapes.cuboid(low, high, DQuat::from_rotation_z(angle), false);
    }
    shapes.scene()
}

/// Hills of triangles.
fn hills(random: &mut Uniform) -> Scene {
    let heights: Vec<f64> = (0..25).map(|_| 12.0 * random.next()).collect();
    let at = |x: usize, y: usize| {
        DVec3::new(
            10.0 * x as f64 + 0.1 * heights[5 * x + y],
            10.0 * y as f64,
            heights[5 * y + x],
        )
    };
    let mut shapes = Shapes::default();
    for x in 0..4 {
        for y in 0..4 {
            shapes.face(&[at(x, y), at(x + 1, y), at(x + 1, y + 1)]);
            shapes.face(&[at(x, y), at(x + 1, y + 1), at(x, y + 1)]);
        }
    }
    shapes.scene()
}

/// Nearly flat ground, in triangles of so many metres, whose heights vary by so much.
fn rough_ground(random: &mut Uniform, step: f64, amplitude: f64) -> Scene {
    // The sum of three is much like a normal distribution of that deviation.
    ground(step, || {
        2.0 * amplitude * (random.next() + random.next() + random.next() - 1.5)
    })
}

/// Two long houses beside a street, on a map.
fn street(random: &mut Uniform) -> Scene {
    let mut shapes = Shapes::default();
    let mut between = |low: f64, high: f64| low + (high - low) * random.next();
    let [width, length] = [between(40.0, 60.0), between(150.0, 200.0)];
    let [left, right] = [between(12.0, 18.0), between(8.0, 12.0)];
    shapes.cuboid(
        DVec3::new(-50.0, 0.0, 0.0),
        DVec3::new(0.0, length, left),
        DQuat::IDENTITY,
        false,
    );
    let high = DVec3::new(width + 25.0, length - 10.0, right);
    shapes.cuboid(DVec3::new(width, 10.0, 0.0), high, DQuat::IDENTITY, false);
    let ground = [(0.0, 0.0), (width, 0.0), (width, length), (0.0, length)];
    shapes.face(&ground.map(|(x, y)| DVec3::new(x, y, 0.0)));
    shapes.scene()
}

/// What was stated of the form factors of a scene, in its file's numbers, and how far they are off.
#[derive(Default)]
struct Coverage {
    n: usize,
    above_one: usize,
    above_two: usize,
    ratios: Vec<f64>,
}

impl Coverage {
    /// Compares all form factors between the faces of a scene with those of its file, which `compute` computes.
    fn add(&mut self, truth: &Scene, format: Format, method: &dyn FormFactorMethod) {
        let exact = ExactMethod {
            tolerance: 1e-7,
            ..ExactMethod::default()
        };
        let file = written_as(format.1, truth);
        let n = truth.surfaces.len();
        assert_eq!(file.surfaces.len(), n, "{}", format.0);
        let [meant, read] = [(truth, &exact as &dyn FormFactorMethod), (&file, method)].map(|(scene, method)| {
            let prepared = Prepared::new(scene.clone(), 1);
            let surfaces: Vec<u32> = prepared.mesh.patches.iter().map(|patch| patch.surface.0).collect();
            prepared
                .try_compute(method)
                .unwrap()
                .factors
                .surface_form_factors(&surfaces, n)
        });
        for k in 0..n * n {
            let off = ((meant.form_factor[k] - read.form_factor[k]).abs() - meant.error[k]).max(0.0);
            let stated = read.error[k];
            if read.form_factor[k] <= 0.0 && meant.form_factor[k] <= 0.0 {
                // Patches that do not see each other, and are not meant to: that is right, whatever rounding might have made of them.
                continue;
            }
            // What patches behind each other's planes may see of each other by rounding is stated down to a hundredth of the tolerance.
            let least = if stated > 0.0 { 1e-12 } else { 1e-7 };
            self.n += 1;
            self.above_one += usize::from(off > stated + least);
            self.above_two += usize::from(off > 2.0 * stated + least);
            if read.form_factor[k] > 0.0 {
                self.ratios.push(stated / off.max(1e-14));
            }
        }
    }

    /// Returns the median of what is stated by what is so, of factors above 0 in the file.
    fn median(&mut self) -> f64 {
        self.ratios.sort_by(f64::total_cmp);
        self.ratios[self.ratios.len() / 2]
    }
}

/// A scene by its name, with random sizes.
fn random_scene(kind: &str, random: &mut Uniform) -> Scene {
    let tilted = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.3 + random.next());
    let upright = DQuat::from_rotation_z(0.2 + random.next());
    let on_a_map = ON_A_MAP + 1000.0 * DVec3::new(random.next(), random.next(), 0.1 * random.next());
    match kind {
        "tilted room" => moved(&random_room(random, true), tilted, 1.0, DVec3::ZERO),
        "upright room" => moved(&random_room(random, true), upright, 1.0, DVec3::ZERO),
        "room on a map" => moved(&random_room(random, true), upright, 1.0, on_a_map),
        "room along the axes" => moved(
            &random_room(random, false),
            DQuat::IDENTITY,
            1.0 / 3.0,
            DVec3::splat(1.0 / 3.0),
        ),
        "hills" => hills(random),
        "fine ground on a map" => moved(&rough_ground(random, 0.1, 0.005), DQuat::IDENTITY, 1.0, on_a_map),
        "rough ground on a map" => moved(&rough_ground(random, 0.5, 0.02), DQuat::IDENTITY, 1.0, on_a_map),
        "hilly ground on a map" => moved(&rough_ground(random, 1.0, 0.1), DQuat::IDENTITY, 1.0, on_a_map),
        "hills on a map" => moved(&hills(random), DQuat::IDENTITY, 1.0, on_a_map),
        _ => moved(&street(random), upright, 1.0, on_a_map),
    }
}

/// What coordinates lose in a file is within what is stated of the form factors, which stays of their size: in turned scenes, along the axes and on maps, whatever way numbers are written.
#[test]
fn what_rounding_takes_is_stated() {
    let exact = ExactMethod {
        tolerance: 1e-5,
        ..ExactMethod::default()
    };
    let mut all = Coverage::default();
    for (kind, formats) in [
        ("tilted room", &[TWO_PLACES, SIX_PLACES, SIX_DIGITS][..]),
        ("upright room", &[THREE_PLACES, SEVEN_DIGITS]),
        ("room on a map", &[TWO_PLACES, THREE_PLACES]),
        ("room along the axes", &[SIX_PLACES, SINGLE]),
        ("hills", &[SIX_PLACES, SIX_DIGITS, SINGLE]),
        ("hills on a map", &[TWO_PLACES, THREE_PLACES]),
        ("fine ground on a map", &[TWO_PLACES]),
        ("rough ground on a map", &[TWO_PLACES, SEVEN_DIGITS]),
        ("hilly ground on a map", &[EIGHT_DIGITS]),
        ("street", &[SIX_DIGITS, SEVEN_DIGITS, SINGLE]),
    ] {
        for &format in formats {
            let mut of_kind = Coverage::default();
            for seed in 0..n_cases(1, 2) {
                of_kind.add(&random_scene(kind, &mut Uniform(seed)), format, &exact);
            }
            let case = format!("{kind} {}: {} of {}", format.0, of_kind.above_one, of_kind.n);
            assert!(
                of_kind.n > 0 && of_kind.above_two == 0 && 50 * of_kind.above_one <= of_kind.n,
                "{case}"
            );
            all.n += of_kind.n;
            all.above_one += of_kind.above_one;
            // Ground whose heights vary by about a unit is known by bounds alone.
            if !kind.contains("ground") {
                let median = of_kind.median();
                // Streets of six digits have a unit of a metre or more: there all that may touch is in doubt.
                assert!((1.0..256.0).contains(&median), "{case}: {median}");
                all.ratios.extend(of_kind.ratios);
            }
        }
    }
    assert!(200 * all.above_one <= all.n, "{} of {}", all.above_one, all.n);
    let median = all.median();
    assert!(median < 18.0, "{median}");
}

/// The rounding of a file is a part of the errors of all methods.
#[test]
fn every_method_states_what_rounding_takes() {
    for name in ["sr", "sg5", "hemicube", "gauss-lambert", "contour", "qmc", "pdm"] {
        let mut coverage = Coverage::default();
        coverage.add(&random_scene("street", &mut Uniform(3)), SIX_DIGITS, &*quick(name, 1));
        assert!(
            coverage.n > 0 && coverage.above_two == 0,
            "{name}: {} of {}",
            coverage.above_two,
            coverage.n
        );
    }
}

/// Rectangles of a turned room with two decimals are no rectangles any more: that shows the rounding, and a few digits of a mesh that fits do not.
#[test]
fn a_few_digits_are_rounded_where_the_mesh_shows_it() {
    let upright = DQuat::from_rotation_z(0.4);
    let tilted = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
    for turn in [upright, tilted] {
        let computed = compute(
            written_as(TWO_PLACES.1, &moved(&room(), turn, 1.0, DVec3::ZERO)),
            1,
            1e-6,
        );
        let worst = worst_error(&computed.factors);
        assert!(!computed.tolerance_met && worst > 1e-3, "{turn}: {worst:e}");
    }
    // The same room along the axes, whose boxes are turned by right angles alone.
    let mut shapes = Shapes::default();
    shapes.cuboid(DVec3::ZERO, DVec3::new(4.0, 5.25, 3.1), DQuat::IDENTITY, true);
    shapes.cuboid(
        DVec3::new(1.0, 1.5, 0.0),
        DVec3::new(2.2, 3.05, 1.2),
        DQuat::IDENTITY,
        false,
    );
    for (name, scene) in [
        ("%.2f", written_as(TWO_PLACES.1, &shapes.clone().scene())),
        (
            "millimetres",
            written_as(|x| format!("{:.0}", 1000.0 * x), &shapes.scene()),
        ),
    ] {
        let computed = compute(scene, 1, 1e-6);
        let worst = worst_error(&computed.factors);
        assert!(computed.tolerance_met && worst <= 1e-6, "{name}: {worst:e}");
    }
}

/// Returns the largest row sum, and error of a row, of the bottom of a turned block `gap` m over a wide ground, in a file of so many decimals.
fn of_bottom(random: &mut Uniform, places: usize, gap: f64, method: &dyn FormFactorMethod) -> [f64; 2] {
    let low = DVec3::new(random.between(0.0, 3.5), random.between(0.0, 3.5), gap);
    let mut shapes = Shapes::default();
    shapes.face(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(|[x, y]| DVec3::new(x, y, 0.0)));
    shapes.cuboid(low, low + DVec3::splat(0.5), DQuat::IDENTITY, false);
    let axis = DVec3::from_array([(); 3].map(|()| random.between(-1.0, 1.0))).normalize();
    let turn = DQuat::from_axis_angle(axis, random.between(0.3, 2.8));
    let scene = moved(&shapes.scene(), turn, 1.0, DVec3::ZERO);
    // Bent quads become triangles.
    let prepared = Prepared::new(written_as(|x| format!("{x:.places$}"), &scene), 1);
    let factors = prepared.compute(method);
    let patches = &prepared.mesh.patches;
    let bottom = (0..patches.len()).filter(|&i| patches[i].normal.dot(turn * DVec3::Z) < -0.9);
    let n = factors.n_rows();
    let rows = bottom
        .map(|i| [FormFactors::get, FormFactors::std_error].map(|of| (0..n).map(|j| of(&factors, i, j)).sum::<f64>()));
    rows.fold([0.0, 0.0], |[a, b], [c, d]| [a.max(c), b.max(d)])
}

/// Nothing tells a gap of two units of the last digit from contact for certain, and contact is what a file with less means.
#[test]
fn a_gap_of_two_units_is_in_doubt_and_a_block_on_the_ground_is_not() {
    let mut random = Uniform(20_261_128);
    let exact = ExactMethod::default();
    let methods: [&dyn FormFactorMethod; 2] = [&exact, &*quick("qmc", 3)];
    for (case, (places, unit)) in (0..n_cases(20, 200)).zip([(3, 1e-3), (6, 1e-6), (4, 1e-4)].into_iter().cycle()) {
        let method = methods[usize::from(case % 5 == 4)];
        let [sum, error] = of_bottom(&mut random, places, 0.0, method);
        assert!(sum < 0.02 && error < 0.02, "{case}: {sum} {error}");
        for gap in [2.0, 3.0] {
            let parted = of_bottom(&mut random, places, gap * unit, method);
            assert!(parted.iter().any(|x| *x > 0.95), "{case}, {gap} units: {parted:?}");
        }
    }
}

/// Adds one side of a sheet, cut into a grid whose quads are whole or halved.
fn side_of_sheet(random: &mut Uniform, shapes: &mut Shapes, size: [f64; 2], is_back: bool) {
    let n = [(); 2].map(|()| 1 + u32::from(random.next() < 0.6) + u32::from(random.next() < 0.3));
    let corner = |i: u32, j: u32| {
        let at = |axis: usize, k: u32| size[axis] * f64::from(k) / f64::from(n[axis]);
        DVec3::new(at(0, i), at(1, j), 0.0)
    };
    let mut add = |corners: &[DVec3]| {
        let mut corners = corners.to_vec();
        if is_back {
            corners.reverse();
        }
        shapes.face(&corners);
    };
    for k in 0..n[0] * n[1] {
        let (i, j) = (k / n[1], k % n[1]);
        let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(x, y)| corner(i + x, j + y));
        if random.next() < 0.5 {
            add(&[a, b, c]);
            add(&[a, c, d]);
        } else {
            add(&[a, b, c, d]);
        }
    }
}

/// Few digits leave heights over a plane that are multiples of one number, so that triangles are often parallel to it.
#[test]
fn the_sides_of_a_sheet_that_are_cut_differently_do_not_see_each_other() {
    let mut random = Uniform(20_261_129);
    let n = n_cases(100, 1_000);
    let mut n_doubtful = 0;
    for case in 0..n {
        let mut shapes = Shapes::default();
        let size = [(); 2].map(|()| random.between(0.3, 2.0));
        for is_back in [false, true] {
            side_of_sheet(&mut random, &mut shapes, size, is_back);
        }
        let axis = DVec3::from_array([(); 3].map(|()| random.between(-1.0, 1.0))).normalize();
        let turn = DQuat::from_axis_angle(axis, random.between(0.3, 2.8));
        let places = [3, 4, 6][case % 3];
        let scene = moved(&shapes.scene(), turn, 1.0, DVec3::ZERO);
        let factors = compute(written_as(|x| format!("{x:.places$}"), &scene), 1, 1e-4).factors;
        let n_rows = factors.n_rows();
        let worst = |of: fn(&FormFactors, usize, usize) -> f64| {
            let pairs = (0..n_rows).flat_map(|i| (0..n_rows).map(move |j| (i, j)));
            pairs.map(|(i, j)| of(&factors, i, j)).fold(0.0, f64::max)
        };
        let beyond = worst(|of, i, j| of.get(i, j) - of.std_error(i, j));
        assert!(beyond < 1e-6, "{case}: {beyond:e}");
        n_doubtful += usize::from(worst(FormFactors::std_error) > 0.02);
    }
    assert!(100 * n_doubtful <= 3 * n, "{n_doubtful} of {n}");
}
