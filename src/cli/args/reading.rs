//! The flags for reading a scene file.

use std::path::PathBuf;

use clap::Args;

use super::{parse_number, parse_positive};
use crate::scene::{DEFAULT_CREASE_ANGLE, Flip, Format, LengthUnit, LoadOptions, UpAxis};
use crate::workflow::Context;

/// How a scene file is read.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Scene file")]
pub(crate) struct ReadingArgs {
    /// The format of the scene file: obj, stl, ply, msh, vtk, gltf or vs3 [default: by its content, then by its suffix]
    #[arg(long, value_name = "NAME", value_parser = parse_format)]
    pub format: Option<String>,
    /// Read material libraries and buffers that lie outside the scene's folder
    #[arg(long)]
    pub allow_outside: bool,
    /// Reverse the winding of all faces of the scene, whose normals are inverted; with =NAME, of the faces of one surface [may be repeated]
    #[arg(long, value_name = "NAME", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    pub flip: Vec<String>,
    /// The unit of the file's lengths [default: m]
    #[arg(long, value_name = "UNIT", value_enum)]
    pub unit: Option<LengthUnit>,
    /// The file's axis that points upwards; the scene's is z: y turns the scene, z leaves it [default: z]
    #[arg(long, value_name = "AXIS", value_enum)]
    pub up_axis: Option<UpAxis>,
    /// Join vertices up to this distance, in m; what is moved by it counts as rounding [default: 0, equal ones only]
    #[arg(long, value_name = "T", value_parser = parse_positive)]
    pub merge_tolerance: Option<f64>,
    /// The angle beyond which two faces at an edge are different surfaces, where the file names none [default: 40]
    #[arg(long, value_name = "DEG", value_parser = parse_crease_angle, conflicts_with = "one_surface")]
    pub crease_angle: Option<f64>,
    /// Make one surface of all faces, whatever the file names
    #[arg(long)]
    pub one_surface: bool,
    /// The cell array of a VTK or PLY file whose values are the surfaces [default: the first of the usual names]
    #[arg(long, value_name = "NAME", conflicts_with = "one_surface")]
    pub surface_array: Option<String>,
    /// Reflectances and exitances by surface or material, in the syntax of --lighting; * in a name stands for any text
    #[arg(long, value_name = "FILE.toml")]
    pub materials: Option<PathBuf>,
}

impl ReadingArgs {
    /// Returns the options for the library.
    #[must_use]
    pub(crate) fn options(&self) -> LoadOptions {
        LoadOptions::default()
            .format(self.format.as_deref().and_then(Format::named))
            .allow_outside(self.allow_outside)
            .flip(self.flip())
            .unit(self.unit.unwrap_or_default())
            .up_axis(self.up_axis.unwrap_or_default())
            .merge_tolerance(self.merge_tolerance.unwrap_or(0.0))
            .crease_angle(self.crease_angle.unwrap_or(DEFAULT_CREASE_ANGLE))
            .one_surface(self.one_surface)
            .surface_array(self.surface_array.clone())
            .materials(self.materials.clone())
    }

    /// Returns the faces whose winding is to be reversed.
    #[must_use]
    pub(crate) fn flip(&self) -> Flip {
        if self.flip.is_empty() {
            Flip::Nothing
        } else if self.flip.iter().any(String::is_empty) {
            Flip::All
        } else {
            Flip::Surfaces(self.flip.clone())
        }
    }

    /// Returns the first given flag beside `--allow-outside`, which commands without a scene accept.
    #[must_use]
    pub(crate) fn first_given(&self) -> Option<&'static str> {
        let given = [
            (self.format.is_some(), "--format"),
            (!self.flip.is_empty(), "--flip"),
            (self.unit.is_some(), "--unit"),
            (self.up_axis.is_some(), "--up-axis"),
            (self.merge_tolerance.is_some(), "--merge-tolerance"),
            (self.crease_angle.is_some(), "--crease-angle"),
            (self.one_surface, "--one-surface"),
            (self.surface_array.is_some(), "--surface-array"),
            (self.materials.is_some(), "--materials"),
        ];
        given.into_iter().find(|(is_given, _)| *is_given).map(|(_, flag)| flag)
    }

    /// Records the given flags in the settings of a run.
    pub(in crate::cli) fn describe(&self, cx: &mut Context) {
        let up_axis = |axis| if axis == UpAxis::Y { "y" } else { "z" };
        let settings = &mut cx.settings;
        settings.format.clone_from(&self.format);
        settings.flip = (!self.flip.is_empty()).then(|| self.flip.clone());
        settings.unit_m = self.unit.map(|unit| unit.metres(1.0));
        settings.up_axis = self.up_axis.map(|axis| up_axis(axis).to_owned());
        settings.merge_tolerance_m = self.merge_tolerance;
        settings.crease_angle_degrees = self.crease_angle;
        settings.one_surface = self.one_surface.then_some(true);
        settings.surface_array.clone_from(&self.surface_array);
        settings.materials = self.materials.as_ref().map(|file| file.display().to_string());
    }
}

fn parse_format(text: &str) -> Result<String, String> {
    Format::named(text)
        .map(|format| format.name().to_owned())
        .ok_or_else(|| {
            let names: Vec<&str> = Format::all().map(Format::name).collect();
            format!("give one of {}", names.join(", "))
        })
}

fn parse_crease_angle(text: &str) -> Result<f64, String> {
    parse_number(text, "degrees from 0 to 180", |value| (0.0..=180.0).contains(&value))
}
