//! Small scenes, solved.

use std::num::NonZeroU32;

use radiosity::geometry::DVec3;
use radiosity::geometry::rectangle::rectangle_exchange_area;
use radiosity::matrix::operator::Block;
use radiosity::mesh::{Mesh, PatchId, Subdivision};
use radiosity::progress::Silent;
use radiosity::render::{Attributes, Image, Outdoors, RenderInput, RenderSettings, UnfoldedView, View, render};
use radiosity::scene::{Corners, Face, Material, MaterialId, Scene, Surface, SurfaceId};
use radiosity::visibility::Visibility;

/// Collects faces; equal positions become one vertex.
#[derive(Default)]
pub(crate) struct Builder {
    pub(crate) scene: Scene,
}

impl Builder {
    fn vertex(&mut self, v: DVec3) -> u32 {
        let known = self.scene.vertices.iter().position(|&w| w == v);
        u32::try_from(known.unwrap_or_else(|| {
            self.scene.vertices.push(v);
            self.scene.vertices.len() - 1
        }))
        .unwrap()
    }

    pub(crate) fn surface(&mut self, name: &str) -> SurfaceId {
        self.scene.surfaces.push(Surface { name: name.to_owned() });
        SurfaceId(u32::try_from(self.scene.surfaces.len() - 1).unwrap())
    }

    pub(crate) fn material(&mut self, exitance: [f64; 3], reflectance: [f64; 3]) -> MaterialId {
        let name = format!("m{}", self.scene.materials.len());
        self.scene.materials.push(Material {
            name,
            reflectance,
            exitance,
        });
        MaterialId(u32::try_from(self.scene.materials.len() - 1).unwrap())
    }

    pub(crate) fn face(&mut self, surface: SurfaceId, material: MaterialId, corners: &[DVec3]) {
        let ids: Vec<u32> = corners.iter().map(|&v| self.vertex(v)).collect();
        let indices = match ids[..] {
            [a, b, c] => Corners::Triangle([a, b, c]),
            [a, b, c, d] => Corners::Quad([a, b, c, d]),
            _ => panic!("three or four corners"),
        };
        self.scene.faces.push(Face {
            corners: indices,
            surface,
            material,
            line: 0,
        });
    }
}

pub(crate) fn rectangle(c: DVec3, a: DVec3, b: DVec3) -> [DVec3; 4] {
    [c, c + a, c + a + b, c + b]
}

pub(crate) const WALLS: [&str; 6] = ["x0", "x1", "y0", "y1", "z0", "z1"];

/// The inward-facing walls x0, x1, y0, y1, z0, z1 of a box with one corner at the origin.
pub(crate) fn box_walls(size: DVec3) -> [[DVec3; 4]; 6] {
    let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
    [
        rectangle(DVec3::ZERO, y, z),
        rectangle(x, z, y),
        rectangle(DVec3::ZERO, z, x),
        rectangle(y, x, z),
        rectangle(DVec3::ZERO, x, y),
        rectangle(z, y, x),
    ]
}

/// A box with one exitance and one reflectance per wall.
pub(crate) fn box_scene(size: DVec3, exitance: [[f64; 3]; 6], reflectance: [[f64; 3]; 6]) -> Scene {
    let mut builder = Builder::default();
    for (k, wall) in box_walls(size).iter().enumerate() {
        let surface = builder.surface(WALLS[k]);
        let material = builder.material(exitance[k], reflectance[k]);
        builder.face(surface, material, wall);
    }
    builder.scene
}

/// The unit cube whose wall x0 emits and in which nothing reflects.
pub(crate) fn black_cube() -> Scene {
    let mut exitance = [[0.0; 3]; 6];
    exitance[0] = [1.0, 2.0, 0.5];
    box_scene(DVec3::ONE, exitance, [[0.0; 3]; 6])
}

