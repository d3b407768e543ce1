//! Files of solutions.
//!
//! | ending | content | for |
//! |---|---|---|
//! | `.csv` | a row for each patch: surface, area, centroid, radiosity, irradiance, error, sky and back factors; before them the description in lines that begin with `#` | tables |
//! | `.npz` | `radiosity`, `irradiance`, `exitance`, `reflectance`, `residual`, `error` \[n, c\]; `row_sum`, `sky_factor`, `back_factor` and their errors \[n, 1\]; `area`, `surface` \[n\]; `centroid` \[n, 3\]; `meta.json` | NumPy |
//! | `.ply`, `.obj` | patches whose vertices have the colours of the radiosity, white the greatest | MeshLab, Blender |
//! | `.vtu` | patches with the same quantities | ParaView, PyVista, meshio |
//!
//! `error` is the estimated error of the radiosity (see [`carried_error`](crate::solver::carried_error)), `row_sum` the sum of each patch's form factors, `sky_factor` the part of its light that
//! escapes. They are left out if no form factors are stored, and `error` if their errors are unknown. In daylight `.npz` and `.vtu` also have `sunlit_fraction`, `sun_irradiance`, `sky_irradiance` and
//! their errors. Radiosity, irradiance, exitance, residual and error are in W·m⁻², area in m², centroids in m.

use std::io::{self, Seek, Write};
use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value};

use super::file::{self, by_ending};
use super::npz::NpzWriter;
use super::sky::sky_columns;
use super::vtu::CellData;
use super::{ReportError, coloured, csv, pretty, vtu};
use crate::form_factor::SkyFactors;
use crate::heat::Sunlit;
use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::solver::{Solution, StopReason};

/// A solution with its scene and settings.
#[derive(Clone, Copy, Debug)]
pub struct SolutionReport<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its patches.
    pub mesh: &'a Mesh,
    /// ρ, \[n, c\].
    pub reflectance: &'a Block,
    /// E, W·m⁻², \[n, c\].
    pub exitance: &'a Block,
    /// B and H.
    pub solution: &'a Solution,
    /// The estimated error of B, W·m⁻², \[n, c\]; see [`carried_error`](crate::solver::carried_error).
    pub error: Option<&'a Block>,
    /// The row sums Σ_j F_ij, \[n\], if form factors were stored.
    pub row_sums: Option<&'a [f64]>,
    /// The sky factor of each patch, if form factors were stored.
    pub sky: Option<&'a SkyFactors>,
    /// The sunlight, which the irradiance includes and the exitance excludes.
    pub sun: Option<&'a Sunlit>,
    /// The irradiance straight from the sky and its error, W·m⁻², \[n, c\], which the irradiance includes and the exitance excludes.
    pub skylight: Option<&'a [Block; 2]>,
    /// The settings of the form factors and of the solution: no time, path or number of threads.
    pub settings: &'a Map<String, Value>,
}

/// The metadata of a file of a solution, in JSON.
#[derive(Debug, Serialize)]
struct SolutionDescription<'a> {
    /// Name and number of the file's layout.
    format: &'static str,
    /// The units of the arrays.
    unit: &'static str,
    /// The number of patches n.
    n_patches: usize,
    /// The geometry's [`Mesh::geometry_hash`].
    geometry_sha256: String,
    /// The scene's [`Scene::content_hash`].
    scene_sha256: String,
    /// The names of the surfaces, by the numbers that the patches have.
    surfaces: Vec<&'a str>,
    /// The settings of the form factors and of the solution.
    settings: &'a Map<String, Value>,
    /// The solver's stop reason.
    stop_reason: StopReason,
    /// The relative residual sqrt(Σ A r² / Σ A E²), the worst channel; null if it is not finite.
    residual_l2: f64,
    /// A bound on the relative error of B in the area-weighted L2 norm, without that of the form factors; null if none is known.
    error_bound: Option<f64>,
}

/// The formats of solutions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A table.
    Csv,
    /// NumPy's archive of arrays.
    Npz,
    /// An unstructured grid of VTK.
    Vtu,
    /// A mesh whose vertices have the colours of the radiosity.
    Ply,
    /// The same in Wavefront's format.
    Obj,
}

impl Format {
    /// Returns the format of a file's ending.
    ///
    /// # Errors
    /// [`ReportError::UnknownFormat`].
    pub fn of(path: &Path) -> Result<Self, ReportError> {
        let known = [
            ("csv", Self::Csv),
            ("npz", Self::Npz),
            ("vtu", Self::Vtu),
            ("ply", Self::Ply),
            ("obj", Self::Obj),
        ];
        by_ending(path, "a solution", &known)
    }
}

