//! Heat: temperatures and fluxes against closed forms, their stated errors, and refusals.

mod crater;
mod enclosures;
mod patches;
mod points;
mod refused;
mod sun;
mod sun_path;

use std::f64::consts::TAU;

use glam::DVec3;
use radiosity::heat::{Boundary, SurfaceHeat};
use radiosity::mesh::Subdivision;
use radiosity::scene::{Material, Scene, SceneBuilder, SceneError};
use radiosity::workflow::{Context, FormFactorRequest, HeatStudy, Model, SolveRequest, Use, WorkflowError};

/// σ by CODATA 2018, on its own.
const SIGMA: f64 = 5.670_374_419e-8;

/// Returns a scene of surfaces, each with its faces.
fn scene(surfaces: &[(&str, Vec<Vec<DVec3>>)]) -> Scene {
    let mut builder = SceneBuilder::new();
    let plain = builder
        .material(Material {
            name: "plain".into(),
            reflectance: [0.5; 3],
            exitance: [0.0; 3],
        })
        .unwrap();
    for (name, faces) in surfaces {
        let id = builder.surface(*name).unwrap();
        let mut vertices = Vec::new();
        let mut corners = Vec::new();
        for face in faces {
            let first = u32::try_from(vertices.len()).unwrap();
            corners.push((0..).take(face.len()).map(|k: u32| first + k).collect::<Vec<_>>());
            vertices.extend(face.iter().map(DVec3::to_array));
        }
        builder.faces(&vertices, &corners, &[id], &[plain]).unwrap();
    }
    builder.build().unwrap().scene
}

/// Returns a rectangle that is spanned by two edges and faces along a × b.
fn rectangle(corner: [f64; 3], a: [f64; 3], b: [f64; 3]) -> Vec<DVec3> {
    let [corner, a, b] = [corner, a, b].map(DVec3::from_array);
    vec![corner, corner + a, corner + a + b, corner + b]
}

/// The inner sides of a box from the origin, each a surface: x0, x1, y0, y1, z0, z1.
fn inside([x, y, z]: [f64; 3]) -> Vec<(&'static str, Vec<Vec<DVec3>>)> {
    let (ex, ey, ez) = ([x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]);
    let origin = [0.0; 3];
    vec![
        ("x0", vec![rectangle(origin, ey, ez)]),
        ("x1", vec![rectangle(ex, ez, ey)]),
        ("y0", vec![rectangle(origin, ez, ex)]),
        ("y1", vec![rectangle(ey, ex, ez)]),
        ("z0", vec![rectangle(origin, ex, ey)]),
        ("z1", vec![rectangle(ez, ey, ex)]),
    ]
}

/// Returns an icosahedron of a radius about the origin, its triangles cut into four `level` times; it faces outwards, or inwards.
fn sphere(radius: f64, level: u32, inwards: bool) -> Vec<Vec<DVec3>> {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut corners = Vec::new();
    for [a, b] in [[1.0, golden], [1.0, -golden], [-1.0, golden], [-1.0, -golden]] {
        corners.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
    }
    let is_edge = |i: usize, j: usize| (corners[i].distance(corners[j]) - 2.0).abs() < 1e-9;
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if is_edge(i, j) && is_edge(j, k) && is_edge(i, k) {
                    let outer = [corners[i], corners[j], corners[k]];
                    let normal = (outer[1] - outer[0]).cross(outer[2] - outer[0]);
                    let is_outward = normal.dot(outer[0]) > 0.0;
                    triangles.push(if is_outward {
                        outer
                    } else {
                        [outer[0], outer[2], outer[1]]
                    });
                }
            }
        }
    }
    for _ in 0..level {
        let cut = |[a, b, c]: [DVec3; 3]| {
            let [ab, bc, ca] = [a + b, b + c, c + a].map(|v| 0.5 * v);
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(cut).collect();
        for corner in triangles.iter_mut().flatten() {
            *corner = corner.normalize();
        }
    }
    let face = |[a, b, c]: [DVec3; 3]| {
        let [a, b, c] = [a, b, c].map(|v| radius * v.normalize());
        if inwards { vec![a, c, b] } else { vec![a, b, c] }
    };
    triangles.into_iter().map(face).collect()
}

/// Reads boundary conditions for a scene.
fn boundary(text: &str, scene: &Scene) -> Result<Boundary, SceneError> {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("boundary.toml");
    std::fs::write(&file, text).unwrap();
    Boundary::load(&file, scene)
}

/// What a study found, with its warnings.
struct Found {
    study: HeatStudy,
    cx: Context,
}

fn try_heat(scene: &Scene, cut: u32, text: &str) -> Result<Found, WorkflowError> {
    let mut cx = Context::default();
    let boundary = boundary(text, scene).map_err(WorkflowError::Scene)?;
    let options = Subdivision::Uniform(cut).into();
    let mut model = Model::new(scene.clone(), "here", options, Use::Light, &mut cx)?;
    let request = SolveRequest::default();
    let factors = model.form_factors(&FormFactorRequest::default(), request.need(&cx)?, &mut cx)?;
    let study = model.heat(&factors, &boundary, &request, &mut cx)?;
    Ok(Found { study, cx })
}

/// Finds the heat of a scene, and holds it against what must be so of any: the balance is 0 within its error, and every check passes.
#[track_caller]
fn heat(scene: &Scene, cut: u32, text: &str) -> Found {
    let found = try_heat(scene, cut, text).unwrap_or_else(|error| panic!("{error}"));
    let balance = found.study.heat.balance;
    assert!(
        balance.energy_balance_w.abs() <= balance.energy_balance_w_error,
        "{balance:?}"
    );
    assert!(found.cx.audit.passed(), "{:?}", found.cx.warnings());
    found
}

impl Found {
    #[track_caller]
    fn surface(&self, name: &str) -> &SurfaceHeat {
        let surfaces = &self.study.heat.surfaces;
        surfaces.iter().find(|surface| surface.name == name).unwrap()
    }

    /// Returns a quantity of all patches.
    #[track_caller]
    fn patches(&self, name: &str) -> &[f64] {
        let all = &self.study.heat.patches;
        &all.iter().find(|(own, _)| *own == name).unwrap().1
    }
}

/// Panics unless a value is within its error of what it should be, and the error is at most `most`.
#[track_caller]
fn within(value: f64, error: f64, expected: f64, most: f64) {
    assert!(
        (value - expected).abs() <= error + 1e-13 * expected.abs() && error <= most,
        "{value} +- {error:e}, and not {expected}"
    );
}

/// Returns points on a circle of a radius at a height.
fn circle(radius: f64, height: f64, n: usize) -> impl Fn(usize) -> DVec3 {
    move |k| {
        let angle = TAU * (k % n) as f64 / n as f64;
        DVec3::new(radius * angle.cos(), radius * angle.sin(), height)
    }
}
