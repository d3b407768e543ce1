//! The forecast of the next coarser mesh's solution from a mesh, against that solution.

use std::ops::ControlFlow;

use radiosity::form_factor::ExactMethod;
use radiosity::matrix::operator::Block;
use radiosity::mesh::Hierarchy;
use radiosity::scene::builtin;
use radiosity::solver::{Coarsened, Solution, coarsened};

use crate::support::rooms::Prepared;
use crate::support::solving::{by_name, l2, run, system};

/// A room with a box in it and patches of N parts an edge, solved: reflectances differ by channel, and the ceiling shines.
fn solved(n: u32, reflectance: [f64; 2]) -> (Prepared, Solution, Option<Coarsened>) {
    let prepared = Prepared::new(builtin::build("room-box", None).unwrap().scene, n);
    let patches = &prepared.mesh.patches;
    let rho = Block::from_values(patches.iter().flat_map(|_| reflectance).collect(), 2);
    let is_lit = |surface: u32| prepared.scene.surfaces[surface as usize].name == "room_z1";
    let shines = |p: &radiosity::mesh::Patch| f64::from(u8::from(is_lit(p.surface.0)));
    let exitance = Block::from_values(patches.iter().flat_map(|p| [shines(p), 3.0 * shines(p)]).collect(), 2);
    let factors = prepared.compute(&ExactMethod::default());
    let solution = run(by_name("gauss-seidel"), &system(&factors, &rho, &exitance), &l2(1e-10));
    let hierarchy = Hierarchy::of_mesh(&prepared.mesh);
    let go_on = || ControlFlow::Continue(());
    let coarse = coarsened(&factors, factors.areas(), &hierarchy, &rho, &solution, go_on).unwrap();
    (prepared, solution, coarse)
}

/// Returns the means over surfaces of each channel.
fn surface_means(prepared: &Prepared, per_patch: &Block) -> Vec<[f64; 2]> {
    let mut means = vec![[0.0; 2]; prepared.scene.surfaces.len()];
    let mut areas = vec![0.0; means.len()];
    for (i, patch) in prepared.mesh.patches.iter().enumerate() {
        let k = patch.surface.0 as usize;
        areas[k] += patch.area;
        for (sum, value) in means[k].iter_mut().zip(per_patch.row(i)) {
            *sum += patch.area * value;
        }
    }
    let of_area = means.iter().zip(areas);
    of_area.map(|(sums, area)| sums.map(|sum| sum / area)).collect()
}

#[test]
fn a_coarser_mesh_gives_what_was_foretold() {
    let reflectance = [0.5, 0.8];
    for n in [6, 10] {
        let (fine, solution, coarse) = solved(n, reflectance);
        let coarse = coarse.unwrap();
        let (rough, its_solution, _) = solved(n / 2, reflectance);
        assert_eq!(coarse.n_patches, rough.mesh.n_patches());
        let foretold = surface_means(&fine, &coarse.change);
        let [before, after] = [
            surface_means(&fine, &solution.radiosity),
            surface_means(&rough, &its_solution.radiosity),
        ];
        let changes = before.iter().zip(&after).map(|(b, a)| [a[0] - b[0], a[1] - b[1]]);
        let pairs: Vec<(f64, f64)> = changes
            .zip(&foretold)
            .flat_map(|(a, f)| [(a[0], f[0]), (a[1], f[1])])
            .collect();
        let size = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(|pair| of(pair).powi(2)).sum::<f64>().sqrt();
        let (change, miss) = (size(&|pair| pair.0), size(&|pair| pair.0 - pair.1));
        assert!(change > 1e-3 && miss < 0.1 * change, "{n}: {change} {miss}");
    }
}

#[test]
fn a_mesh_of_whole_walls_foretells_nothing() {
    assert_eq!(solved(1, [0.5, 0.8]).2, None);
}

#[test]
fn without_reflection_no_mesh_changes_anything() {
    let coarse = solved(4, [0.0, 0.0]).2.unwrap();
    assert!(coarse.change.values().iter().all(|d| d.abs() <= 0.0));
    assert!(coarse.spread.values().iter().all(|b| b.abs() < 1e-12));
}
