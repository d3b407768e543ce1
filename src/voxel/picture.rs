//! A picture of the voxels themselves.

use std::f64::consts::PI;

use glam::DVec3;

use super::discretize::VoxelScene;
use crate::matrix::operator::Block;
use crate::render::{Image, Samples, Sight as Line, View};
use crate::threads;

/// The surfel at a pixel's centre, with the side and the depth of the hit.
struct Hit {
    surfel: usize,
    normal: DVec3,
    depth: f64,
}

/// Renders the voxels as cubes, each with the radiosity of the surfel that faces the eye most; one ray a pixel, through its centre.
///
/// Layers: `R,G,B` radiance B/π, `radiosity.*`, `N.X/Y/Z` the side of the cube, `Z` the depth along the camera's axis in m, `surfel` as u32
/// (`u32::MAX` for background). Surfels that face away are black.
///
/// # Panics
/// If `radiosity` has not one row per surfel and one or three channels.
#[must_use]
#[track_caller]
pub fn picture(voxels: &VoxelScene, radiosity: &Block, view: &dyn View) -> Image {
    assert_eq!(radiosity.n_rows(), voxels.n_surfels(), "one row per surfel");
    assert!(matches!(radiosity.n_channels(), 1 | 3), "one channel or three");
    let (width, height) = view.size();
    let pixels: Vec<Option<Hit>> = threads::collect(width as usize * height as usize, |k| {
        let [x, y] = [k % width as usize, k / width as usize].map(|place| place as f64 + 0.5);
        let Line::Ray {
            origin,
            direction,
            depth_axis,
        } = view.sight(x, y)?
        else {
            return None;
        };
        trace(voxels, origin, direction, depth_axis)
    });
    let mut image = Image::new(width as usize, height as usize);
    let mut insert = |name: &str, value: &dyn Fn(&Hit) -> f64| {
        #[expect(clippy::cast_possible_truncation, reason = "image layers are f32 by design")]
        let samples = pixels
            .iter()
            .map(|hit| hit.as_ref().map_or(0.0, value) as f32)
            .collect();
        image.insert(name, Samples::F32(samples));
    };
    let last = radiosity.n_channels() - 1;
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        let b = |hit: &Hit| {
            let faces = voxels.normal(hit.surfel).unit.dot(hit.normal) > 0.0;
            if faces {
                radiosity.row(hit.surfel)[c.min(last)]
            } else {
                0.0
            }
        };
        insert(name, &|hit| b(hit) / PI);
        insert(&format!("radiosity.{name}"), &b);
    }
    for (axis, name) in ["N.X", "N.Y", "N.Z"].into_iter().enumerate() {
        insert(name, &|hit| hit.normal[axis]);
    }
    insert("Z", &|hit| hit.depth);
    let id = |hit: &Option<Hit>| {
        hit.as_ref()
            .map_or(u32::MAX, |hit| u32::try_from(hit.surfel).unwrap_or(u32::MAX))
    };
    image.insert("surfel", Samples::U32(pixels.iter().map(id).collect()));
    image
}

/// Walks voxel by voxel from the eye, or from the point where the ray enters the lattice.
fn trace(voxels: &VoxelScene, origin: DVec3, direction: DVec3, depth_axis: DVec3) -> Option<Hit> {
    let eye = voxels.grid.to_lattice(origin);
    let step = direction / voxels.grid.voxel_size;
    let size = DVec3::from_array(voxels.grid.n_voxels.map(f64::from));
    let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
    let mut side = 0;
    for a in 0..3 {
        let (t0, t1) = ((-0.5 - eye[a]) / step[a], (size[a] - 0.5 - eye[a]) / step[a]);
        // Along a plane of the lattice both are infinite or NaN; min and max ignore NaN.
        if t0.min(t1) > enter {
            enter = t0.min(t1);
            side = a;
        }
        leave = leave.min(t0.max(t1));
    }
    if enter > leave {
        return None;
    }
    let start = eye + enter * step;
    let limits = voxels.grid.n_voxels;
    let mut voxel: [i32; 3] = std::array::from_fn(|a| super::grid::nearest(start[a]).clamp(0, limits[a] - 1));
    let mut t = enter;
    loop {
        if let Some(rank) = voxels.octree.rank(voxel) {
            let range = voxels.surfels_of(rank);
            let towards = |s: &usize| voxels.normal(*s).unit.dot(direction);
            // Near a thin wall, of the surfels on the side that the ray comes from.
            let from = 2 * side + usize::from(step[side] < 0.0);
            let looks_back = |s: &usize| voxels.nodes(*s) >> from & 1 == 1;
            let order = |a: &usize, b: &usize| towards(a).total_cmp(&towards(b));
            let surfel = range.clone().filter(looks_back).min_by(order).or(range.min_by(order))?;
            let mut normal = DVec3::ZERO;
            normal[side] = -step[side].signum();
            let facing = voxels.normal(surfel).unit;
            // A side of the cube in a direction from which the surface does not see is shown with the surface's own normal.
            let normal = if facing.dot(direction) < 0.0 && facing.dot(normal) <= 0.0 {
                facing
            } else {
                normal
            };
            return Some(Hit {
                surfel,
                normal,
                depth: t * direction.dot(depth_axis),
            });
        }
        let crossing = |a: usize| {
            let wall = f64::from(voxel[a]) + 0.5 * step[a].signum();
            if step[a].abs() > 0.0 {
                (wall - eye[a]) / step[a]
            } else {
                f64::INFINITY
            }
        };
        let times: [f64; 3] = std::array::from_fn(crossing);
        side = if times[0] <= times[1] && times[0] <= times[2] {
            0
        } else if times[1] <= times[2] {
            1
        } else {
            2
        };
        t = times[side];
        voxel[side] += if step[side] > 0.0 { 1 } else { -1 };
        if !(0..limits[side]).contains(&voxel[side]) {
            return None;
        }
    }
}
