//! Generates meshes of the kinds that other programs write: curved, cluttered, or already cut into patches.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::DVec3;
use radiosity::scene::{Loaded, Material, MaterialId, SceneBuilder, SceneError, SurfaceId};

/// Returns the mesh of a name such as `city:8`, or `None` for an unknown kind.
///
/// - `cube:N`: the cube, each face N x N squares;
/// - `room:N`: `room-box`, each face cut into some N x N;
/// - `sphere:N`: a sphere of N x 2N facets in a box of 4 m, each wall 4 x 4;
/// - `globe:N`: a sphere of N x 2N facets in a room of six walls;
/// - `body:N`: an ellipsoid of N x 2N facets by itself;
/// - `height:N`: hills of 2 N² triangles;
/// - `city:N`: N x N houses on a ground, cut into faces of at most 10 m;
/// - `tree:N`: N loose leaves, two faces each, over a ground and beside a wall;
/// - `tubes:N`: three capped tubes of N sides in a room;
/// - `duct:N`: three tubes of N sides from end to end of a closed duct;
/// - `quads:N`: N quads, turned by chance, with six decimals as in a file;
/// - `gap:N`: two squares 10⁻ᴺ apart, with a wall between their halves.
pub(crate) fn made(name: &str) -> Option<Result<Loaded, SceneError>> {
    let (kind, n) = name.split_once(':')?;
    let n = n.parse().ok().filter(|n| *n > 0)?;
    let mut faces = Faces::default();
    match kind {
        "cube" => faces.room(DVec3::ZERO, DVec3::ONE, n),
        "room" => {
            faces.room(DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0), n);
            faces.block(DVec3::new(1.0, 1.5, 0.5), DVec3::new(2.2, 3.0, 1.7), n);
        }
        "sphere" => {
            faces.room(DVec3::splat(-2.0), DVec3::splat(2.0), 4);
            faces.ball(DVec3::ZERO, DVec3::ONE, n);
        }
        "globe" => {
            faces.room(DVec3::ZERO, DVec3::new(5.0, 4.0, 3.0), 1);
            faces.ball(DVec3::new(2.1, 1.7, 1.3), DVec3::splat(0.25), n);
        }
        "body" => faces.ball(DVec3::ZERO, DVec3::new(2.0, 1.4, 1.0), n),
        "height" => faces.hills(n),
        "city" => faces.city(n),
        "tree" => faces.tree(n),
        "tubes" => faces.tubes(n),
        "duct" => faces.duct(n),
        "quads" => faces.quads(n),
        "gap" => faces.gap(0.1_f64.powi(n.try_into().ok()?)),
        _ => return None,
    }
    Some(faces.build())
}

#[derive(Default)]
struct Faces {
    vertices: Vec<[f64; 3]>,
    known: HashMap<[u64; 3], u32>,
    corners: Vec<Vec<u32>>,
}

impl Faces {
    fn build(self) -> Result<Loaded, SceneError> {
        let mut builder = SceneBuilder::new();
        builder.surface("all")?;
        builder.material(Material {
            name: "grey".into(),
            reflectance: [0.5; 3],
            exitance: [0.0; 3],
        })?;
        builder.faces(&self.vertices, &self.corners, &[SurfaceId(0)], &[MaterialId(0)])?;
        builder.build()
    }

    /// Adds a face, without corners that repeat the previous one, as at a pole.
    fn face(&mut self, corners: &[DVec3]) {
        let mut face: Vec<u32> = corners.iter().map(|corner| self.vertex(*corner)).collect();
        face.dedup();
        if face.first() == face.last() {
            face.pop();
        }
        self.corners.push(face);
    }

    #[expect(clippy::cast_possible_truncation, reason = "no mesh here has so many vertices")]
    fn vertex(&mut self, at: DVec3) -> u32 {
        // Cells of 1e-11 m identify a corner, independent of its computation.
        let at = at.to_array().map(|x| (x * 1e11).round() / 1e11 + 0.0);
        *self.known.entry(at.map(f64::to_bits)).or_insert_with(|| {
            self.vertices.push(at);
            (self.vertices.len() - 1) as u32
        })
    }

