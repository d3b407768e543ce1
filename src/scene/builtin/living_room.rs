//! A living room: shelves full of books, table and chairs, sofas, lamps and a window; more than 600 objects.
//!
//! Made for `radiosity`, at the scale of the room of [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002), whose data were never published:
//! 6.28 × 6.28 × 3.78 m, 314 : 314 : 189. z is up. Things that stand on something have no bottom.

use glam::DVec3;

use super::{Assembly, box_sides};
use crate::scene::{Camera, MaterialId, SceneError};

/// 6.28 has nothing to do with a circle: it is 314 voxels of 2 cm.
#[expect(clippy::approx_constant, reason = "a length, not 2 π")]
const ROOM: DVec3 = DVec3::new(6.28, 6.28, 3.78);

/// Thickness of the boards of a shelf.
const BOARD: f64 = 0.04;
const SHELF_DEPTH: f64 = 0.36;
const SHELF_WIDTH: f64 = 0.88;
const SHELF_HEIGHT: f64 = 2.96;
const N_BOARDS: u32 = 8;

/// A turn about the vertical by an angle with a rational cosine and sine: the same bits everywhere.
#[derive(Clone, Copy)]
struct Turn {
    centre: DVec3,
    cos: f64,
    sin: f64,
}

impl Turn {
    fn none() -> Self {
        Self {
            centre: DVec3::ZERO,
            cos: 1.0,
            sin: 0.0,
        }
    }

    fn apply(self, v: DVec3) -> DVec3 {
        let d = v - self.centre;
        self.centre + DVec3::new(self.cos * d.x - self.sin * d.y, self.sin * d.x + self.cos * d.y, d.z)
    }
}

struct Materials {
    wood: MaterialId,
    dark_wood: MaterialId,
    cloth: MaterialId,
    steel: MaterialId,
    spines: [MaterialId; 6],
}

pub(super) fn build(assembly: &mut Assembly, _level: u32) -> Result<Option<Camera>, SceneError> {
    room(assembly)?;
    let materials = Materials {
        wood: assembly.material("wood", [0.55, 0.38, 0.22], [0.0; 3])?,
        dark_wood: assembly.material("dark_wood", [0.28, 0.17, 0.1], [0.0; 3])?,
        cloth: assembly.material("cloth", [0.3, 0.36, 0.5], [0.0; 3])?,
        steel: assembly.grey("steel", 0.5, 0.0)?,
        spines: [
            assembly.material("spine_red", [0.55, 0.12, 0.1], [0.0; 3])?,
            assembly.material("spine_green", [0.15, 0.4, 0.18], [0.0; 3])?,
            assembly.material("spine_blue", [0.12, 0.2, 0.5], [0.0; 3])?,
            assembly.material("spine_ochre", [0.62, 0.45, 0.15], [0.0; 3])?,
            assembly.material("spine_grey", [0.35; 3], [0.0; 3])?,
            assembly.material("spine_white", [0.75, 0.73, 0.68], [0.0; 3])?,
        ],
    };
    let mut number = 0;
    for k in 0..6_u32 {
        // Along the wall x0, backs to it.
        let low = DVec3::new(0.06, 0.4 + 0.94 * f64::from(k), 0.0);
        shelf(
            assembly,
            &materials,
            &format!("shelf_{}", k + 1),
            low,
            false,
            &mut number,
        )?;
    }
    for k in 0..4_u32 {
        // Along the wall y1.
        let low = DVec3::new(1.4 + 0.94 * f64::from(k), ROOM.y - 0.06 - SHELF_DEPTH, 0.0);
        shelf(
            assembly,
            &materials,
            &format!("shelf_{}", k + 7),
            low,
            true,
            &mut number,
        )?;
    }
    dining(assembly, &materials)?;
    sofas(assembly, &materials)?;
    lamps(assembly, &materials)?;
    let camera = Camera::new(
        DVec3::new(5.7, 0.5, 1.75),
        DVec3::new(-0.72, 0.75, -0.16),
        DVec3::Z,
        68.0,
    )?;
    Ok(Some(camera.with_image_size(Some(960), Some(720))))
}

/// Walls, and a window in the wall x1: a ring of four quads around it, so that no faces overlap.
fn room(assembly: &mut Assembly) -> Result<(), SceneError> {
    let plaster = assembly.material("plaster", [0.78, 0.76, 0.71], [0.0; 3])?;
    let parquet = assembly.material("parquet", [0.5, 0.35, 0.2], [0.0; 3])?;
    let daylight = assembly.material("daylight", [0.1; 3], [9.0, 10.5, 12.0])?;
    let [x0, x1, y0, y1, z0, z1] = box_sides(DVec3::ZERO, ROOM);
    assembly.surface_of("wall_x0", plaster, [x0])?;
    let at = |y: f64, z: f64| DVec3::new(ROOM.x, y, z);
    let window = [at(1.3, 0.9), at(1.3, 2.7), at(4.1, 2.7), at(4.1, 0.9)];
    let ring = [0, 1, 2, 3].map(|k| {
        let next = (k + 1) % 4;
        [x1[k], x1[next], window[next], window[k]]
    });
    assembly.surface_of("wall_x1", plaster, ring)?;
    assembly.surface_of("window", daylight, [window])?;
    assembly.surface_of("wall_y0", plaster, [y0])?;
    assembly.surface_of("wall_y1", plaster, [y1])?;
    assembly.surface_of("floor", parquet, [z0])?;
    assembly.surface_of("ceiling", plaster, [z1])
}

