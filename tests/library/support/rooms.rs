//! Scenes made in memory, and every form-factor method to run on them.

use glam::{DQuat, DVec3};
use radiosity::form_factor::registry::{self, METHODS};
use radiosity::form_factor::{
    Computed, FormFactorError, FormFactorMethod, Input, MethodSettings, POINTS, RAYS, RESOLUTION,
};
use radiosity::matrix::{FormFactors, StorageChoice, SurfaceFormFactors};
use radiosity::mesh::{Mesh, MeshOptions, Subdivision};
use radiosity::progress::Silent;
use radiosity::scene::{Corners, Face, Material, MaterialId, Scene, Surface, SurfaceId, topology};
use radiosity::visibility::embree::EmbreeVisibility;

/// The corners of the six sides of a box, numbered by bits x y z.
const SIDES: [[usize; 4]; 6] = [
    [0, 2, 6, 4],
    [1, 5, 7, 3],
    [0, 4, 5, 1],
    [2, 3, 7, 6],
    [0, 1, 3, 2],
    [4, 6, 7, 5],
];

/// A scene under construction: every outline is a surface of its own.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shapes(Scene);

impl Shapes {
    pub(crate) fn face(&mut self, corners: &[DVec3]) {
        let scene = &mut self.0;
        let ids: Vec<u32> = corners
            .iter()
            .map(|corner| {
                let known = scene.vertices.iter().position(|v| v == corner);
                let index = known.unwrap_or_else(|| {
                    scene.vertices.push(*corner);
                    scene.vertices.len() - 1
                });
                u32::try_from(index).expect("a small scene")
            })
            .collect();
        let number = u32::try_from(scene.surfaces.len()).expect("a small scene");
        scene.surfaces.push(Surface {
            name: format!("face{number}"),
        });
        scene.faces.push(Face {
            corners: match *ids {
                [a, b, c] => Corners::Triangle([a, b, c]),
                [a, b, c, d] => Corners::Quad([a, b, c, d]),
                _ => panic!("three or four corners"),
            },
            surface: SurfaceId(number),
            material: MaterialId(0),
            line: 0,
        });
    }

    /// Adds a box with the corners `low` and `high`, turned about its middle, that faces inwards or outwards.
    pub(crate) fn cuboid(&mut self, low: DVec3, high: DVec3, turn: DQuat, inwards: bool) {
        let middle = 0.5 * (low + high);
        let corner = |k: usize| {
            let pick = DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2 & 1) as f64);
            middle + turn * (low + pick * (high - low) - middle)
        };
        for side in SIDES {
            let mut corners = side.map(corner);
            if inwards {
                // The numbers above wind counter-clockwise seen from the inside.
                corners.rotate_left(1);
            } else {
                corners.reverse();
            }
            self.face(&corners);
        }
    }

    /// Adds a ball of 20 · 4^`level` triangles with corners on the sphere, facing outwards.
    pub(crate) fn ball(&mut self, centre: DVec3, radius: f64, level: u32) {
        fn cut(corners: [DVec3; 3], level: u32, visit: &mut impl FnMut([DVec3; 3])) {
            let [a, b, c] = corners;
            if level == 0 {
                return visit(corners);
            }
            // A sum of two is the same from both sides of an edge.
            let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
            for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                cut(part, level - 1, visit);
            }
        }
        // The icosahedron's corners are (0, ±1, ±φ) and the same with the axes turned round.
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        let corner = |axis: usize, first: f64, second: f64| {
            let mut v = [0.0; 3];
            (v[(axis + 1) % 3], v[(axis + 2) % 3]) = (first, second * golden);
            DVec3::from_array(v).normalize()
        };
        let corners: Vec<DVec3> = (0..3)
            .flat_map(|axis| [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(a, b)| corner(axis, a, b)))
            .collect();
        // Neighbours are 63.4 degrees apart, all others more than 116.
        let near = |a: usize, b: usize| corners[a].dot(corners[b]) > 0.0;
        for a in 0..12 {
            for b in (a + 1..12).filter(|&b| near(a, b)) {
                for c in (b + 1..12).filter(|&c| near(a, c) && near(b, c)) {
                    let mut triangle = [a, b, c].map(|k| corners[k]);
                    if triangle[0].dot(triangle[1].cross(triangle[2])) < 0.0 {
                        triangle.swap(1, 2);
                    }
                    cut(triangle, level, &mut |part| {
                        self.face(&part.map(|v| centre + radius * v));
                    });
                }
            }
        }
    }

    pub(crate) fn scene(mut self) -> Scene {
        self.0.materials = vec![Material {
            name: "grey".to_owned(),
            reflectance: [0.5; 3],
            exitance: [0.0; 3],
        }];
        self.0
    }
}

