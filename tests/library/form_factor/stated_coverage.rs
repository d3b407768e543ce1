//! The share of form factors, and of sky factors, that lie within the errors that each method states for them.

#![expect(clippy::print_stdout, reason = "tables are printed")]

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3, EulerRot};
use radiosity::form_factor::registry::{self, METHODS};
use radiosity::form_factor::{ExactMethod, FormFactorError, MethodSettings, SkyFactors};
use radiosity::matrix::FormFactors;
use radiosity::scene::{Scene, builtin};

use super::sky::sky;
use crate::support::Uniform;
use crate::support::rooms::{Prepared, Shapes, moved};

/// The tolerance of the true values.
const TRUTH: f64 = 1e-7;

fn turn() -> DQuat {
    DQuat::from_euler(EulerRot::ZYX, 0.6, 0.35, -0.8)
}

fn shapes(build: impl FnOnce(&mut Shapes)) -> Scene {
    let mut shapes = Shapes::default();
    build(&mut shapes);
    moved(&shapes.scene(), turn(), 1.0, DVec3::new(0.3, -0.7, 0.2))
}

fn quad(shapes: &mut Shapes, corner: DVec3, u: DVec3, v: DVec3) {
    shapes.face(&[corner, corner + u, corner + u + v, corner + v]);
}

fn plate(shapes: &mut Shapes, middle: DVec3, side: f64, up: bool) {
    let (x, y) = (side * DVec3::X, if up { side } else { -side } * DVec3::Y);
    quad(shapes, middle - 0.5 * (x + y), x, y);
}

fn room(shapes: &mut Shapes, size: DVec3) {
    shapes.cuboid(DVec3::ZERO, size, DQuat::IDENTITY, true);
}

fn block(shapes: &mut Shapes, low: DVec3, size: DVec3, angle: f64) {
    shapes.cuboid(low, low + size, DQuat::from_rotation_z(angle), false);
}

/// A ball of latitudes and longitudes; inwards if `inside`.
fn globe(shapes: &mut Shapes, radius: f64, n: usize, rings: usize, inside: bool) {
    let at = |k: usize, ring: usize| {
        let (across, down) = (TAU * (k % n) as f64 / n as f64, PI * ring as f64 / rings as f64);
        radius * DVec3::new(down.sin() * across.cos(), down.sin() * across.sin(), down.cos())
    };
    for ring in 0..rings {
        for k in 0..n {
            let mut corners = vec![at(k, ring), at(k, ring + 1), at(k + 1, ring + 1), at(k + 1, ring)];
            if ring == 0 {
                corners.truncate(3);
                corners[0] = radius * DVec3::Z;
            } else if ring == rings - 1 {
                corners.remove(2);
                corners[1] = -radius * DVec3::Z;
            }
            if inside {
                corners.reverse();
            }
            shapes.face(&corners);
        }
    }
}

fn terrain(shapes: &mut Shapes, n: usize) {
    let at = |a: usize, b: usize| {
        let (x, y) = (a as f64 / n as f64 * 4.0, b as f64 / n as f64 * 4.0);
        DVec3::new(
            x,
            y,
            0.6 * (1.9 * x + 0.3).sin() * (1.4 * y - 0.4).cos() + 0.2 * (3.1 * x - 2.2 * y).sin(),
        )
    };
    for a in 0..n {
        for b in 0..n {
            shapes.face(&[at(a, b), at(a + 1, b), at(a + 1, b + 1)]);
            shapes.face(&[at(a, b), at(a + 1, b + 1), at(a, b + 1)]);
        }
    }
}

fn random_triangles(shapes: &mut Shapes, n: usize, size: f64, seed: u64) {
    let mut uniform = Uniform(seed);
    let mut point = |scale: f64| scale * (DVec3::from_array([(); 3].map(|()| uniform.next())) - 0.5);
    for _ in 0..n {
        let middle = point(2.0);
        let corners = [(); 3].map(|()| middle + point(size));
        shapes.face(&corners);
    }
}

/// Returns a built-in scene.
fn built(name: &str, level: Option<u32>) -> Scene {
    builtin::build(name, level).unwrap().scene
}