    /// Adds a quad in n x m parts.
    fn grid(&mut self, [a, b, c, d]: [DVec3; 4], n: usize, m: usize) {
        let at = |i: usize, j: usize| {
            let (s, t) = (i as f64 / n as f64, j as f64 / m as f64);
            a.lerp(d, t).lerp(b.lerp(c, t), s)
        };
        for i in 0..n {
            for j in 0..m {
                self.face(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }

    /// Adds the six sides of a box, seen from the inside, each in n x n parts.
    fn room(&mut self, low: DVec3, high: DVec3, n: usize) {
        for quad in sides(low, high) {
            self.grid(quad, n, n);
        }
    }

    /// Adds the six sides of a box, seen from the outside, each in n x n parts.
    fn block(&mut self, low: DVec3, high: DVec3, n: usize) {
        for [a, b, c, d] in sides(low, high) {
            self.grid([a, d, c, b], n, n);
        }
    }

    /// Adds an ellipsoid of n x 2n facets.
    fn ball(&mut self, centre: DVec3, radii: DVec3, n: usize) {
        let at = |i: usize, j: usize| {
            let (down, around) = (PI * i as f64 / n as f64, TAU * (j % (2 * n)) as f64 / (2 * n) as f64);
            centre + radii * DVec3::new(down.sin() * around.cos(), down.sin() * around.sin(), -down.cos())
        };
        for i in 0..n {
            for j in 0..2 * n {
                self.face(&[at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
    }

    /// Adds a height field of 100 m with waves of five lengths.
    fn hills(&mut self, n: usize) {
        let mut random = Random(1);
        let waves: Vec<[f64; 4]> = (1..=5)
            .flat_map(|k| [f64::from(1 << k); 4])
            .map(|waves| {
                let (turn, phase) = (random.between(0.0, TAU), random.between(0.0, TAU));
                [18.0 / waves, PI * waves * turn.cos(), PI * waves * turn.sin(), phase]
            })
            .collect();
        let at = |i: usize, j: usize| {
            let (x, y) = (i as f64 / n as f64, j as f64 / n as f64);
            let z: f64 = waves
                .iter()
                .map(|[a, kx, ky, phase]| a * (kx * x + ky * y + phase).cos())
                .sum();
            DVec3::new(100.0 * x, 100.0 * y, z)
        };
        for i in 0..n {
            for j in 0..n {
                self.face(&[at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                self.face(&[at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }

    /// Adds houses of 5 to 32 m, one every 40 m, and the ground between them.
    fn city(&mut self, n: usize) {
        let mut random = Random(1);
        let mut spans = || -> Vec<[f64; 2]> {
            let from = (0..n).map(|k| 40.0 * k as f64);
            from.map(|from| [from + random.between(5.0, 10.0), from + random.between(26.0, 34.0)])
                .collect()
        };
        let (along_x, along_y) = (spans(), spans());
        let end = 40.0 * n as f64;
        let gaps = |houses: &[[f64; 2]]| -> Vec<[f64; 2]> {
            let lines: Vec<f64> = [0.0]
                .into_iter()
                .chain(houses.iter().flatten().copied())
                .chain([end])
                .collect();
            lines.windows(2).map(|pair| [pair[0], pair[1]]).collect()
        };
        // No side is longer than 40 m.
        let n_parts = |length: f64| {
            (1_usize..4)
                .find(|&parts| length <= 10.0 * parts as f64 + 1e-9)
                .unwrap_or(4)
        };
        for [x0, x1] in gaps(&along_x) {
            for [y0, y1] in gaps(&along_y) {
                let is_house = along_x.contains(&[x0, x1]) && along_y.contains(&[y0, y1]);
                let height = if is_house {
                    random.of(&[5.0, 8.0, 11.0, 14.0, 20.0, 32.0])
                } else {
                    0.0
                };
                let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
                let at = |k: usize, z: f64| DVec3::new(corners[k % 4][0], corners[k % 4][1], z);
                self.grid([0, 1, 2, 3].map(|k| at(k, height)), n_parts(x1 - x0), n_parts(y1 - y0));
                if is_house {
                    for k in 0..4 {
                        let wall = [at(k, 0.0), at(k + 1, 0.0), at(k + 1, height), at(k, height)];
                        self.grid(wall, n_parts(wall[0].distance(wall[1])), n_parts(height));
                    }
                }
            }
        }
    }

    fn tree(&mut self, n: usize) {
        let corner = |x: f64, y: f64, z: f64| DVec3::new(6.0 * x, 6.0 * y, 6.0 * z);
        self.face(&[
            corner(-1.0, -1.0, 0.0),
            corner(1.0, -1.0, 0.0),
            corner(1.0, 1.0, 0.0),
            corner(-1.0, 1.0, 0.0),
        ]);
        self.face(&[
            corner(1.0, -1.0, 0.0),
            corner(1.0, -1.0, 1.0),
            corner(1.0, 1.0, 1.0),
            corner(1.0, 1.0, 0.0),
        ]);
        let mut random = Random(1);
        for _ in 0..n {
            let middle =
                DVec3::new(0.0, 0.0, 3.2) + 1.8 * random.between(0.2, 1.0) * random.normal().normalize_or_zero();
            let mut leaf = [(); 3].map(|()| middle + 0.25 * random.normal());
            self.face(&leaf);
            leaf.reverse();
            self.face(&leaf);
        }
    }

    fn tubes(&mut self, n: usize) {
        for [x, y] in [[-1.2, -0.9], [1.3, -0.7], [0.1, 1.2]] {
            let [mut low, high] = self.tube(DVec3::new(x, y, 0.4), 0.7, 3.2, n);
            low.reverse();
            self.face(&low);
            self.face(&high);
        }
        self.room(DVec3::new(-3.0, -3.0, 0.0), DVec3::new(3.0, 3.0, 4.0), 1);
    }

    fn duct(&mut self, n: usize) {
        for [x, y] in [[0.0, 0.0], [1.6, 0.0], [0.8, 1.4]] {
            self.tube(DVec3::new(x, y, 0.0), 0.5, 4.0, n);
        }
        self.room(DVec3::new(-3.0, -3.0, 0.0), DVec3::new(3.0, 3.0, 4.0), 1);
    }

    /// Adds the upright sides of a tube, and returns its lower and upper ring.
    fn tube(&mut self, foot: DVec3, radius: f64, height: f64, n: usize) -> [Vec<DVec3>; 2] {
        let ring = |z: f64| -> Vec<DVec3> {
            let angle = |k: usize| TAU * (k as f64 + 0.3) / n as f64;
            (0..n)
                .map(|k| foot + DVec3::new(radius * angle(k).cos(), radius * angle(k).sin(), z))
                .collect()
        };
        let (low, high) = (ring(0.0), ring(height));
        for k in 0..n {
            let next = (k + 1) % n;
            self.face(&[low[k], low[next], high[next], high[k]]);
        }
        [low, high]
    }

    fn quads(&mut self, n: usize) {
        let mut random = Random(1);
        for _ in 0..n {
            let middle = 0.2 * random.normal();
            let along = random.normal().normalize_or_zero();
            let across = along.cross(random.normal()).normalize_or_zero();
            let (a, b) = (random.between(0.3, 1.0) * along, random.between(0.3, 1.0) * across);
            let corners = [a + b, b - a, -a - b, a - b].map(|v| ((middle + v) * 1e6).round() / 1e6);
            self.face(&corners);
        }
    }

    fn gap(&mut self, width: f64) {
        let square = |z: f64| [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(x, y, z));
        let [a, b, c, d] = square(width);
        self.face(&square(0.0));
        self.face(&[a, d, c, b]);
        self.face(&[(0.0, 0.0), (1.0, 0.0), (1.0, width), (0.0, width)].map(|(y, z)| DVec3::new(0.3, y, z)));
    }
}

/// Returns the sides of a box, each counter-clockwise from the inside.
fn sides(low: DVec3, high: DVec3) -> [[DVec3; 4]; 6] {
    let at = |k: usize| {
        let pick = |axis: usize| if k >> axis & 1 == 1 { high[axis] } else { low[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    [
        [0, 2, 6, 4],
        [1, 5, 7, 3],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 1, 3, 2],
        [4, 6, 7, 5],
    ]
    .map(|side| side.map(at))
}

/// Random numbers that are the same on every machine: a linear congruential generator of 64 bits (Knuth's MMIX).
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn of(&mut self, values: &[f64]) -> f64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "an index below the length"
        )]
        let index = self.between(0.0, values.len() as f64) as usize;
        values[index]
    }

    /// Returns three independent normal deviates (Box and Muller).
    fn normal(&mut self) -> DVec3 {
        DVec3::from_array([(); 3].map(|()| {
            let (u, v) = (self.between(0.0, 1.0), self.between(0.0, TAU));
            (-2.0 * (1.0 - u).ln()).sqrt() * v.cos()
        }))
    }
}
