//! Compares the speed of solvers: in the room of Lewis 1992, and in the six cases of Baranoski, Bramley and Shirley 1995.
//!
//! Every line is a level or a case; runs alternate, and the ratio of medians counts. The room of Lewis: from u = f to max |r| < 2.5e-5 W·m⁻², with one check of the true
//! residual. The cases: from B = E to a relative residual of 1e-6, times over that of `gauss-seidel`; setup is part of the time. "auto / best" is the time of `auto` over that of the
//! fastest other solver of the line.
//! `cargo bench --bench solvers -- 5` goes up to level 5, the default; `-- 5 lewis` omits the cases.
#![expect(clippy::print_stdout, reason = "a benchmark prints its figures")]

use std::ops::ControlFlow;
use std::sync::Arc;

use radiosity::experiment::lewis::{Room, TOLERANCE};
use radiosity::form_factor::{FormFactorMethod, Input, RandomShooting};
use radiosity::geometry::sampling::Sequence;
use radiosity::matrix::operator::Block;
use radiosity::matrix::{FormFactors, Precision, StorageChoice};
use radiosity::mesh::{Hierarchy, Mesh, Prolongation, Subdivision};
use radiosity::progress::Silent;
use radiosity::scene::{builtin, topology};
use radiosity::solver::registry::SOLVERS;
use radiosity::solver::{
    GaussSeidel, Gmres, Multigrid, RadiositySystem, Solution, SolveOptions, Solver, SolverSettings, StopReason,
    Tolerance, solver,
};
use radiosity::visibility::embree::EmbreeVisibility;

/// The number of runs of each measurement, of which the median counts.
const N_ROUNDS: usize = 9;

/// The rays for each patch of the cases: the share of entries that are 0 is then that of exact form factors, to a hundredth.
const RAYS: u64 = 1 << 16;

fn main() {
    // The main thread is one of the pool, as in the program.
    let pool = rayon::ThreadPoolBuilder::new().build();
    pool.expect("threads start").install(measure);
}

fn measure() {
    let level_max = std::env::args().find_map(|argument| argument.parse().ok()).unwrap_or(5);
    println!("{} threads\n", rayon::current_num_threads());
    println!("multigrid (Galerkin, direct coarsest level), gmres and auto by gauss-seidel");
    println!(
        "{:>2} {:>6} {:>12} {:>12} {:>12} {:>7} {:>11} {:>7} {:>7} {:>7} {:>7} {:>12} {:>11}",
        "l", "N", "gs", "mg", "setup", "mg/gs", "with setup", "cycles", "gmres", "passes", "auto", "by", "auto / best"
    );
    for level in 1..=level_max {
        lewis(level);
    }
    if !std::env::args().any(|argument| argument == "lewis") {
        cases();
    }
}

