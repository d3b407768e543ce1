//! Every form-factor method against closed forms and its own guarantees.

use std::num::NonZeroUsize;

use glam::{DQuat, DVec3};
use radiosity::form_factor::{
    CentrePoint, Closure, ExactMethod, FormFactorMethod, Fraction, GaussShooting, Input, RandomShooting, SkyFactors,
    enclosed, sky_factors,
};
use radiosity::geometry::sampling::Sequence;
use radiosity::matrix::{FormFactors, StorageChoice, SurfaceFormFactors};
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::scene::{Scene, builtin, topology};
use radiosity::visibility::Visibility;
use radiosity::visibility::brute_force::BruteForce;
use radiosity::visibility::embree::EmbreeVisibility;

use crate::support::rooms::Shapes;

const PARALLEL: f64 = 0.199_824_895_698_387_38;
const PERPENDICULAR: f64 = 0.200_043_776_075_403_15;

fn compute(scene: &Scene, subdivide: u32, method: &dyn FormFactorMethod) -> (Mesh, FormFactors) {
    let visibility = EmbreeVisibility::new(scene).unwrap();
    compute_with(scene, subdivide, method, &visibility)
}

fn compute_with(
    scene: &Scene,
    subdivide: u32,
    method: &dyn FormFactorMethod,
    visibility: &dyn Visibility,
) -> (Mesh, FormFactors) {
    let mesh = Mesh::new(scene, Subdivision::Uniform(subdivide)).unwrap();
    let input = Input {
        scene,
        mesh: &mesh,
        visibility,
        unoccluded: false,
    };
    let factors = method
        .compute(input, StorageChoice::default(), &Silent)
        .unwrap()
        .factors;
    (mesh, factors)
}

fn by_surface(scene: &Scene, mesh: &Mesh, factors: &FormFactors) -> SurfaceFormFactors {
    let surfaces: Vec<u32> = mesh.patches.iter().map(|p| p.surface.0).collect();
    factors.surface_form_factors(&surfaces, scene.surfaces.len())
}

fn sr(rays: u64, sequence: Sequence, seed: u64) -> RandomShooting {
    RandomShooting { rays, sequence, seed }
}

fn sg(points: usize, rays: u64, sequence: Sequence, seed: u64) -> GaussShooting {
    GaussShooting {
        points: NonZeroUsize::new(points).unwrap(),
        rays,
        sequence,
        seed,
    }
}

/// The exact form factors between the walls of the cube, in the order x0 x1 y0 y1 z0 z1.
fn cube(i: usize, j: usize) -> f64 {
    if i == j {
        0.0
    } else if i / 2 == j / 2 {
        PARALLEL
    } else {
        PERPENDICULAR
    }
}

#[test]
fn shooting_meets_the_cube_within_its_own_error() {
    let scene = builtin::build("cube", None).unwrap().scene;
    // Independent numbers: 30 factors and 20 seeds, |z| beyond 4.5 has a chance of 0.4 % in all; the mean of z² has a
    // standard deviation of about 0.1 with the factors of a row being weakly dependent.
    let (mut z_max, mut z_squared, mut count) = (0.0_f64, 0.0, 0);
    for seed in 0..20 {
        let (mesh, factors) = compute(&scene, 2, &sr(2000, Sequence::Random, seed));
        let surfaces = by_surface(&scene, &mesh, &factors);
        for i in 0..6 {
            for j in 0..6 {
                let difference = surfaces.form_factor[6 * i + j] - cube(i, j);
                if i == j {
                    assert!(difference.abs() < 1e-15, "a wall does not see itself");
                    continue;
                }
                let z = difference / surfaces.error[6 * i + j];
                z_max = z_max.max(z.abs());
                z_squared += z * z;
                count += 1;
            }
        }
    }
    let mean = z_squared / f64::from(count);
    // Below 1 because the four starting patches of a wall are stratified and their factors differ.
    assert!(
        (0.6..1.25).contains(&mean),
        "the stated errors are the true ones: {mean}"
    );
    assert!(z_max < 4.5, "{z_max}");
}

