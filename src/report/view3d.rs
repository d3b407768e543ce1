//! Writes form factors between surfaces in the format of View3D (`out = 0`), for scripts that read it.
//!
//! A line of 30 characters, `View3D 3.3 0 ENCL 0 N`, padded with blanks: program and version, text format, 1 for a closed scene, 0 as
//! factors are those of black surfaces, and the number of surfaces. A line of the areas (`%g`), a line of each row (`%.6f`) from that surface to every other, and a
//! line of the emissivities (`%.3f`), all separated by one blank. Source: G. N. Walton, "Using the View3D program", NIST, 2002, and what
//! View3D 3.3 writes. Departures: obstructions and null surfaces have rows, as black surfaces of the scene; an emissivity is 1 − ρ, the area mean over faces and channels.

use std::io::{self, Write};

use crate::matrix::SurfaceRows;
use crate::scene::Scene;

/// The number of characters of the first line before its end.
const HEAD: usize = 30;

/// Writes the areas, the rows and the emissivities of surfaces.
pub(super) fn write(
    writer: &mut dyn Write,
    scene: &Scene,
    surfaces: &SurfaceRows<'_>,
    is_closed: bool,
) -> io::Result<()> {
    let n = scene.surfaces.len();
    writeln!(
        writer,
        "{:HEAD$}",
        format!("View3D 3.3 0 {} 0 {n}", u8::from(is_closed))
    )?;
    let (areas, emissivities) = properties(scene);
    line(writer, areas.iter().map(|area| general(*area)))?;
    for row in surfaces.iter() {
        line(writer, row.form_factor.iter().map(|value| format!("{value:.6}")))?;
    }
    line(writer, emissivities.iter().map(|value| format!("{value:.3}")))
}

fn line(writer: &mut dyn Write, words: impl Iterator<Item = String>) -> io::Result<()> {
    writeln!(writer, "{}", words.collect::<Vec<_>>().join(" "))
}

/// Returns the area and the emissivity of each surface.
fn properties(scene: &Scene) -> (Vec<f64>, Vec<f64>) {
    let (mut areas, mut absorbing) = (vec![0.0; scene.surfaces.len()], vec![0.0; scene.surfaces.len()]);
    for (id, face) in scene.face_ids().zip(&scene.faces) {
        let area = scene.area_vector(id).length();
        let reflectance = scene.materials[face.material.0 as usize].reflectance;
        let surface = face.surface.0 as usize;
        areas[surface] += area;
        absorbing[surface] += area * (1.0 - reflectance.iter().sum::<f64>() / 3.0);
    }
    let mean = |(area, absorbed): (&f64, f64)| if *area > 0.0 { absorbed / area } else { 1.0 };
    let emissivities = areas.iter().zip(absorbing).map(mean).collect();
    (areas, emissivities)
}

/// Returns a number in the format `%g` of C: six digits, without trailing zeros.
fn general(value: f64) -> String {
    const DIGITS: i32 = 6;
    let scientific = format!("{value:.5e}");
    let Some((digits, exponent)) = scientific.split_once('e') else {
        return scientific;
    };
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let trimmed = |text: &str| {
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text.to_owned()
        }
    };
    if !(-4..DIGITS).contains(&exponent) {
        let sign = if exponent < 0 { '-' } else { '+' };
        return format!("{}e{sign}{:02}", trimmed(digits), exponent.abs());
    }
    let places = usize::try_from(DIGITS - 1 - exponent).unwrap_or(0);
    trimmed(&format!("{value:.places$}"))
}

#[cfg(test)]
mod tests {
    use super::general;

    #[test]
    fn numbers_are_those_of_c() {
        for (value, expected) in [
            (0.0, "0"),
            (1.0, "1"),
            (0.5, "0.5"),
            (100_000.0, "100000"),
            (1e6, "1e+06"),
            (1_234_567.0, "1.23457e+06"),
            (123_456.7, "123457"),
            (999_999.5, "1e+06"),
            (0.000_1, "0.0001"),
            (0.000_012_5, "1.25e-05"),
            (1.0 / 3.0, "0.333333"),
            (2.5e-120, "2.5e-120"),
        ] {
            assert_eq!(general(value), expected);
        }
    }
}