fn run(solver: &dyn Solver, system: &RadiositySystem, options: &SolveOptions) -> Solution {
    solver
        .solve(system, options, &mut |_| ControlFlow::Continue(()))
        .expect("solved")
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn lewis(level: u32) {
    let room = Room { level };
    let precision = if level < 6 { Precision::F64 } else { Precision::F32 };
    let factors = room.form_factors(precision).expect("a sound matrix");
    let system =
        RadiositySystem::new(&factors, room.areas(), room.reflectance(), room.exitance()).expect("a sound system");
    let hierarchy = Arc::new(room.hierarchy());
    let multigrid = Multigrid {
        hierarchy: Some(Arc::clone(&hierarchy)),
        prolongation: Prolongation::Injection,
        ..Multigrid::default()
    };
    let settings = SolverSettings {
        hierarchy: Some(hierarchy),
        ..SolverSettings::default()
    };
    let chooser = solver("auto", &settings).expect("known");
    let options = SolveOptions {
        tolerance: Tolerance::ResidualMax(TOLERANCE),
        ..SolveOptions::default()
    };
    // Small rooms run many times, so that the times are measurable.
    let repeats = 1 + 10_000_000 / room.n_patches().pow(2);
    let solvers: [&dyn Solver; 4] = [&GaussSeidel, &multigrid, &Gmres::default(), chooser.as_ref()];
    let (mut times, mut setups) = (vec![Vec::new(); 4], Vec::new());
    let (mut passes, mut choice) = ([0; 4], "");
    for _ in 0..N_ROUNDS {
        for (k, solver) in solvers.into_iter().enumerate() {
            let (mut total_s, mut setup_s) = (0.0, 0.0);
            for _ in 0..repeats {
                let solution = run(solver, &system, &options);
                total_s += solution.history.last().map_or(f64::NAN, |last| last.time_s);
                setup_s += solution.setup_s;
                passes[k] = solution.n_passes;
                choice = solution.choice.map_or(choice, |choice| choice.solver);
            }
            times[k].push(total_s / repeats as f64);
            if k == 1 {
                setups.push(setup_s / repeats as f64);
            }
        }
    }
    let [gs, mg, gmres, auto] = [0, 1, 2, 3].map(|k| median(times[k].clone()));
    let setup = median(setups);
    println!(
        "{level:>2} {:>6} {:9.3} ms {:9.3} ms {:9.3} ms {:7.3} {:11.3} {:>7} {:7.3} {:>7} {:7.3} {choice:>12} {:11.2}",
        room.n_patches(),
        1e3 * gs,
        1e3 * (mg - setup),
        1e3 * setup,
        (mg - setup) / gs,
        mg / gs,
        passes[1],
        gmres / gs,
        passes[2],
        auto / gs,
        auto / gs.min(mg).min(gmres),
    );
}

/// A sphere in a cube, as in the paper; the radius 1 belongs to cases E and F.
struct Case {
    factors: FormFactors,
    /// The reflectances for a mean of 1.
    pattern: Vec<f64>,
    exitance: Block,
    hierarchy: Arc<Hierarchy>,
}

impl Case {
    fn new(name: &str) -> Self {
        let scene = builtin::build(name, None).expect("known").scene;
        let mesh = Mesh::new(&scene, Subdivision::Uniform(1)).expect("a sound scene");
        let visibility = EmbreeVisibility::new(&scene).expect("Embree");
        let input = Input {
            scene: &scene,
            mesh: &mesh,
            visibility: &visibility,
            unoccluded: topology::is_convex_and_empty(&scene),
        };
        let method = RandomShooting {
            rays: RAYS,
            sequence: Sequence::Sobol,
            seed: 0,
        };
        let raw = method
            .compute(input, StorageChoice::default(), &Silent)
            .expect("computed")
            .factors;
        let symmetric = raw.symmetrised().expect("stored");
        let (factors, _) = symmetric
            .balanced(&vec![1.0; mesh.n_patches()], 1e-10, 500)
            .expect("balanced");
        let material = |k: usize| &scene.materials[mesh.patches[k].material.0 as usize];
        let (n, areas) = (mesh.n_patches(), mesh.areas());
        let power: f64 = (0..n).map(|k| areas[k] * material(k).reflectance[0]).sum();
        let mean = power / areas.iter().sum::<f64>();
        Self {
            factors,
            pattern: (0..n).map(|k| material(k).reflectance[0] / mean).collect(),
            exitance: Block::from_values((0..n).map(|k| material(k).exitance[0]).collect(), 1),
            hierarchy: Arc::new(Hierarchy::of_mesh(&mesh)),
        }
    }
}

fn cases() {
    println!("\nthe cases of Baranoski et al.: times by gauss-seidel, passes in brackets");
    let names: Vec<&str> = SOLVERS.iter().map(|entry| entry.name).collect();
    let head: Vec<String> = names.iter().map(|name| format!("{name:>23}")).collect();
    println!("   {}", head.concat());
    let rooms = [Case::new("sphere-room-r2"), Case::new("sphere-room-r1")];
    for (name, room, rho_avg) in [
        ('A', 0, 0.24),
        ('B', 0, 0.46),
        ('C', 0, 0.77),
        ('D', 0, 0.88),
        ('E', 1, 0.78),
        ('F', 1, 0.89),
    ] {
        let room = &rooms[room];
        let rho = room.pattern.iter().map(|rho| rho * rho_avg).collect();
        let areas = room.factors.areas().to_vec();
        let system = RadiositySystem::new(&room.factors, areas, Block::from_values(rho, 1), room.exitance.clone())
            .expect("a sound system");
        compare(name, room, &system, &names);
    }
}

fn compare(name: char, room: &Case, system: &RadiositySystem, names: &[&str]) {
    let settings = SolverSettings {
        hierarchy: Some(Arc::clone(&room.hierarchy)),
        ..SolverSettings::default()
    };
    let options = SolveOptions::default();
    let solvers: Vec<Box<dyn Solver>> = SOLVERS.iter().map(|entry| entry.build(&settings)).collect();
    let mut times = vec![Vec::new(); names.len()];
    let mut ends = vec![(0, StopReason::Converged); names.len()];
    for _ in 0..N_ROUNDS {
        for (k, solver) in solvers.iter().enumerate() {
            let solution = run(solver.as_ref(), system, &options);
            times[k].push(solution.history.last().map_or(f64::NAN, |last| last.time_s));
            ends[k] = (solution.n_passes, solution.stop_reason);
        }
    }
    let gauss_seidel = names.iter().position(|known| *known == "gauss-seidel").expect("known");
    let base = median(times[gauss_seidel].clone());
    let cell = |k: usize| {
        let (n_passes, reason) = ends[k];
        if reason == StopReason::Converged {
            let text = format!("{:.2} ({n_passes})", median(times[k].clone()) / base);
            format!("{text:>23}")
        } else {
            format!("{:>23}", reason.to_string())
        }
    };
    let converged = |k: &usize| ends[*k].1 == StopReason::Converged;
    let single = (0..names.len()).filter(|&k| names[k] != "auto").filter(converged);
    let best = single.min_by(|&a, &b| median(times[a].clone()).total_cmp(&median(times[b].clone())));
    let auto = names.iter().position(|known| *known == "auto").expect("known");
    let (best, auto) = (best.expect("gauss-seidel at least"), median(times[auto].clone()));
    println!(
        "{name}  {}   auto / best: {:.2} ({})",
        (0..names.len()).map(cell).collect::<Vec<_>>().concat(),
        auto / median(times[best].clone()),
        names[best]
    );
}