/// Ground of 32 triangles in squares of `step` m, with a height for each of the 25 corners.
pub(crate) fn ground(step: f64, mut height: impl FnMut() -> f64) -> Scene {
    let heights: Vec<f64> = (0..25).map(|_| height()).collect();
    let at = |x: usize, y: usize| DVec3::new(step * x as f64, step * y as f64, heights[5 * x + y]);
    let mut shapes = Shapes::default();
    for (x, y) in (0..16).map(|k| (k / 4, k % 4)) {
        shapes.face(&[at(x, y), at(x + 1, y), at(x + 1, y + 1)]);
        shapes.face(&[at(x, y), at(x + 1, y + 1), at(x, y + 1)]);
    }
    shapes.scene()
}

/// Returns the scene turned, scaled, then moved.
pub(crate) fn moved(scene: &Scene, turn: DQuat, scale: f64, shift: DVec3) -> Scene {
    let mut scene = scene.clone();
    for vertex in &mut scene.vertices {
        *vertex = scale * (turn * *vertex) + shift;
    }
    scene
}

/// Settings that keep tests fast, and give every method something to do.
pub(crate) fn quick(name: &str, seed: u64) -> Box<dyn FormFactorMethod> {
    let settings = MethodSettings::default().seeded(seed);
    let settings = match name {
        "sr" | "sg5" | "sg10" => settings.with(&RAYS, 2000_u64),
        "sg" => settings.with(&RAYS, 2000_u64).with(&POINTS, 3_u64),
        "hemicube" => settings.with(&RESOLUTION, 32_u64).with(&POINTS, 2_u64),
        "pdm" | "gauss-lambert" | "contour" | "closed-form" => settings.with(&POINTS, 3_u64),
        _ => settings,
    };
    registry::method(name, &settings).expect("a method of the registry")
}

/// The names of all methods.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    METHODS.iter().map(|m| m.name)
}

/// Returns a scene as it comes back from a file with so many decimals.
pub(crate) fn with_decimals(places: usize, scene: &Scene) -> Scene {
    let loaded = written_as(|x| format!("{x:.places$}"), scene);
    assert_eq!(loaded.faces.len(), scene.faces.len());
    loaded
}

/// Returns a number as `%.6g` writes it, with so many digits.
pub(crate) fn with_digits(digits: usize, x: f64) -> String {
    let long = format!("{x:.*e}", digits - 1);
    let (mantissa, exponent) = long.split_once('e').expect("an exponent");
    let exponent: i32 = exponent.parse().expect("a number");
    let n = i32::try_from(digits).expect("few digits");
    let trimmed = |text: &str| {
        let is_fraction = text.contains('.');
        let short = if is_fraction {
            text.trim_end_matches('0').trim_end_matches('.')
        } else {
            text
        };
        short.to_owned()
    };
    if (-4..n).contains(&exponent) {
        let places = usize::try_from(n - 1 - exponent).expect("no less than none");
        trimmed(&format!("{x:.places$}"))
    } else {
        let sign = if exponent < 0 { '-' } else { '+' };
        format!("{}e{sign}{:02}", trimmed(mantissa), exponent.abs())
    }
}

/// Returns a scene as a file has it whose coordinates are written by `number`; surface k is face k.
pub(crate) fn written_as(number: impl Fn(f64) -> String, scene: &Scene) -> Scene {
    let vertices = scene
        .vertices
        .iter()
        .map(|v| format!("v {} {} {}\n", number(v.x), number(v.y), number(v.z)));
    let faces = scene.faces.iter().enumerate().map(|(k, face)| {
        let corners: Vec<String> = face.corners.as_slice().iter().map(|&v| (v + 1).to_string()).collect();
        format!("o face{k}\nf {}\n", corners.join(" "))
    });
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("scene.obj");
    std::fs::write(&path, vertices.chain(faces).collect::<String>()).expect("a file");
    radiosity::scene::load(&path).expect("a scene").scene
}

/// A scene with everything that methods need of it.
pub(crate) struct Prepared {
    pub(crate) scene: Scene,
    pub(crate) mesh: Mesh,
    visibility: EmbreeVisibility,
}

impl Prepared {
    pub(crate) fn new(scene: Scene, subdivide: u32) -> Self {
        Self::with(scene, Subdivision::Uniform(subdivide))
    }

    pub(crate) fn with(scene: Scene, options: impl Into<MeshOptions>) -> Self {
        let mesh = Mesh::new(&scene, options).expect("a mesh");
        let visibility = EmbreeVisibility::new(&scene).expect("Embree");
        Self {
            scene,
            mesh,
            visibility,
        }
    }

    pub(crate) fn try_compute(&self, method: &dyn FormFactorMethod) -> Result<Computed, FormFactorError> {
        method.compute(self.input(), StorageChoice::default(), &Silent)
    }

    pub(crate) fn input(&self) -> Input<'_> {
        Input {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            unoccluded: topology::is_convex_and_empty(&self.scene),
        }
    }

    pub(crate) fn compute(&self, method: &dyn FormFactorMethod) -> FormFactors {
        self.try_compute(method)
            .expect("the method can treat the scene")
            .factors
    }

    pub(crate) fn by_surface(&self, factors: &FormFactors) -> SurfaceFormFactors {
        let surfaces: Vec<u32> = self.mesh.patches.iter().map(|p| p.surface.0).collect();
        factors.surface_form_factors(&surfaces, self.scene.surfaces.len())
    }
}