impl SolutionReport<'_> {
    /// Writes the solution to `path`, atomically, in the format of its ending.
    ///
    /// # Errors
    /// [`ReportError::UnknownFormat`], [`ReportError::Unwritable`].
    ///
    /// # Panics
    /// If the blocks have not one row for every patch.
    #[track_caller]
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let n = self.mesh.n_patches();
        let blocks = [
            self.reflectance,
            self.exitance,
            &self.solution.radiosity,
            &self.solution.irradiance,
        ];
        assert!(blocks.iter().all(|block| block.n_rows() == n), "one row per patch");
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
        let description = SolutionDescription {
            format: "radiosity solution 1",
            unit: "radiosity, irradiance, exitance, residual, error: W m-2; area: m2; centroid: m; reflectance, row_sum: 1",
            n_patches: self.mesh.n_patches(),
            geometry_sha256: self.mesh.geometry_hash(),
            scene_sha256: self.scene.content_hash(),
            surfaces: self.scene.surfaces.iter().map(|s| s.name.as_str()).collect(),
            settings: self.settings,
            stop_reason: self.solution.stop_reason,
            residual_l2: self.solution.residual_l2,
            error_bound: self.solution.error_bound,
        };
        pretty(&description)
    }

    fn quantities(&self) -> Vec<(&'static str, Block)> {
        let mut quantities = vec![
            ("radiosity", self.solution.radiosity.clone()),
            ("irradiance", self.solution.irradiance.clone()),
            ("exitance", self.exitance.clone()),
            ("reflectance", self.reflectance.clone()),
            ("residual", self.solution.residual(self.reflectance, self.exitance)),
        ];
        if let Some(error) = self.error {
            quantities.push(("error", error.clone()));
        }
        if let Some(sun) = self.sun {
            let one = |values: &[f64]| Block::from_values(values.to_vec(), 1);
            quantities.extend([
                ("sunlit_fraction", one(&sun.light.fraction)),
                ("sunlit_fraction_error", one(&sun.light.fraction_error)),
                ("sun_irradiance", sun.irradiance.clone()),
                ("sun_irradiance_error", sun.error.clone()),
            ]);
        }
        if let Some([irradiance, error]) = self.skylight {
            quantities.push(("sky_irradiance", irradiance.clone()));
            quantities.push(("sky_irradiance_error", error.clone()));
        }
        if let Some(sums) = self.row_sums {
            quantities.push(("row_sum", Block::from_values(sums.to_vec(), 1)));
        }
        let sky = self.sky.map(sky_columns).into_iter().flatten();
        quantities.extend(sky.map(|(name, values)| (name, Block::from_values(values, 1))));
        quantities
    }

    fn write_csv(&self, writer: &mut dyn Write) -> io::Result<()> {
        csv::write_description(writer, &self.description())?;
        let light = [
            ("radiosity", &self.solution.radiosity),
            ("irradiance", &self.solution.irradiance),
        ];
        let error = self.error.map(|error| ("error", error));
        let quantities: Vec<_> = light.into_iter().chain(error).collect();
        let sky: Vec<_> = self.sky.map(sky_columns).into_iter().flatten().collect();
        csv::write_solution(writer, self.scene, self.mesh, &quantities, &sky)
    }

    fn write_npz<W: Write + Seek>(&self, writer: W) -> io::Result<()> {
        let n = self.mesh.n_patches();
        let mut npz = NpzWriter::new(writer);
        npz.bytes("meta.json", self.description().as_bytes())?;
        for (name, block) in self.quantities() {
            npz.numbers(name, &[n, block.n_channels()], block.values())?;
        }
        npz.patches(self.mesh)?;
        npz.finish()
    }

    fn write_coloured(&self, writer: &mut dyn Write, format: coloured::Format) -> io::Result<()> {
        let quantity = coloured::Quantity {
            name: "radiosity",
            unit: "W/m2",
            values: &self.solution.radiosity,
        };
        coloured::write(writer, format, (self.scene, self.mesh), &quantity)
    }

    fn write_vtu(&self, writer: &mut dyn Write) -> io::Result<()> {
        let cell_data = |(name, block): (&str, Block)| CellData::new(name, block.n_channels(), block.values().to_vec());
        let data: Vec<_> = self.quantities().into_iter().map(cell_data).collect();
        vtu::write(writer, self.scene, self.mesh, &self.description(), &data)
    }
}
