//! The systems for the solvers.

use super::rooms;
use glam::DVec3;

use crate::experiment::ExperimentError;
use crate::matrix::operator::{Block, LinearOperator, RowAccess};
use crate::matrix::{FormFactors, Layout, Precision, StorageChoice};
use crate::solver::{RadiositySystem, SolverError};

/// The required outcome of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Expected {
    /// A solution exists; a solver finds it, or reports that it did not.
    Solution,
    /// There is no meaningful solution: it has to be refused.
    Refusal,
}

/// One system.
pub(super) struct Case {
    pub(super) name: String,
    pub(super) about: String,
    pub(super) operator: Box<dyn LinearOperator>,
    pub(super) areas: Vec<f64>,
    pub(super) reflectance: Block,
    pub(super) exitance: Block,
    /// True if exitances may be negative.
    pub(super) signed: bool,
    pub(super) expected: Expected,
}

/// The patches along an edge of the cube: 216 in all.
const EDGE: u32 = 6;

/// The patches along an edge of the smaller cube of the Monte Carlo cases: 54 in all.
const SMALL_EDGE: u32 = 3;

/// An operator without patches.
struct Nothing;

impl LinearOperator for Nothing {
    fn n_rows(&self) -> usize {
        0
    }

    fn apply(&self, _x: &Block, _y: &mut Block) {}

    fn rows(&self) -> Option<&dyn RowAccess> {
        None
    }

    fn reciprocal_areas(&self) -> Option<&[f64]> {
        None
    }
}

impl Case {
    fn new(name: &str, about: impl Into<String>, room: FormFactors, rho: impl Fn(usize) -> f64) -> Self {
        let n = room.n_rows();
        let lit = n - n.div_ceil(10)..n;
        Self {
            name: name.to_owned(),
            about: about.into(),
            areas: room.areas().to_vec(),
            reflectance: Block::from_values((0..n).map(rho).collect(), 1),
            exitance: Block::from_values((0..n).map(|i| if lit.contains(&i) { 50.0 } else { 0.0 }).collect(), 1),
            operator: Box::new(room),
            signed: false,
            expected: Expected::Solution,
        }
    }

    /// Returns the system, or the error that refuses it.
    pub(super) fn system(&self) -> Result<RadiositySystem<'_>, SolverError> {
        let (areas, reflectance, exitance) = (self.areas.clone(), self.reflectance.clone(), self.exitance.clone());
        if self.signed {
            RadiositySystem::with_signed_exitance(&*self.operator, areas, reflectance, exitance)
        } else {
            RadiositySystem::new(&*self.operator, areas, reflectance, exitance)
        }
    }

    fn lit_by(mut self, exitance: impl Fn(usize) -> f64) -> Self {
        let n = self.areas.len();
        self.exitance = Block::from_values((0..n).map(exitance).collect(), 1);
        self
    }

    fn refused(mut self) -> Self {
        self.expected = Expected::Refusal;
        self
    }
}

/// Builds all cases; `seed` is that of the Monte Carlo noise.
pub(super) fn all(seed: u64) -> Result<Vec<Case>, ExperimentError> {
    let cube = cube_of(1.0, 1.0, StorageChoice::default())?;
    let small = rooms::form_factors(&rooms::cube(1.0, SMALL_EDGE), 1.0, StorageChoice::default())?;
    let mut cases = stiff(&cube);
    cases.extend(stiff_and_small()?);
    cases.extend(materials(&cube));
    cases.extend(wrong_row_sums()?);
    cases.extend(noisy(&small, seed)?);
    cases.extend(scales(&cube)?);
    cases.extend(shapes(&small)?);
    cases.extend(single_precision()?);
    Ok(cases)
}

fn cube_of(edge: f64, factor: f64, storage: StorageChoice) -> Result<FormFactors, ExperimentError> {
    rooms::form_factors(&rooms::cube(edge, EDGE), factor, storage)
}

fn stiff(cube: &FormFactors) -> Vec<Case> {
    let mut cases = Vec::new();
    for exponent in [1, 2, 3, 4, 6, 8, 10, 12] {
        let dark = 10_f64.powi(-exponent);
        let about = "cube, the same reflectance everywhere";
        cases.push(Case::new(
            &format!("1 − ρ = 1e-{exponent}"),
            about,
            cube.clone(),
            |_| 1.0 - dark,
        ));
    }
    let uneven = |i: usize| 1.0 - [1e-6, 0.3, 1e-9][i % 3];
    cases.push(Case::new(
        "ρ from 0.7 to 1 − 1e-9",
        "cube, patches in turn",
        cube.clone(),
        uneven,
    ));
    cases
}

/// Returns cases with sides of unequal size, one patch each: the residuals of sweeps rise before they fall, and oscillate.
fn stiff_and_small() -> Result<Vec<Case>, ExperimentError> {
    let sides = rooms::cuboid(DVec3::new(1.0, 1.5, 2.0), 1);
    let room = rooms::form_factors(&sides, 1.0, StorageChoice::default())?;
    let case = |exponent: i32| {
        let name = format!("six patches, 1 − ρ = 1e-{exponent}");
        let dark = 10_f64.powi(-exponent);
        Case::new(&name, "cuboid of 1 × 1.5 × 2, lit by its top", room.clone(), |_| {
            1.0 - dark
        })
        .lit_by(|i| if i == 5 { 1.0 } else { 0.0 })
    };
    Ok([1, 3, 4, 5].map(case).into())
}

