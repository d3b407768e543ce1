//! Files with the values of quantities on patches, which solutions and heat share.

use std::path::Path;

use super::coloured::Quantity;
use super::npz::NpzWriter;
use super::series::SeriesQuantity;
use super::solution::Format;
use super::{ReportError, coloured, csv, file, vtu};
use crate::mesh::Mesh;
use crate::scene::Scene;

/// The content of a file.
pub(super) struct PatchFile<'a> {
    pub(super) scene: &'a Scene,
    pub(super) mesh: &'a Mesh,
    /// The description as JSON.
    pub(super) description: String,
    /// The quantities of formats with numbers.
    pub(super) quantities: Vec<SeriesQuantity>,
    /// The quantity of formats with colours.
    pub(super) shown: Quantity<'a>,
}

impl PatchFile<'_> {
    /// Writes the file, atomically.
    pub(super) fn write(&self, path: &Path, format: Format) -> Result<(), ReportError> {
        let scene = (self.scene, self.mesh);
        file::write(path, |writer| match format {
            Format::Csv => {
                csv::write_description(writer, &self.description)?;
                csv::write_patches(writer, self.scene, self.mesh, &self.quantities)
            }
            Format::Npz => {
                let mut npz = NpzWriter::new(writer);
                npz.bytes("meta.json", self.description.as_bytes())?;
                for own in &self.quantities {
                    npz.numbers(&own.name, &own.shape(None, self.mesh.n_patches()), &own.values)?;
                }
                npz.patches(self.mesh)?;
                npz.finish()
            }
            Format::Vtu => vtu::write(writer, scene, &self.description, &self.quantities),
            Format::Ply => coloured::write(writer, coloured::Format::Ply, scene, &self.shown),
            Format::Obj => coloured::write(writer, coloured::Format::Obj, scene, &self.shown),
        })
    }
}