/// The unit cube with coloured walls, two of which emit.
pub(crate) fn bright_cube() -> Scene {
    let mut exitance = [[0.0; 3]; 6];
    exitance[0] = [1.0, 2.0, 0.5];
    exitance[5] = [0.0, 0.25, 1.0];
    let reflectance = [0.0, 0.2, 0.4, 0.5, 0.7, 0.9].map(|rho| [rho, 0.5 * rho, 0.8 - 0.8 * rho]);
    box_scene(DVec3::ONE, exitance, reflectance)
}

/// What a picture needs of patches whose radiosity is all that counts, as where colours are flat: the irradiance is any.
pub(crate) fn flat_input<'a>(
    scene: &'a Scene,
    mesh: &'a Mesh,
    visibility: &'a dyn Visibility,
    radiosity: &'a Block,
) -> RenderInput<'a> {
    RenderInput {
        scene,
        mesh,
        visibility,
        radiosity,
        irradiance: radiosity,
        indirect_irradiance: None,
        error: None,
        outdoors: Outdoors::default(),
    }
}

/// A solution by fixed-point iteration with closed-form factors, for convex scenes of axis-aligned rectangles.
pub(crate) struct Solved {
    pub(crate) scene: Scene,
    pub(crate) mesh: Mesh,
    pub(crate) radiosity: Block,
    pub(crate) irradiance: Block,
    pub(crate) indirect: Block,
}

impl Solved {
    pub(crate) fn new(scene: Scene, n: u32) -> Self {
        let mesh = Mesh::new(&scene, Subdivision::Uniform(n)).unwrap();
        let n_patches = mesh.n_patches();
        let polygons: Vec<Vec<DVec3>> = (0..n_patches)
            .map(|i| mesh.polygon(PatchId(u32::try_from(i).unwrap())))
            .collect();
        let factors: Vec<Vec<f64>> = (0..n_patches)
            .map(|i| {
                let factor = |j: usize| rectangle_exchange_area(&polygons[i], &polygons[j]).unwrap();
                (0..n_patches).map(|j| factor(j) / mesh.patches[i].area).collect()
            })
            .collect();
        let material = |i: usize| &scene.materials[mesh.patches[i].material.0 as usize];
        let apply = |x: &Block| {
            let mut y = Block::zeros(n_patches, 3);
            for (i, row) in factors.iter().enumerate() {
                for (j, f) in row.iter().enumerate() {
                    for c in 0..3 {
                        y.row_mut(i)[c] += f * x.row(j)[c];
                    }
                }
            }
            y
        };
        let mut radiosity = Block::zeros(n_patches, 3);
        let mut irradiance = Block::zeros(n_patches, 3);
        for _ in 0..60 {
            for i in 0..n_patches {
                for c in 0..3 {
                    let (e, rho) = (material(i).exitance[c], material(i).reflectance[c]);
                    radiosity.row_mut(i)[c] = e + rho * irradiance.row(i)[c];
                }
            }
            irradiance = apply(&radiosity);
        }
        let mut reflected = radiosity.clone();
        for i in 0..n_patches {
            for c in 0..3 {
                reflected.row_mut(i)[c] -= material(i).exitance[c];
            }
        }
        let indirect = apply(&reflected);
        Self {
            scene,
            mesh,
            radiosity,
            irradiance,
            indirect,
        }
    }

    pub(crate) fn input<'a>(&'a self, visibility: &'a dyn Visibility) -> RenderInput<'a> {
        RenderInput {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility,
            radiosity: &self.radiosity,
            irradiance: &self.irradiance,
            indirect_irradiance: Some(&self.indirect),
            error: None,
            outdoors: Outdoors::default(),
        }
    }

    /// Renders the unfolded view.
    pub(crate) fn unfold(
        &self,
        visibility: &dyn Visibility,
        n_pixels: u32,
        settings: RenderSettings,
    ) -> (Image, Attributes) {
        let view = UnfoldedView::new(&self.scene, NonZeroU32::new(n_pixels).unwrap()).unwrap();
        let image = render(&self.input(visibility), &view, &settings, &Silent).unwrap();
        let solution = serde_json::json!({"method": "closed-form", "comment": "naïve"});
        let attributes = Attributes::new(&self.scene, view.description(), settings, visibility.offset(), solution);
        (image, attributes)
    }
}