#[test]
fn sobol_points_beat_independent_ones() {
    let scene = builtin::build("cube", None).unwrap().scene;
    let rms = |sequence| {
        let mut sum = 0.0;
        for seed in 0..10 {
            let (mesh, factors) = compute(&scene, 1, &sr(4096, sequence, seed));
            let surfaces = by_surface(&scene, &mesh, &factors);
            for i in 0..6 {
                for j in 0..6 {
                    sum += (surfaces.form_factor[6 * i + j] - cube(i, j)).powi(2) / 300.0;
                }
            }
        }
        sum.sqrt()
    };
    let (sobol, random) = (rms(Sequence::Sobol), rms(Sequence::Random));
    // sqrt(0.2 · 0.8 / 4096) = 0.00625 for independent rays.
    assert!((0.005..0.0075).contains(&random), "{random}");
    assert!(sobol < 0.4 * random, "{sobol} against {random}");
}

#[test]
fn gauss_points_converge_to_the_cube() {
    let scene = builtin::build("cube", None).unwrap().scene;
    for points in [5, 10] {
        // Exact factors from 5 × 5 points on these patches are within 1e-7: what is left is noise.
        let (mesh, factors) = compute(&scene, 3, &sg(points, 20_000, Sequence::Sobol, 1));
        let surfaces = by_surface(&scene, &mesh, &factors);
        for i in 0..6 {
            for j in 0..6 {
                let difference = (surfaces.form_factor[6 * i + j] - cube(i, j)).abs();
                let error = surfaces.error[6 * i + j];
                assert!(
                    difference < 3.0 * error && error < 1.2e-3,
                    "sg{points} {i} {j}: {difference:e} ± {error:e}"
                );
            }
        }
    }
}

/// Few rays that all hit one patch do not make its form factor certain; of many the error is the binomial one.
#[test]
fn no_number_of_rays_is_certain() {
    let scene = builtin::build("cube", None).unwrap().scene;
    for rays in [1_u64, 2] {
        let (mesh, factors) = compute(&scene, 1, &sr(rays, Sequence::Random, 3));
        let n = mesh.n_patches();
        let hit = (0..n * n).filter(|k| factors.get(k / n, k % n) > 0.0);
        let least = hit.map(|k| factors.std_error(k / n, k % n)).fold(1.0, f64::min);
        // By Laplace's rule: a third of the light may go elsewhere after one ray, a quarter after two.
        assert!(least > 0.3, "{rays} rays: {least}");
    }
    let (_, factors) = compute(&scene, 1, &sr(10_000, Sequence::Random, 3));
    let value = factors.get(0, 1);
    let binomial = (value * (1.0 - value) / 1e4).sqrt();
    assert!((factors.std_error(0, 1) / binomial - 1.0).abs() < 1e-6);
}

#[test]
fn occluded_scenes_meet_their_certified_factors() {
    let scene = builtin::build("corridor", None).unwrap().scene;
    let method = sr(400_000, Sequence::Sobol, 1);
    let (mesh, factors) = compute(&scene, 1, &method);
    let surfaces = by_surface(&scene, &mesh, &factors);
    let n = surfaces.n_surfaces;
    // A to B beneath the partition, A to the partition: tests/data/reference/occluded.json.
    for (column, exact) in [(1, 0.102_930_079_594_358_68), (2, 0.193_191_244_633_067_53)] {
        let (value, error) = (surfaces.form_factor[column], surfaces.error[column]);
        assert!(
            (value - exact).abs() < 3.0 * error && error < 1e-3,
            "{value} ± {error}, exact {exact}"
        );
    }
    // B sees the other side of the partition, and A never does.
    assert!((surfaces.form_factor[n + 3] - 0.193_191_244_633_067_53).abs() < 3.0 * surfaces.error[n + 3]);
    assert!(surfaces.form_factor[3].abs() < 1e-15 && surfaces.form_factor[n + 2].abs() < 1e-15);
    let sky = sky_of(&scene, &mesh, &factors, &method).of_surfaces(&mesh, n).sky;
    let lost = 1.0 - surfaces.form_factor[1] - surfaces.form_factor[2];
    assert!((sky[0].value - lost).abs() < 1e-12 && (surfaces.lost_factor[0] - lost).abs() < 1e-12);
}

