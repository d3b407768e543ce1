//! A dark room inside a lit one.

use std::fmt::Write as _;

use glam::{DMat3, DVec3};

/// A box between two corners, whose faces look outwards or inwards.
fn faces(low: DVec3, high: DVec3, inward: bool) -> Vec<[DVec3; 4]> {
    let corner = |k: usize| {
        let pick = |a: usize| if k >> a & 1 == 1 { high[a] } else { low[a] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    let outward = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let turn = |mut face: [usize; 4]| {
        if inward {
            face.reverse();
        }
        face.map(corner)
    };
    outward.map(turn).to_vec()
}

/// How the inner room is built.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SealedRoom {
    /// The thickness of its walls, m.
    pub(crate) thickness: f64,
    /// How all is turned.
    pub(crate) turned: DMat3,
    /// Whether its walls stand on the floor of the outer room, which is then its own too.
    pub(crate) on_floor: bool,
    /// Whether both sides of its walls are one surface.
    pub(crate) is_one_surface: bool,
    /// Into how many parts the edges of its walls are cut.
    pub(crate) n_parts: usize,
}

impl Default for SealedRoom {
    fn default() -> Self {
        Self {
            thickness: 0.0,
            turned: DMat3::IDENTITY,
            on_floor: false,
            is_one_surface: false,
            n_parts: 1,
        }
    }
}

impl SealedRoom {
    /// The inner room's outside.
    pub(crate) const LOW: DVec3 = DVec3::new(3.1, 3.3, 0.43);
    /// Its other corner.
    pub(crate) const HIGH: DVec3 = DVec3::new(5.1, 5.2, 2.1);

    /// Returns an OBJ file with the materials `wall` and `lamp`.
    pub(crate) fn obj(&self) -> String {
        let mut text = String::from("mtllib m.mtl\n");
        let mut n = 0;
        let mut add = |name: &str, material: &str, list: Vec<[DVec3; 4]>| {
            let _ = writeln!(text, "o {name}\nusemtl {material}");
            for face in list {
                for corner in face {
                    let v = self.turned * corner;
                    let _ = writeln!(text, "v {} {} {}", v.x, v.y, v.z);
                }
                let _ = writeln!(text, "f {} {} {} {}", n + 1, n + 2, n + 3, n + 4);
                n += 4;
            }
        };
        let size = DVec3::new(6.0, 6.0, 3.0);
        add("outer", "wall", faces(DVec3::ZERO, size, true));
        let lamp = [[2.0, 2.0], [2.0, 3.0], [3.0, 3.0], [3.0, 2.0]];
        add("lamp", "lamp", vec![lamp.map(|[x, y]| DVec3::new(x, y, 2.99))]);
        let mut low = Self::LOW;
        let mut inset = DVec3::splat(self.thickness);
        if self.on_floor {
            (low.z, inset.z) = (0.0, 0.0);
        }
        let is_wall = |face: &[DVec3; 4]| !self.on_floor || face.iter().any(|v| v.z > 0.0);
        let cut = |list: Vec<[DVec3; 4]>| -> Vec<[DVec3; 4]> {
            let parts = |[a, b, c, d]: [DVec3; 4]| {
                let parts = self.n_parts;
                let at = move |i: usize, j: usize| {
                    let (u, v) = (i as f64 / parts as f64, j as f64 / parts as f64);
                    a.lerp(b, u).lerp(d.lerp(c, u), v)
                };
                (0..parts * parts).map(move |k| {
                    let (i, j) = (k % parts, k / parts);
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
                })
            };
            list.into_iter().filter(is_wall).flat_map(parts).collect()
        };
        let [outside, inside] = if self.is_one_surface {
            ["shell", "shell"]
        } else {
            ["shell_out", "shell_in"]
        };
        add(outside, "wall", cut(faces(low, Self::HIGH, false)));
        let upper = Self::HIGH - DVec3::splat(self.thickness);
        add(inside, "wall", cut(faces(low + inset, upper, true)));
        text
    }

    /// Returns the materials.
    pub(crate) fn mtl() -> &'static str {
        "newmtl wall\nKd 0.8 0.8 0.8\nnewmtl lamp\nKd 0 0 0\nKe 100 100 100\n"
    }
}