/// The scenes: name, scene, subdivision of each face.
#[rustfmt::skip]
fn scenes() -> Vec<(&'static str, Scene, u32)> {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    vec![
        ("cube", built("cube", None), 3),
        ("room-box", built("room-box", None), 2),
        ("cornell-box", built("cornell-box", None), 2),
        ("corridor", built("corridor", None), 4),
        ("lewis-room", built("lewis-room", Some(2)), 1),
        ("globe in a globe", shapes(|s| { globe(s, 0.5, 10, 5, false); globe(s, 1.0, 10, 5, true); }), 1),
        ("ball in a room", shapes(|s| { room(s, DVec3::splat(4.0)); s.ball(DVec3::new(1.7, 2.1, 2.2), 1.0, 1); }), 1),
        ("terrain", shapes(|s| terrain(s, 8)), 1),
        ("blocks in a room", shapes(|s| {
            room(s, DVec3::new(4.0, 3.0, 2.5));
            block(s, DVec3::new(0.5, 0.6, 0.3), DVec3::new(0.8, 0.7, 1.4), 0.4);
            block(s, DVec3::new(2.3, 1.3, 0.2), DVec3::new(0.9, 0.9, 0.6), 1.1);
        }), 2),
        ("small lamp, large floor", shapes(|s| { plate(s, DVec3::ZERO, 6.0, true); plate(s, DVec3::new(0.4, 0.3, 2.0), 0.1, false); }), 4),
        ("lamp behind a screen", shapes(|s| {
            plate(s, DVec3::ZERO, 3.0, true);
            plate(s, 2.0 * z, 0.6, false);
            plate(s, DVec3::new(0.2, 0.1, 1.0), 0.7, true);
            plate(s, DVec3::new(0.2, 0.1, 1.0), 0.7, false);
        }), 4),
        ("triangles at random", shapes(|s| random_triangles(s, 40, 1.2, 3)), 1),
        ("more triangles at random", shapes(|s| random_triangles(s, 110, 0.6, 8)), 1),
        ("street", shapes(|s| {
            plate(s, DVec3::ZERO, 12.0, true);
            for (k, height) in [2.0, 3.5, 1.2, 2.6].into_iter().enumerate() {
                let low = DVec3::new(if k % 2 == 0 { -4.0 } else { 1.5 }, if k < 2 { -4.0 } else { 1.0 }, 0.01);
                block(s, low, DVec3::new(2.5, 2.8, height), 0.0);
            }
        }), 2),
        ("stairs", shapes(|s| for k in 0..8 {
            let at = f64::from(k) * DVec3::new(0.0, 0.3, 0.2);
            quad(s, at, x, 0.3 * y);
            quad(s, at + 0.3 * y, x, 0.2 * z);
        }), 2),
        ("slit", shapes(|s| {
            plate(s, DVec3::new(0.0, 0.0, -1.0), 2.0, true);
            plate(s, z, 2.0, false);
            for side in [-1.0, 1.0] {
                plate(s, DVec3::new(side * 1.55, 0.0, 0.0), 3.0, true);
                plate(s, DVec3::new(side * 1.55, 0.0, 0.0), 3.0, false);
            }
        }), 3),
        ("strips", shapes(|s| for k in 0..10 {
            quad(s, f64::from(k) * 0.1 * y, 4.0 * x, 0.1 * y);
            quad(s, DVec3::new(0.0, f64::from(k) * 0.1, 0.5), 4.0 * x, 0.1 * y);
            quad(s, DVec3::new(0.0, f64::from(k) * 0.1, 1.0), 0.1 * y, 4.0 * x);
        }), 1),
        ("grooves", shapes(|s| for k in 0..8 {
            let at = f64::from(k) * 0.5 * x;
            quad(s, at, DVec3::new(0.25, 0.0, -0.4), 2.0 * y);
            quad(s, at + DVec3::new(0.25, 0.0, -0.4), DVec3::new(0.25, 0.0, 0.4), 2.0 * y);
        }), 3),
        ("tube", shapes(|s| for k in 0..12 {
            let at = |corner: i32| DVec3::new((TAU * f64::from(corner) / 12.0).cos(), (TAU * f64::from(corner) / 12.0).sin(), 0.0);
            for level in 0..3 {
                let low = at(k) + f64::from(level) * 1.5 * z;
                s.face(&[low, low + 1.5 * z, at(k + 1) + f64::from(level + 1) * 1.5 * z, at(k + 1) + f64::from(level) * 1.5 * z]);
            }
        }), 1),
        ("tree", shapes(|s| {
            plate(s, DVec3::ZERO, 4.0, true);
            let mut leaves = Uniform(21);
            for _ in 0..20 {
                let mut point = |scale: f64| scale * (DVec3::from_array([(); 3].map(|()| leaves.next())) - 0.5);
                let middle = point(2.0) + 1.6 * z;
                let [a, b, c] = [(); 3].map(|()| middle + point(0.7));
                s.face(&[a, b, c]);
                s.face(&[a, c, b]);
            }
        }), 2),
    ]
}