fn sky_of(scene: &Scene, mesh: &Mesh, factors: &FormFactors, method: &dyn FormFactorMethod) -> SkyFactors {
    let visibility = EmbreeVisibility::new(scene).unwrap();
    let input = Input {
        scene,
        mesh,
        visibility: &visibility,
        unoccluded: false,
    };
    let found = enclosed(
        input,
        topology::is_watertight(scene),
        factors.tallies(),
        Closure::Detect,
    )
    .unwrap();
    sky_factors(input, factors, method.reciprocity(), &found)
}

/// What is missing from a row has escaped, but for what backs take.
#[test]
fn the_sky_is_what_escapes() {
    let sky = |scene: &Scene, method: &dyn FormFactorMethod| {
        let (mesh, factors) = compute(scene, 2, method);
        let surfaces = by_surface(scene, &mesh, &factors);
        let sky = sky_of(scene, &mesh, &factors, method).of_surfaces(&mesh, surfaces.n_surfaces);
        (sky, surfaces.lost_factor)
    };
    let built = |name: &str| builtin::build(name, None).unwrap().scene;
    let rays = sr(4096, Sequence::Sobol, 1);
    let exact = ExactMethod::default();
    // Open at its sides, with a sheet of two faces in it: no back is to be seen.
    let corridor = built("corridor");
    let (known, counted) = (sky(&corridor, &exact), sky(&corridor, &rays));
    for (k, lost) in known.1.iter().enumerate() {
        let [by_rows, by_rays] = [&known, &counted].map(|(of_surfaces, _)| of_surfaces.sky[k].value);
        assert!((by_rows - lost).abs() < 1e-12 && (by_rows - by_rays).abs() < 1e-2);
        assert_eq!(known.0.back[k], Fraction::default());
    }
    // Closed: nothing escapes, whatever the rows miss.
    let centre = CentrePoint { normalise: false };
    assert_eq!(sky(&built("room-box"), &centre).0.sky, vec![Fraction::default(); 12]);
    // Blocks without a bottom stand on the floor, which sees their insides.
    let cornell = built("cornell-box");
    let floor = cornell.surfaces.iter().position(|s| s.name == "floor").unwrap();
    let ((found, missing), by_rays) = (sky(&cornell, &exact), sky(&cornell, &rays).0);
    assert!((missing[floor] - 0.301).abs() < 1e-3, "{}", missing[floor]);
    for (own, of_rays) in [
        (found.sky[floor], by_rays.sky[floor]),
        (found.back[floor], by_rays.back[floor]),
    ] {
        assert!(
            (own.value - of_rays.value).abs() < 1e-2 && own.error() < 1e-3,
            "{own:?} {of_rays:?}"
        );
    }
    assert!((found.sky[floor].value - 0.121).abs() < 3e-3, "{:?}", found.sky[floor]);
}