fn materials(cube: &FormFactors) -> Vec<Case> {
    let mut cases = Vec::new();
    cases.push(Case::new("white and lit", "closed cube, ρ = 1", cube.clone(), |_| 1.0).refused());
    let balance = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let mut balanced = Case::new(
        "white and balanced",
        "closed cube, ρ = 1, Σ A E = 0",
        cube.clone(),
        |_| 1.0,
    )
    .lit_by(balance);
    balanced.signed = true;
    cases.push(balanced);
    cases.push(Case::new(
        "half black",
        "cube, ρ = 0 and 0.9 in turn",
        cube.clone(),
        |i| if i.is_multiple_of(2) { 0.0 } else { 0.9 },
    ));
    cases.push(Case::new("all black", "cube, ρ = 0", cube.clone(), |_| 0.0));
    let only_one = |i: usize| if i == 7 { 1.0 } else { 0.0 };
    cases.push(Case::new("one emitter", "cube, ρ = 0.8", cube.clone(), |_| 0.8).lit_by(only_one));
    cases
}

fn wrong_row_sums() -> Result<Vec<Case>, ExperimentError> {
    let mut cases = Vec::new();
    for (factor, rho, refused) in [
        (1.02, 0.95, false),
        (1.02, 0.99, true),
        (0.98, 0.95, false),
        (0.98, 0.99, false),
    ] {
        let name = format!("rows sum to {factor}, ρ = {rho}");
        let case = Case::new(
            &name,
            "cube, all form factors off by 2 %",
            cube_of(1.0, factor, StorageChoice::default())?,
            |_| rho,
        );
        cases.push(if refused { case.refused() } else { case });
    }
    Ok(cases)
}

fn noisy(small: &FormFactors, seed: u64) -> Result<Vec<Case>, ExperimentError> {
    let mut cases = Vec::new();
    for n_rays in [10, 100, 1000, 10_000, 100_000] {
        let noisy = rooms::shot(small, n_rays, seed)?;
        for rho in [0.95, 0.999] {
            let name = format!("{n_rays} rays, ρ = {rho}");
            cases.push(Case::new(&name, "small cube, shot, as it comes", noisy.clone(), |_| {
                rho
            }));
        }
        let targets = vec![1.0; noisy.n_rows()];
        let (mended, _) = noisy.symmetrised()?.balanced(&targets, 1e-10, 1000)?;
        cases.push(Case::new(
            &format!("{n_rays} rays, balanced, ρ = 0.999"),
            "small cube, shot, made symmetric",
            mended,
            |_| 0.999,
        ));
    }
    Ok(cases)
}

fn scales(cube: &FormFactors) -> Result<Vec<Case>, ExperimentError> {
    let mut cases = Vec::new();
    let areas = (0..100).map(|k| 10_f64.powf(-8.0 * f64::from(k) / 99.0)).collect();
    let spread = |i: usize| 0.2 + 0.75 * ((i * 37 % 100) as f64 / 100.0);
    cases.push(Case::new(
        "areas from 1e-8 to 1",
        "parts of a sphere",
        rooms::sphere(areas)?,
        spread,
    ));
    for edge in [1e-6, 1e6] {
        let name = format!("edge of {edge:e} m");
        cases.push(Case::new(
            &name,
            "cube, ρ = 0.9",
            cube_of(edge, 1.0, StorageChoice::default())?,
            |_| 0.9,
        ));
    }
    for light in [1e-30, 1e30] {
        let name = format!("exitance {light:e} W/m²");
        cases.push(
            Case::new(&name, "cube, ρ = 0.9", cube.clone(), |_| 0.9).lit_by(|i| if i > 200 { light } else { 0.0 }),
        );
    }
    Ok(cases)
}

fn shapes(small: &FormFactors) -> Result<Vec<Case>, ExperimentError> {
    let mut cases = Vec::new();
    let two = rooms::side_by_side(&[small, small])?;
    let rho_of_room = |i: usize| if i < 54 { 1.0 - 1e-6 } else { 0.5 };
    cases.push(
        Case::new("two rooms, one dark", "ρ = 0.9", two.clone(), |_| 0.9).lit_by(|i| if i < 20 { 1.0 } else { 0.0 }),
    );
    cases.push(
        Case::new("two rooms, both lit", "1 − ρ = 1e-6 and 0.5", two, rho_of_room)
            .lit_by(|i| if i.is_multiple_of(9) { 1.0 } else { 0.0 }),
    );
    cases.push(Case::new(
        "one patch",
        "F = 1, ρ = 0.9",
        rooms::sphere(vec![2.0])?,
        |_| 0.9,
    ));
    cases.push(Case {
        name: "no patch".to_owned(),
        about: "n = 0".to_owned(),
        operator: Box::new(Nothing),
        areas: Vec::new(),
        reflectance: Block::zeros(0, 1),
        exitance: Block::zeros(0, 1),
        signed: false,
        expected: Expected::Refusal,
    });
    for (gap, rho) in [(0.01, 0.9), (0.001, 1.0)] {
        let name = format!("plates at {gap} m, ρ = {rho}");
        let plates = rooms::form_factors(&rooms::plates(gap, 10), 1.0, StorageChoice::default())?;
        cases.push(Case::new(&name, "two unit squares of 10 × 10 patches", plates, |_| {
            rho
        }));
    }
    Ok(cases)
}

fn single_precision() -> Result<Vec<Case>, ExperimentError> {
    let mut cases = Vec::new();
    for dark in [0.1, 1e-4, 1e-6] {
        for layout in [Layout::Dense, Layout::Sparse] {
            let storage = StorageChoice {
                layout,
                precision: Precision::F32,
                ..StorageChoice::default()
            };
            let name = format!("f32, {layout:?}, 1 − ρ = {dark:e}").to_lowercase();
            cases.push(Case::new(&name, "cube", cube_of(1.0, 1.0, storage)?, |_| 1.0 - dark));
        }
    }
    Ok(cases)
}
