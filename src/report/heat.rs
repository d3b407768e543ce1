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

use std::path::Path;

use serde_json::{Map, Value, json};

use super::coloured::Quantity;
use super::patches::PatchFile;
use super::series::SeriesQuantity;
use super::solution::Format;
use super::{ReportError, file};
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
        let quantities = self.heat.patches.iter();
        let quantities: Vec<_> = quantities
            .map(|(name, values)| SeriesQuantity::scalar(*name, values.clone()))
            .collect();
        let shown = quantities.iter().find(|own| own.name == "temperature_k");
        let kelvin = shown.map_or(Vec::new(), |own| own.values.clone());
        let mut description = file::described("radiosity heat 1", (self.scene, self.mesh), self.settings);
        description["balance"] = json!(self.heat.balance);
        let file = PatchFile {
            scene: self.scene,
            mesh: self.mesh,
            description: format!("{description:#}"),
            quantities,
            shown: Quantity {
                name: "temperature_k",
                unit: "K",
                values: &Block::from_values(kelvin, 1),
            },
        };
        file.write(path, format)
    }
}
