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

use std::path::Path;

use serde_json::{Map, Value, json};

use super::ReportError;
use super::coloured::Quantity;
use super::file::{self, by_ending};
use super::patches::PatchFile;
use super::series::SeriesQuantity;
use super::sky::sky_columns;
use crate::form_factor::SkyFactors;
use crate::heat::Sunlit;
use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::solver::Solution;

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
        let file = PatchFile {
            scene: self.scene,
            mesh: self.mesh,
            description: self.description(),
            quantities: if format == Format::Csv {
                self.columns()
            } else {
                self.quantities()
            },
            shown: Quantity {
                name: "radiosity",
                unit: "W/m2",
                values: &self.solution.radiosity,
            },
        };
        file.write(path, format)
    }

    fn description(&self) -> String {
        let mut description = file::described("radiosity solution 1", (self.scene, self.mesh), self.settings);
        let units =
            "radiosity, irradiance, exitance, residual, error: W m-2; area: m2; centroid: m; reflectance, row_sum: 1";
        description["unit"] = units.into();
        description["stop_reason"] = json!(self.solution.stop_reason);
        description["residual_l2"] = self.solution.residual_l2.into();
        description["error_bound"] = self.solution.error_bound.into();
        format!("{description:#}")
    }

    /// Returns the columns of a table.
    fn columns(&self) -> Vec<SeriesQuantity> {
        let mut columns = vec![
            SeriesQuantity::of_block("radiosity", &self.solution.radiosity),
            SeriesQuantity::of_block("irradiance", &self.solution.irradiance),
        ];
        columns.extend(self.error.map(|error| SeriesQuantity::of_block("error", error)));
        let sky = self.sky.map(sky_columns).into_iter().flatten();
        columns.extend(sky.map(|(name, values)| SeriesQuantity::scalar(name, values)));
        columns
    }

    fn quantities(&self) -> Vec<SeriesQuantity> {
        let of_block = SeriesQuantity::of_block;
        let scalar = |name: &str, values: &[f64]| SeriesQuantity::of_channels(name, 1, values.to_vec());
        let mut quantities = vec![
            of_block("radiosity", &self.solution.radiosity),
            of_block("irradiance", &self.solution.irradiance),
            of_block("exitance", self.exitance),
            of_block("reflectance", self.reflectance),
            of_block("residual", &self.solution.residual(self.reflectance, self.exitance)),
        ];
        quantities.extend(self.error.map(|error| of_block("error", error)));
        if let Some(sun) = self.sun {
            quantities.extend([
                scalar("sunlit_fraction", &sun.light.fraction),
                scalar("sunlit_fraction_error", &sun.light.fraction_error),
                of_block("sun_irradiance", &sun.irradiance),
                of_block("sun_irradiance_error", &sun.error),
            ]);
        }
        if let Some([irradiance, error]) = self.skylight {
            quantities.push(of_block("sky_irradiance", irradiance));
            quantities.push(of_block("sky_irradiance_error", error));
        }
        quantities.extend(self.row_sums.map(|sums| scalar("row_sum", sums)));
        let sky = self.sky.map(sky_columns).into_iter().flatten();
        quantities.extend(sky.map(|(name, values)| scalar(name, &values)));
        quantities
    }
}
