//! Writes voxels with their values as an unstructured grid of VTK (`.vtu`).

use std::collections::HashMap;
use std::io::Write as _;
use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value};

use super::{ReportError, file, vtu};
use crate::matrix::operator::Block;
use crate::scene::Scene;
use crate::voxel::VoxelScene;

/// The metadata of a file of voxels, in JSON.
#[derive(Debug, Serialize)]
struct VoxelDescription<'a> {
    /// Name and number of the file's layout.
    format: &'static str,
    /// How the values were computed.
    settings: &'a Map<String, Value>,
}

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
    let description = VoxelDescription {
        format: "radiosity voxels 1",
        settings,
    };
    let description = serde_json::json!(description).to_string();
    assert!(
        radiosity.n_rows() == n && irradiance.n_rows() == n,
        "one row per surfel"
    );
    let mut id_of_corner: HashMap<[i32; 3], usize> = HashMap::new();
    let mut corners: Vec<[i32; 3]> = Vec::new();
    let mut cells: Vec<[usize; 8]> = Vec::with_capacity(n);
    for surfel in &voxels.surfels {
        let [x, y, z] = surfel.voxel();
        // The corners of a VTK_HEXAHEDRON go around the lower face, then around the upper one.
        cells.push(std::array::from_fn(|k| {
            let [dx, dy] = [[0, 0], [1, 0], [1, 1], [0, 1]][k % 4];
            let corner = [x + dx, y + dy, z + i32::from(k >= 4)];
            *id_of_corner.entry(corner).or_insert_with(|| {
                corners.push(corner);
                corners.len() - 1
            })
        }));
    }
    let half = 0.5 * voxels.grid.voxel_size;
    file::write(path, |writer| {
        let names: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
        let points = corners.iter().map(|&c| (voxels.grid.centre(c) - half).to_array());
        let surfaces = voxels
            .surfels
            .iter()
            .map(|s| [scene.faces[s.face.0 as usize].surface.0]);
        let normals = voxels
            .surfels
            .iter()
            .map(|s| voxels.normals[s.normal as usize].unit.to_array());
        let number = |x: &f64| format!("{x:?}");
        vtu::write_head(writer, &description, &names, corners.len(), n)?;
        vtu::write_numbers(writer, "Float64", "position", 3, points, number)?;
        writeln!(writer, "</Points>\n<Cells>")?;
        vtu::write_numbers(writer, "Int64", "connectivity", 1, cells.iter(), usize::to_string)?;
        vtu::write_numbers(
            writer,
            "Int64",
            "offsets",
            1,
            (1..=n).map(|k| [8 * k]),
            usize::to_string,
        )?;
        vtu::write_numbers(writer, "UInt8", "types", 1, (0..n).map(|_| [12]), i32::to_string)?;
        writeln!(writer, "</Cells>\n<CellData>")?;
        vtu::write_numbers(writer, "Int64", "surface", 1, surfaces, u32::to_string)?;
        vtu::write_numbers(writer, "Float64", "normal", 3, normals, number)?;
        vtu::write_numbers(
            writer,
            "Float64",
            "area_m2",
            1,
            voxels.surfels.iter().map(|s| [s.area]),
            number,
        )?;
        for (name, block) in [("radiosity", radiosity), ("irradiance", irradiance)] {
            let rows = block.values().chunks(block.n_channels());
            vtu::write_numbers(writer, "Float64", name, block.n_channels(), rows, number)?;
        }
        writeln!(writer, "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>")
    })
}
