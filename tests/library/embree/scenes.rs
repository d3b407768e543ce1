//! Scenes and random numbers for tests and benchmarks of visibility.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use radiosity::scene::{Corners, Face, MaterialId, Scene, SurfaceId};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// Random numbers that are the same in every run.
pub(crate) struct Random(Pcg64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(seed))
    }

    /// A number in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A point in the cube from 0 to 1.
    pub(crate) fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// A unit vector, all directions alike.
    pub(crate) fn direction(&mut self) -> DVec3 {
        let (z, phi) = (self.between(-1.0, 1.0), self.between(0.0, TAU));
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * phi.cos(), r * phi.sin(), z)
    }

    pub(crate) fn motion(&mut self) -> Motion {
        Motion {
            rotation: DQuat::from_axis_angle(self.direction(), self.between(0.0, TAU)),
            translation: 5.0 * self.direction(),
        }
    }
}

/// A rigid motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    pub(crate) rotation: DQuat,
    pub(crate) translation: DVec3,
}

impl Motion {
    pub(crate) const NONE: Self = Self {
        rotation: DQuat::IDENTITY,
        translation: DVec3::ZERO,
    };

    pub(crate) fn point(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.translation
    }

    pub(crate) fn scene(&self, mut scene: Scene) -> Scene {
        for v in &mut scene.vertices {
            *v = self.point(*v);
        }
        scene
    }
}

/// Gathers faces; corners at bit-identical positions become one vertex.
#[derive(Default)]
pub(crate) struct Builder {
    scene: Scene,
    known: HashMap<[u64; 3], u32>,
}

impl Builder {
    fn vertex(&mut self, position: DVec3) -> u32 {
        // Adding zero makes -0 the same as 0.
        let key = (position + DVec3::ZERO).to_array().map(f64::to_bits);
        let vertices = &mut self.scene.vertices;
        *self.known.entry(key).or_insert_with(|| {
            vertices.push(position);
            u32::try_from(vertices.len() - 1).expect("a test scene is small")
        })
    }

    pub(crate) fn face(&mut self, corners: &[DVec3]) {
        let corners: Vec<u32> = corners.iter().map(|&v| self.vertex(v)).collect();
        self.scene.faces.push(Face {
            corners: match *corners {
                [a, b, c] => Corners::Triangle([a, b, c]),
                [a, b, c, d] => Corners::Quad([a, b, c, d]),
                _ => panic!("a face has three or four corners"),
            },
            surface: SurfaceId(0),
            material: MaterialId(0),
            line: 0,
        });
    }

    pub(crate) fn finish(self) -> Scene {
        self.scene
    }
}

/// Random triangles, and convex quads on ellipses, about a tenth of the unit cube in size.
pub(crate) fn soup(n: usize, quads: bool, random: &mut Random) -> Scene {
    let mut builder = Builder::default();
    for i in 0..n {
        let centre = random.point();
        let (a, b) = (random.direction(), random.direction());
        let (a, b) = (
            a * random.between(0.05, 0.2),
            a.cross(b).normalize() * random.between(0.05, 0.2),
        );
        let n_corners = if quads && i % 2 == 1 { 4 } else { 3 };
        let corners: Vec<DVec3> = (0..n_corners)
            .map(|k| (f64::from(k) + random.between(0.0, 0.7)) * TAU / f64::from(n_corners))
            .map(|angle| centre + angle.cos() * a + angle.sin() * b)
            .collect();
        builder.face(&corners);
    }
    builder.finish()
}

/// The side of a box, from 0 to 1 along each axis, that lies at `at` on `axis`: its point (u, v), with u × v pointing inwards.
fn on_wall(axis: usize, at: f64, u: f64, v: f64) -> DVec3 {
    let (u, v) = if at > 0.5 { (v, u) } else { (u, v) };
    let mut p = DVec3::ZERO;
    p[axis] = at;
    p[(axis + 1) % 3] = u;
    p[(axis + 2) % 3] = v;
    p
}

/// Adds the six walls of the unit box, each in n × n cells that face inwards: quads and pairs of triangles by turns, or triangles only.
fn add_room(builder: &mut Builder, n: u32, quads: bool) {
    for wall in 0..6 {
        for cell in 0..n * n {
            let (i, j) = (cell / n, cell % n);
            let at = |di: u32, dj: u32| {
                on_wall(
                    wall / 2,
                    (wall % 2) as f64,
                    f64::from(i + di) / f64::from(n),
                    f64::from(j + dj) / f64::from(n),
                )
            };
            let corners = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            if quads && (i + j) % 2 == 0 {
                builder.face(&corners);
            } else {
                builder.face(&corners[..3]);
                builder.face(&[corners[0], corners[2], corners[3]]);
            }
        }
    }
}

/// The unit box, closed, seen from within; n × n cells a wall.
pub(crate) fn room(n: u32) -> Scene {
    let mut builder = Builder::default();
    add_room(&mut builder, n, true);
    builder.finish()
}

/// A closed room with a sphere in it: 14,288 triangles.
pub(crate) fn room_and_sphere() -> Scene {
    const LONGITUDES: u32 = 80;
    const LATITUDES: u32 = 90;
    let mut builder = Builder::default();
    add_room(&mut builder, 2, false);
    let at = |i: u32, j: u32| {
        let phi = TAU * f64::from(i % LONGITUDES) / f64::from(LONGITUDES);
        let pole = j == 0 || j == LATITUDES;
        let theta = PI * f64::from(j) / f64::from(LATITUDES);
        let r = if pole { 0.0 } else { theta.sin() };
        DVec3::new(0.5, 0.45, 0.4) + 0.25 * DVec3::new(r * phi.cos(), r * phi.sin(), theta.cos())
    };
    for i in 0..LONGITUDES {
        for j in 0..LATITUDES {
            if j > 0 {
                builder.face(&[at(i, j), at(i, j + 1), at(i + 1, j)]);
            }
            if j + 1 < LATITUDES {
                builder.face(&[at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
    }
    builder.finish()
}