/// Adds a box, turned, with outward normals; without its bottom if it stands on something.
fn solid(
    assembly: &mut Assembly,
    name: &str,
    material: MaterialId,
    boxes: &[(DVec3, DVec3)],
    turn: Turn,
    stands: bool,
) -> Result<(), SceneError> {
    let surface = assembly.surface(name)?;
    for &(low, size) in boxes {
        for (k, [a, b, c, d]) in box_sides(low, low + size).into_iter().enumerate() {
            if !(stands && k == 4) {
                assembly.face([a, d, c, b].map(|v| turn.apply(v)), surface, material)?;
            }
        }
    }
    Ok(())
}

/// Adds a shelf and its books; its width runs along x if `across`, else along y.
fn shelf(
    assembly: &mut Assembly,
    materials: &Materials,
    name: &str,
    low: DVec3,
    across: bool,
    number: &mut u32,
) -> Result<(), SceneError> {
    let place = |along: f64, depth: f64, height: f64| {
        // A shelf along y opens towards +x, one along x towards −y.
        if across {
            low + DVec3::new(along, SHELF_DEPTH - depth, height)
        } else {
            low + DVec3::new(depth, along, height)
        }
    };
    let boxed = |along: [f64; 2], depth: [f64; 2], height: [f64; 2]| {
        let (a, b) = (
            place(along[0], depth[0], height[0]),
            place(along[1], depth[1], height[1]),
        );
        (a.min(b), (a - b).abs())
    };
    let full = [0.0, SHELF_DEPTH];
    let sides = [
        boxed([0.0, BOARD], full, [0.0, SHELF_HEIGHT]),
        boxed([SHELF_WIDTH - BOARD, SHELF_WIDTH], full, [0.0, SHELF_HEIGHT]),
    ];
    solid(
        assembly,
        &format!("{name}_sides"),
        materials.wood,
        &sides,
        Turn::none(),
        true,
    )?;
    let pitch = (SHELF_HEIGHT - BOARD - 0.08) / f64::from(N_BOARDS - 1);
    for board in 0..N_BOARDS {
        let base = 0.08 + pitch * f64::from(board);
        // The boards lie between the sides, and do not touch them: a gap is narrower than a shadow.
        let plank = boxed([BOARD + 0.002, SHELF_WIDTH - BOARD - 0.002], full, [base, base + BOARD]);
        solid(
            assembly,
            &format!("{name}_board_{}", board + 1),
            materials.wood,
            &[plank],
            Turn::none(),
            false,
        )?;
        let mut along = BOARD + 0.05;
        // Nothing stands on the top board.
        let fits = |end: f64| board + 1 < N_BOARDS && end <= SHELF_WIDTH - BOARD - 0.04;
        loop {
            let kind = scrambled(*number);
            let width = 0.04 + 0.01 * f64::from(kind % 4);
            let height = 0.2 + 0.02 * f64::from(kind / 4 % 5);
            let depth = 0.18 + 0.02 * f64::from(kind / 20 % 4);
            if !fits(along + width) {
                break;
            }
            *number += 1;
            let top = base + BOARD;
            let book = boxed([along, along + width], [0.08, 0.08 + depth], [top, top + height]);
            let material = materials.spines[(kind / 80 % 6) as usize];
            solid(
                assembly,
                &format!("book_{number}"),
                material,
                &[book],
                Turn::none(),
                true,
            )?;
            along += width + 0.03 + 0.01 * f64::from(kind / 480 % 3);
        }
    }
    Ok(())
}

/// Returns numbers that look random, the same everywhere.
fn scrambled(n: u32) -> u32 {
    let mut x = n.wrapping_mul(0x9e37_79b9);
    x = (x ^ x >> 16).wrapping_mul(0x85eb_ca6b);
    x ^ x >> 13
}