/// A block that is closed all around hides its backs from what is clear of it; one that stands on the floor does not from the floor under it, and its bottom sees no sky.
#[test]
fn blocks_hide_their_backs() {
    let room = |height: f64| {
        let mut shapes = Shapes::default();
        shapes.face(&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]].map(|[x, y]| DVec3::new(x, y, 0.0)));
        shapes.face(&[[0.0, 0.0], [0.0, 2.5], [3.0, 2.5], [3.0, 0.0]].map(|[y, z]| DVec3::new(4.0, y, z)));
        let (low, high) = (DVec3::new(1.0, 1.0, height), DVec3::new(2.0, 2.0, height + 1.0));
        shapes.cuboid(low, high, DQuat::IDENTITY, false);
        let scene = shapes.scene();
        let methods: [&dyn FormFactorMethod; 2] = [&ExactMethod::default(), &sr(1024, Sequence::Sobol, 1)];
        methods.map(|method| {
            let (mesh, factors) = compute(&scene, 1, method);
            let found = sky_of(&scene, &mesh, &factors, method);
            let bottom = (2..8).find(|&k| mesh.patches[k].normal.z < -0.9).unwrap();
            (found, bottom)
        })
    };
    for (k, (floating, bottom)) in room(0.5).into_iter().enumerate() {
        if k == 0 {
            assert_eq!(floating.back, [Fraction::default(); 8]);
        }
        assert!(
            floating.back[bottom].value < 1e-12 && floating.sky[bottom].value > 0.01,
            "{floating:?}"
        );
    }
    for (k, (standing, bottom)) in room(0.0).into_iter().enumerate() {
        let noise = if k == 0 { 1e-6 } else { 1e-2 };
        let of_floor = standing.back[0];
        assert!(
            (of_floor.value - 1.0 / 12.0).abs() < noise + of_floor.error(),
            "{standing:?}"
        );
        for i in 1..8 {
            let expected = if i == bottom { 1.0 } else { 0.0 };
            assert!((standing.back[i].value - expected).abs() < 1e-12, "{i} {standing:?}");
        }
        assert_eq!(standing.sky[bottom], Fraction::default());
    }
}

#[test]
fn the_room_with_a_box_meets_its_certified_factors() {
    let text = std::fs::read_to_string("tests/data/reference/occluded.json").unwrap();
    let reference: serde_json::Value = serde_json::from_str(&text).unwrap();
    let exact = &reference["room_box_12"]["F"];
    let scene = builtin::build("room-box", None).unwrap().scene;
    let (mesh, factors) = compute(&scene, 4, &sr(20_000, Sequence::Sobol, 5));
    let surfaces = by_surface(&scene, &mesh, &factors);
    assert_eq!(surfaces.n_surfaces, 12);
    let mut worst: f64 = 0.0;
    for i in 0..12 {
        for j in 0..12 {
            let (k, expected) = (12 * i + j, exact[i][j].as_f64().unwrap());
            let difference = (surfaces.form_factor[k] - expected).abs();
            worst = worst.max(difference);
            assert!(
                difference < 3.5 * surfaces.error[k],
                "{i} {j}: {difference:e} ± {:e}",
                surfaces.error[k]
            );
        }
    }
    assert!(worst < 5e-4, "{worst:e}");
}

#[test]
fn equal_seeds_give_equal_bits_at_any_number_of_threads() {
    let scene = builtin::build("room-box", None).unwrap().scene;
    for method in [
        &sr(300, Sequence::Sobol, 7) as &dyn FormFactorMethod,
        &sg(3, 300, Sequence::Random, 7),
    ] {
        let bits = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (_, factors) = pool.install(|| compute(&scene, 3, method));
            let mut all = Vec::new();
            for i in 0..factors.n_rows() {
                factors.for_each_in_row(i, |j, value, error| all.push((i, j, value.to_bits(), error.to_bits())));
            }
            all
        };
        let one = bits(1);
        assert!(!one.is_empty());
        assert_eq!(one, bits(2));
        assert_eq!(one, bits(4));
    }
}

#[test]
fn the_f64_oracle_gives_the_same_form_factors() {
    let scene = builtin::build("room-box", None).unwrap().scene;
    let method = sr(200, Sequence::Random, 11);
    let (_, embree) = compute(&scene, 2, &method);
    let oracle = BruteForce::new(&scene);
    let (_, exact) = compute_with(&scene, 2, &method, &oracle);
    let mut differing = 0;
    for i in 0..embree.n_rows() {
        for j in 0..embree.n_rows() {
            differing += u32::from((embree.get(i, j) - exact.get(i, j)).abs() > 1e-12);
        }
    }
    // A ray within f32 rounding of an edge may go either way: of 9600 rays, none or hardly one.
    assert!(differing <= 2, "{differing} entries differ");
}
