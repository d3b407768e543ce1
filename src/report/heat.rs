//! Files of temperatures and net fluxes: a row for each patch.
//!
//! | ending | content |
//! |---|---|
//! | `.csv` | patch, surface, area, centroid, then the quantities; before them the description in lines that begin with `#` |
//! | `.npz` | each quantity \[n\]; `area`, `surface` \[n\], `centroid` \[n, 3\]; `meta.json` |
//! | `.ply`, `.obj` | patches whose vertices have the colours of the temperature |
//! | `.vtu` | patches with the same quantities |
//!
//! The unit of a quantity is in its name, and `NAME_error` is an estimate of its absolute error, infinite where unknown.

use std::io::{self, Seek, Write};
use std::path::Path;

use serde_json::{Map, Value, json};

use super::npz::NpzWriter;
use super::solution::Format;
use super::vtu::CellData;
use super::{ReportError, coloured, csv, file, vtu};
use crate::heat::Heat;
use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::scene::Scene;

/// The heat of the patches of a scene.
#[derive(Clone, Copy, Debug)]
pub struct HeatReport<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its patches.
    pub mesh: &'a Mesh,
    /// Temperatures and fluxes.
    pub heat: &'a Heat,
    /// The settings of the computation: no time, path or number of threads.
    pub settings: &'a Map<String, Value>,
}

impl HeatReport<'_> {
    /// Writes the patches to `path`, atomically, in the format of its ending.
    ///
    /// # Errors
    /// [`ReportError::UnknownFormat`], [`ReportError::Unwritable`].
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let format = Format::of(path)?;
        file::write(path, |writer| match format {
            Format::Csv => self.write_csv(writer),
            Format::Npz => self.write_npz(writer),
            Format::Vtu => self.write_vtu(writer),
            Format::Ply => self.write_coloured(writer, coloured::Format::Ply),
            Format::Obj => self.write_coloured(writer, coloured::Format::Obj),
        })
    }

    fn description(&self) -> String {
        let description = json!({
            "format": "radiosity heat 1",
            "n_patches": self.mesh.n_patches(),
            "geometry_sha256": self.mesh.geometry_hash(),
            "scene_sha256": self.scene.content_hash(),
            "surfaces": self.scene.surfaces.iter().map(|s| &s.name).collect::<Vec<_>>(),
            "balance": self.heat.balance,
            "settings": self.settings,
        });
        format!("{description:#}")
    }

    fn write_csv(&self, writer: &mut dyn Write) -> io::Result<()> {
        csv::write_description(writer, &self.description())?;
        let quantities = self.heat.patches.iter();
        let quantities: Vec<_> = quantities.map(|(name, values)| (*name, values.as_slice())).collect();
        csv::write_patches(writer, self.scene, self.mesh, &quantities)
    }

    fn write_npz<W: Write + Seek>(&self, writer: W) -> io::Result<()> {
        let mut npz = NpzWriter::new(writer);
        npz.bytes("meta.json", self.description().as_bytes())?;
        for (name, values) in &self.heat.patches {
            npz.numbers(name, &[values.len()], values)?;
        }
        npz.patches(self.mesh)?;
        npz.finish()
    }

    fn write_coloured(&self, writer: &mut dyn Write, format: coloured::Format) -> io::Result<()> {
        let temperatures = self.heat.patches.iter().find(|(name, _)| *name == "temperature_k");
        let Some((name, values)) = temperatures else {
            return Err(io::Error::other("no temperatures"));
        };
        let quantity = coloured::Quantity {
            name,
            unit: "K",
            values: &Block::from_values(values.clone(), 1),
        };
        coloured::write(writer, format, (self.scene, self.mesh), &quantity)
    }

    fn write_vtu(&self, writer: &mut dyn Write) -> io::Result<()> {
        let quantities = self.heat.patches.iter();
        let data: Vec<_> = quantities
            .map(|(name, values)| CellData::new(*name, 1, values.clone()))
            .collect();
        vtu::write(writer, self.scene, self.mesh, &self.description(), &data)
    }
}