fn dining(assembly: &mut Assembly, materials: &Materials) -> Result<(), SceneError> {
    let centre = DVec3::new(4.1, 4.1, 0.0);
    let turn = Turn {
        centre,
        cos: 0.96,
        sin: 0.28,
    };
    let top = (centre + DVec3::new(-1.0, -0.5, 0.72), DVec3::new(2.0, 1.0, 0.06));
    solid(assembly, "table_top", materials.dark_wood, &[top], turn, false)?;
    let corners = [(-0.92, -0.42), (0.84, -0.42), (-0.92, 0.34), (0.84, 0.34)];
    let legs = corners.map(|(x, y)| (centre + DVec3::new(x, y, 0.0), DVec3::new(0.08, 0.08, 0.71)));
    solid(assembly, "table_legs", materials.dark_wood, &legs, turn, true)?;
    for k in 0..6_u32 {
        let x = -0.85 + 0.6 * f64::from(k % 3);
        // The rest stands behind the seat and not in it: what two boxes share of a plane would be there twice.
        let (front, depth, back) = if k < 3 { (-1.0, 0.44, -1.04) } else { (0.6, 0.4, 1.0) };
        let seat = (centre + DVec3::new(x, front, 0.42), DVec3::new(0.46, depth, 0.05));
        let rest = (centre + DVec3::new(x, back, 0.42), DVec3::new(0.46, 0.04, 0.52));
        let feet = [(0.02, 0.02), (0.39, 0.02), (0.02, 0.37), (0.39, 0.37)]
            .map(|(u, v)| (centre + DVec3::new(x + u, front + v, 0.0), DVec3::new(0.05, 0.05, 0.41)));
        solid(
            assembly,
            &format!("chair_{}_seat", k + 1),
            materials.cloth,
            &[seat, rest],
            turn,
            false,
        )?;
        solid(
            assembly,
            &format!("chair_{}_legs", k + 1),
            materials.steel,
            &feet,
            turn,
            true,
        )?;
    }
    // A bowl's worth of things on the table.
    for k in 0..5_u32 {
        let low = centre + DVec3::new(-0.7 + 0.3 * f64::from(k), -0.1, 0.78);
        let size = DVec3::new(0.12, 0.12, 0.08 + 0.03 * f64::from(k));
        let own = Turn {
            centre: low,
            cos: 0.8,
            sin: 0.6,
        };
        solid(
            assembly,
            &format!("pot_{}", k + 1),
            materials.spines[k as usize],
            &[(low, size)],
            own,
            true,
        )?;
    }
    Ok(())
}

fn sofas(assembly: &mut Assembly, materials: &Materials) -> Result<(), SceneError> {
    let seats = [
        ("sofa", DVec3::new(1.3, 0.3, 0.0), 2.2, Turn::none()),
        (
            "armchair",
            DVec3::new(4.1, 0.7, 0.0),
            0.95,
            Turn {
                centre: DVec3::new(4.6, 1.1, 0.0),
                cos: 0.8,
                sin: 0.6,
            },
        ),
    ];
    for (name, low, width, turn) in seats {
        let part = |x: f64, y: f64, z: f64, size: [f64; 3]| (low + DVec3::new(x, y, z), DVec3::from_array(size));
        let base = part(0.0, 0.0, 0.0, [width, 0.85, 0.3]);
        solid(assembly, &format!("{name}_base"), materials.cloth, &[base], turn, true)?;
        let back = part(0.0, 0.0, 0.34, [width, 0.22, 0.46]);
        let arms = [
            part(0.0, 0.26, 0.34, [0.18, 0.59, 0.22]),
            part(width - 0.18, 0.26, 0.34, [0.18, 0.59, 0.22]),
        ];
        solid(assembly, &format!("{name}_back"), materials.cloth, &[back], turn, false)?;
        solid(assembly, &format!("{name}_arms"), materials.cloth, &arms, turn, false)?;
    }
    let rug = (DVec3::new(1.2, 1.4, 0.0), DVec3::new(2.4, 1.6, 0.02));
    solid(assembly, "rug", materials.spines[0], &[rug], Turn::none(), true)?;
    let coffee = (DVec3::new(1.8, 1.8, 0.36), DVec3::new(1.2, 0.7, 0.05));
    solid(
        assembly,
        "coffee_table_top",
        materials.wood,
        &[coffee],
        Turn::none(),
        false,
    )?;
    let stand = (DVec3::new(2.2, 2.0, 0.02), DVec3::new(0.4, 0.3, 0.33));
    solid(
        assembly,
        "coffee_table_stand",
        materials.dark_wood,
        &[stand],
        Turn::none(),
        true,
    )
}

fn lamps(assembly: &mut Assembly, materials: &Materials) -> Result<(), SceneError> {
    let glow = assembly.material("glow", [0.6; 3], [40.0, 34.0, 24.0])?;
    let over_table = (DVec3::new(3.8, 3.8, 2.0), DVec3::new(0.6, 0.6, 0.12));
    solid(assembly, "table_lamp", glow, &[over_table], Turn::none(), false)?;
    let cord = (DVec3::new(4.07, 4.07, 2.12), DVec3::new(0.06, 0.06, 1.66));
    solid(
        assembly,
        "table_lamp_cord",
        materials.steel,
        &[cord],
        Turn::none(),
        true,
    )?;
    let pole = (DVec3::new(0.85, 0.12, 0.0), DVec3::new(0.06, 0.06, 1.5));
    solid(
        assembly,
        "floor_lamp_pole",
        materials.steel,
        &[pole],
        Turn::none(),
        true,
    )?;
    let shade = (DVec3::new(0.73, 0.0 + 0.04, 1.52), DVec3::new(0.3, 0.3, 0.3));
    solid(assembly, "floor_lamp", glow, &[shade], Turn::none(), false)
}
