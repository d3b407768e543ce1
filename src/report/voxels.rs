//! Writes voxels with their values as an unstructured grid of VTK (`.vtu`).

use std::collections::HashMap;
use std::path::Path;

use serde_json::{Map, Value, json};

use super::{ReportError, file, vtu};
use crate::matrix::operator::Block;
use crate::scene::Scene;
use crate::voxel::VoxelScene;

/// Writes one VTK_HEXAHEDRON for each surfel, with its surface, normal, area, radiosity and irradiance; the file is replaced atomically.
///
/// meshio does not read VTK_VOXEL. A voxel with several surfels is repeated for each. Positions in m, area in m², radiosity and irradiance in W·m⁻². `settings` are those of the computation.
///
/// # Errors
/// [`ReportError::Unwritable`].
///
/// # Panics
/// If the blocks have not one row per surfel.
#[track_caller]
pub fn write_vtu(
    path: &Path,
    scene: &Scene,
    voxels: &VoxelScene,
    radiosity: &Block,
    irradiance: &Block,
    settings: &Map<String, Value>,
) -> Result<(), ReportError> {
    let n = voxels.n_surfels();
    let description = json!({ "format": "radiosity voxels 1", "settings": settings }).to_string();
    assert!(
        radiosity.n_rows() == n && irradiance.n_rows() == n,
        "one row per surfel"
    );
    let mut id_of_corner: HashMap<[i32; 3], u32> = HashMap::new();
    let mut corners: Vec<[i32; 3]> = Vec::new();
    let mut cells: Vec<[u32; 8]> = Vec::with_capacity(n);
    for surfel in &voxels.surfels {
        let [x, y, z] = surfel.voxel();
        // The corners of a VTK_HEXAHEDRON go around the lower face, then around the upper one.
        cells.push(std::array::from_fn(|k| {
            let [dx, dy] = [[0, 0], [1, 0], [1, 1], [0, 1]][k % 4];
            let corner = [x + dx, y + dy, z + i32::from(k >= 4)];
            let next = u32::try_from(corners.len()).expect("fewer corners than 2³²");
            *id_of_corner.entry(corner).or_insert_with(|| {
                corners.push(corner);
                next
            })
        }));
    }
    let half = 0.5 * voxels.grid.voxel_size;
    file::write(path, |writer| {
        let points = corners.iter().map(|&c| (voxels.grid.centre(c) - half).to_array());
        let surfaces = voxels.surfels.iter().map(|s| scene.faces[s.face.0 as usize].surface);
        let normals = voxels
            .surfels
            .iter()
            .map(|s| voxels.normals[s.normal as usize].unit.to_array());
        vtu::write_fields(writer, &description, scene)?;
        vtu::write_cells(writer, points, cells.iter(), surfaces)?;
        vtu::write_reals(writer, "normal", 3, normals)?;
        vtu::write_reals(writer, "area_m2", 1, voxels.surfels.iter().map(|s| [s.area]))?;
        for (name, block) in [("radiosity", radiosity), ("irradiance", irradiance)] {
            let rows = block.values().chunks(block.n_channels());
            vtu::write_reals(writer, name, block.n_channels(), rows)?;
        }
        vtu::write_end(writer)
    })
}