/// What was found of one method in one scene, or in all.
#[derive(Clone, Debug, Default)]
struct Coverage {
    n: usize,
    within_one: usize,
    within_two: usize,
    /// Stated error over true error, where the true values tell it.
    ratios: Vec<f64>,
    worst: f64,
    /// Entries that are stated to be exactly 0 and are not.
    n_certain_and_wrong: usize,
}

impl Coverage {
    fn add(&mut self, truth: &FormFactors, found: &FormFactors) {
        let n = truth.n_rows();
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            let slack = truth.std_error(i, j) + 1e-14;
            self.note(truth.get(i, j), (found.get(i, j), found.std_error(i, j)), slack);
        }
    }

    /// Adds what of the light of each patch escapes.
    fn add_sky(&mut self, truth: &SkyFactors, found: &SkyFactors) {
        for (right, own) in truth.sky.iter().zip(&found.sky) {
            self.note(right.value, (own.value, own.error()), right.error() + 1e-14);
        }
    }

    /// Adds a value with its stated error, whose true value is known to `slack`.
    fn note(&mut self, right: f64, (value, stated): (f64, f64), slack: f64) {
        if value.abs() + stated + right <= slack {
            return;
        }
        let error = (value - right).abs();
        self.n += 1;
        self.within_one += usize::from(error <= stated + slack);
        self.within_two += usize::from(error <= 2.0 * stated + slack);
        self.n_certain_and_wrong += usize::from(value.abs() + stated <= 0.0 && right > slack);
        // Rounding is stated as a bound.
        if error > 3.0 * (slack + 1e-12) {
            self.ratios.push(stated / error);
            self.worst = self.worst.max((error - slack) / stated.max(1e-300));
        }
    }

    fn join(&mut self, other: &Self) {
        self.n += other.n;
        self.within_one += other.within_one;
        self.within_two += other.within_two;
        self.n_certain_and_wrong += other.n_certain_and_wrong;
        self.worst = self.worst.max(other.worst);
        self.ratios.extend(&other.ratios);
    }

    fn shares(&self) -> [f64; 2] {
        [self.within_one, self.within_two].map(|k| k as f64 / self.n.max(1) as f64)
    }

    fn median(&self) -> f64 {
        let mut ratios = self.ratios.clone();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).copied().unwrap_or(1.0)
    }
}

/// Computes the coverage of each of `names` in a scene, with its default settings and some seeds: of entries, and of sky factors; `None` for methods that cannot treat it.
fn coverages(scene: Scene, subdivide: u32, names: &[&str], seeds: u64) -> Vec<Option<[Coverage; 2]>> {
    let prepared = Prepared::new(scene, subdivide);
    let exact = ExactMethod {
        tolerance: TRUTH,
        ..ExactMethod::default()
    };
    let truth = prepared.compute(&exact);
    let true_sky = sky(&prepared, &truth, &exact);
    let of_method = |name: &&str| {
        let [mut entries, mut skies] = [(); 2].map(|()| Coverage::default());
        for seed in 0..seeds {
            let settings = MethodSettings::default().seeded(seed);
            let method = registry::method(name, &settings).unwrap();
            match prepared.try_compute(&*method) {
                Ok(found) => {
                    entries.add(&truth, &found.factors);
                    skies.add_sky(&true_sky, &sky(&prepared, &found.factors, &*method));
                }
                Err(FormFactorError::NotApplicable { .. }) => return None,
                Err(error) => panic!("{name}: {error}"),
            }
        }
        Some([entries, skies])
    };
    names.iter().map(of_method).collect()
}

/// Small scenes of each kind: the whole table is [`table`].
#[test]
fn stated_errors_cover_most_entries_and_no_miss_is_certain() {
    let names = ["sr", "sg5", "sg10", "pdm", "gauss-lambert", "contour", "qmc"];
    let some = [
        "cube",
        "globe in a globe",
        "small lamp, large floor",
        "triangles at random",
    ];
    let mut all = vec![Coverage::default(); names.len()];
    for (scene_name, scene, subdivide) in scenes().into_iter().filter(|(name, ..)| some.contains(name)) {
        for ((name, coverage), sum) in names.iter().zip(coverages(scene, subdivide, &names, 1)).zip(&mut all) {
            let [coverage, skies] = coverage.unwrap();
            let [of_sky, twice] = skies.shares();
            assert!(
                skies.n == 0 || of_sky >= 0.68 && twice >= 0.95,
                "sky of {scene_name} {name}: {of_sky} {twice}"
            );
            assert!(skies.worst < 5.0, "sky of {scene_name} {name}: {}", skies.worst);
            let ([one, two], median) = (coverage.shares(), coverage.median());
            assert!(one >= 0.68 && two >= 0.95, "{scene_name} {name}: {one} {two}");
            assert_eq!(coverage.n_certain_and_wrong, 0, "{scene_name} {name}");
            assert!(coverage.worst < 8.0, "{scene_name} {name}: {}", coverage.worst);
            if name.starts_with('s') {
                assert!(median < 3.0, "{scene_name} {name}: {median}");
            }
            sum.join(&coverage);
        }
    }
    // Where few rays stand for all that may be hidden, more is stated in some scenes than in others.
    for (name, coverage) in names.iter().zip(&all) {
        assert!(coverage.median() < 3.0, "{name}: {}", coverage.median());
    }
}

/// Prints the table of `docs/stated-errors.md`; of `SCENE` and of `METHODS`, separated by commas, alone if these are set.
#[test]
#[ignore = "four minutes"]
fn table() {
    let names: Vec<&str> = METHODS.iter().map(|m| m.name).filter(|name| *name != "exact").collect();
    let only = std::env::var("SCENE").ok();
    let names: Vec<&str> = match std::env::var("METHODS") {
        Ok(some) => names
            .into_iter()
            .filter(|name| some.split(',').any(|one| one == *name))
            .collect(),
        Err(_) => names,
    };
    let mut all = vec![[Coverage::default(), Coverage::default()]; names.len()];
    let mut least = vec![[[f64::INFINITY, f64::INFINITY, 0.0]; 2]; names.len()];
    for (scene_name, scene, subdivide) in scenes() {
        if only.as_ref().is_some_and(|only| only != scene_name) {
            continue;
        }
        let begin = std::time::Instant::now();
        let found = coverages(scene, subdivide, &names, 2);
        for (k, coverage) in found.iter().enumerate() {
            for (of, own) in coverage.iter().flatten().enumerate().filter(|(_, own)| own.n > 0) {
                let ([one, two], median) = (own.shares(), own.median());
                println!(
                    "{scene_name:26} {:14} {} n {:6} one {one:.3} two {two:.3} median {median:8.2} worst {:8.1} certain and wrong {}",
                    names[k], TABLES[of], own.n, own.worst, own.n_certain_and_wrong
                );
                all[k][of].join(own);
                let [least_one, least_two, greatest] = least[k][of];
                least[k][of] = [least_one.min(one), least_two.min(two), greatest.max(median)];
            }
        }
        println!("# {:.1} s", begin.elapsed().as_secs_f64());
    }
    for (of, what) in TABLES.iter().enumerate() {
        print_table(&names, what, &all, &least, of);
    }
}

/// The things that are covered.
const TABLES: [&str; 2] = ["entries", "sky factors"];

fn print_table(names: &[&str], what: &str, all: &[[Coverage; 2]], least: &[[[f64; 3]; 2]], of: usize) {
    println!(
        "\n| method | {what} | within one | in the worst scene | within two | in the worst scene | median of stated / true | in the worst scene | worst true / stated |\n|---|---|---|---|---|---|---|---|---|"
    );
    for ((name, coverage), in_worst) in names.iter().zip(all).zip(least) {
        let (coverage, [least_one, least_two, median]) = (&coverage[of], in_worst[of]);
        let [one, two] = coverage.shares();
        println!(
            "| `{}` | {} | {one:.3} | {least_one:.3} | {two:.3} | {least_two:.3} | {:.2} | {median:.2} | {:.1} |",
            name,
            coverage.n,
            coverage.median(),
            coverage.worst
        );
    }
}
