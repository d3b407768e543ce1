//! Warnings as lines of text.

use std::fmt::{self, Write as _};

use super::Warning;
use crate::form_factor::ROW_TOLERANCE;
use crate::parameter::{Named, Parameter, plainly};
use crate::printable::{counted, printable, short};
use crate::progress::Forecast;
use crate::voxel::MAX_VOXELS;

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(&plainly))
    }
}

impl Warning {
    /// Returns the warning as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        let name = |parameter| named(parameter, None);
        match self {
            Self::Scene(warning) => warning.to_string(),
            Self::DarkLighting { .. }
            | Self::VanishedFaces { .. }
            | Self::InsideOut { .. }
            | Self::NoneSees { .. }
            | Self::NoEmitterSees { .. }
            | Self::MostSeeBacks { .. }
            | Self::TurnedSurface { .. }
            | Self::TurnedFaces { .. }
            | Self::MoreTurned { .. } => self.of_scene(named),
            Self::FarStart { offset, width } => format!(
                "rays start {offset:.2e} m off a face, and the smallest patch is {width:.2e} m wide: factors between neighbours err by {:.1e}; \
                 use a method without rays, or remove distant objects",
                offset / width
            ),
            Self::NarrowGap {
                surfaces,
                width,
                offset,
            } => {
                let [first, second] = surfaces
                    .each_ref()
                    .map(|(surface, face)| format!("`{surface}` ({face})"));
                format!(
                    "{first} and {second} are {width:.2e} m apart, and rays start {offset:.2e} m off a face: radiation between them is lost; \
                     use a method without rays"
                )
            }
            Self::LightLeak {
                n_patches,
                value,
                error,
                unit,
                relative,
                whole,
                is_from_file,
            } => {
                let remedy = if *is_from_file {
                    "compute the form factors again".to_owned()
                } else {
                    format!("leave out {}", named(Parameter::CutAtWalls, Some("false")))
                };
                format!(
                    "light leaks through {} that straddle contact edges: {value:.2e} +- {error:.1e} {unit}, {relative:.1e} {whole}; {remedy}",
                    counted(*n_patches, "patch")
                )
            }
            Self::NoisyPixels {
                file,
                n_above,
                n_pixels,
                noise,
            } => format!(
                "{}: {n_above} of {} are above the noise of {} after the maximum number of rays; raise {} or {}",
                file.display(),
                counted(usize::try_from(*n_pixels).unwrap_or(usize::MAX), "pixel"),
                short(*noise),
                name(Parameter::GatherRays),
                name(Parameter::Noise)
            ),
            Self::BlankImage { camera } => format!(
                "no pixel shows the front of a face from {camera}; move the camera ({}, {}), \
                 or reverse faces with {}: a front has counter-clockwise corners",
                name(Parameter::Eye),
                name(Parameter::LookAt),
                name(Parameter::Flip)
            ),
            Self::Other(text) => text.clone(),
            Self::CheckpointIncomplete { file, reason } => format!(
                "{}: the checkpoint is incomplete: {reason}; the run continued without it",
                file.display()
            ),
            Self::CheckpointLeft { file, reason } => {
                format!("{}: the checkpoint cannot be used: {reason}", file.display())
            }
            Self::NoViewer { address, reason } => format!(
                "no viewer at {address} ({reason}); start tev there, or leave out {}",
                name(Parameter::Display)
            ),
            Self::ViewerGone => "the viewer stopped accepting pixels; the image file is complete".to_owned(),
            Self::BrokenLaw(check) => format!("conservation check: {check}"),
            Self::NoErrorOnTheFly => format!(
                "form factors that are not stored state no error, so the error that they cause is unknown; leave {} out to estimate it",
                name(Parameter::OnTheFly)
            ),
            Self::SmallSurfaces { .. }
            | Self::ThinGaps { .. }
            | Self::OpenVoxels { .. }
            | Self::EscapingLinks { .. }
            | Self::PassedWalls { .. }
            | Self::UnshotLight { .. } => self.of_voxels(named),
            Self::HeatToBacks { .. } | Self::NoMeshError | Self::OnePatchAFace { .. } | Self::InexactHeat { .. } => {
                self.of_heat(named)
            }
            _ => self.of_numbers(named),
        }
    }

    /// Returns the text of warnings about faces that see nothing, or emit nothing.
    fn of_scene(&self, named: Named<'_>) -> String {
        let flip = named(Parameter::Flip, None);
        let flip_of = |surface: &str| named(Parameter::Flip, Some(surface));
        match self {
            Self::DarkLighting { file } => format!(
                "{}: no face emits light in this lighting; give a surface an `exitance`",
                file.display()
            ),
            Self::VanishedFaces { at, count } => format!(
                "{at}this face and {} more are too small for rays, relative to the size of the scene; use a method without rays, or remove distant objects",
                count - 1
            ),
            Self::InsideOut { at, surface } => format!(
                "{at}`{surface}`: this closed surface lies inside another and its normals point inwards, so surrounding surfaces see its absorbing back faces; reverse it with {}",
                flip_of("NAME")
            ),
            Self::NoneSees { file, surface } => {
                let of_surface = surface
                    .as_ref()
                    .map_or_else(String::new, |name| format!(" of `{name}`"));
                format!(
                    "{}: no face{of_surface} sees another, so none receives radiation: the normals are probably inverted; reverse all with {flip}, or a surface's with {}",
                    file.display(),
                    flip_of("NAME")
                )
            }
            Self::NoEmitterSees { file } => format!(
                "{}: no face that emits light sees another: the normals are probably inverted; reverse all with {flip}, or a surface's with {}",
                file.display(),
                flip_of("NAME")
            ),
            Self::MostSeeBacks { file, count, n_faces } => format!(
                "{}: {count} of {n_faces} faces see only back faces, which are black: normals are probably inverted; reverse all with {flip}, or a surface's with {}",
                file.display(),
                flip_of("NAME")
            ),
            Self::TurnedSurface { file, surface } => format!(
                "{}: the fronts of `{surface}` see no face, but its backs do: its normals are probably inverted; reverse them with {}",
                file.display(),
                flip_of(surface)
            ),
            Self::TurnedFaces { at, surface, count } => {
                let what = match count {
                    1 => "the face sees no other".to_owned(),
                    n => format!("this face and {} more see no other", n - 1),
                };
                format!(
                    "{at}`{surface}`: {what}, and others see the back: the normal is probably inverted; reverse the face, or the whole surface with {}",
                    flip_of(surface)
                )
            }
            Self::MoreTurned { file, count } => {
                format!(
                    "{}: faces of {count} more surfaces are probably inverted too",
                    file.display()
                )
            }
            // A new kind without a text still produces output.
            _ => format!("{self:?}"),
        }
    }

    /// Returns the text of warnings about voxels.
    fn of_voxels(&self, named: Named<'_>) -> String {
        let voxels = named(Parameter::Voxels, None);
        let larger = format!("give {voxels} a larger number");
        match self {
            Self::SmallSurfaces {
                count,
                surface,
                side,
                size,
                enough,
            } => {
                let remedy = if *enough <= f64::from(MAX_VOXELS) {
                    format!("give {}", named(Parameter::Voxels, Some(&format!("{enough:.0}"))))
                } else {
                    "use `solve`".to_owned()
                };
                format!(
                    "{count} surfaces are smaller than two voxels of {size:.2e} m, such as {surface} of {side:.2e} m, so their radiosity and shadows are not resolved; {remedy}"
                )
            }
            Self::ThinGaps { n_voxels, pairs } => {
                // The line stays readable with three pairs.
                let shown: Vec<String> = pairs.iter().take(3).map(|[a, b]| format!("{a} and {b}")).collect();
                let others = match pairs.len().saturating_sub(3) {
                    0 => String::new(),
                    more => format!(" and {more} other pairs"),
                };
                format!(
                    "with {n_voxels} voxels along the longest axis, fewer than two lie between {}{others}; radiosity in such gaps is not resolved; {larger}",
                    shown.join(", ")
                )
            }
            Self::OpenVoxels { count, surfaces } => {
                let shown: Vec<&str> = surfaces.iter().map(String::as_str).take(5).collect();
                format!(
                    "{count} voxels of a closed scene can be reached from outside, on {}, so it leaks there; {larger}",
                    shown.join(", ")
                )
            }
            Self::EscapingLinks {
                n_escaped,
                n_links,
                power,
                share,
            } => {
                let of_links = 100.0 * *n_escaped as f64 / (*n_links).max(1) as f64;
                format!(
                    "{n_escaped} links ({of_links:.2} %) leave a closed scene; with backs, {power:.1e} W are lost, {share:.1e} of the emitted power; {larger}"
                )
            }
            Self::PassedWalls {
                power,
                share,
                thickness,
                enough,
            } => {
                let wall = thickness.map_or_else(
                    || " closed surfaces".to_owned(),
                    |thickness| format!(" walls as thin as {thickness:.1e} m"),
                );
                let enough = enough.map_or_else(|| "larger".to_owned(), |n| n.to_string());
                format!(
                    "{power:.1e} W, {share:.1e} of the emitted power, passes{wall}, so surfaces behind them are too bright; give {}",
                    named(Parameter::Voxels, Some(&enough))
                )
            }
            Self::UnshotLight { passes, unshot } => format!(
                "after {passes} propagations unshot light is left, {unshot:.1e} of the power or more; give more {}, or a {}",
                named(Parameter::Passes, None),
                named(Parameter::Solver, None)
            ),
            // A new kind without a text still produces output.
            _ => format!("{self:?}"),
        }
    }

    /// Returns the text of warnings about heat.
    fn of_heat(&self, named: Named<'_>) -> String {
        match self {
            Self::HeatToBacks { power_w } => format!(
                "back faces, black and at 0 K, absorb {power_w:.3e} W; close the scene around them, or reverse faces with {}",
                named(Parameter::Flip, Some("NAME"))
            ),
            Self::NoMeshError => format!(
                "stated errors do not include the error of the mesh, because there is no coarser mesh; give {} of 2 or more",
                named(Parameter::Subdivide, None)
            ),
            Self::OnePatchAFace { change } => format!(
                "one patch a face would change a surface by {change:.1e}: the error of the mesh may be several times the stated one; give {} of 4 or more",
                named(Parameter::Subdivide, None)
            ),
            Self::InexactHeat { relative } => format!(
                "the irradiance of a surface has a relative error of {relative:.1e}, so temperatures are inexact; give a smaller {}, or a larger {}",
                named(Parameter::FormFactorTolerance, None),
                named(Parameter::Budget, None)
            ),
            // A new kind without a text still produces output.
            _ => format!("{self:?}"),
        }
    }

    /// Returns the text of warnings about form factors and solutions.
    fn of_numbers(&self, named: Named<'_>) -> String {
        let name = |parameter| named(parameter, None);
        match self {
            Self::LongWork(forecast) => long_work(forecast, named),
            Self::AboveTolerance { n_pairs, worst, tolerance } => format!(
                "{} of patches reached the budget, or the precision of f64, above the tolerance; the largest error is {worst:.1e}; give a larger {} or {}",
                counted(usize::try_from(*n_pairs).unwrap_or(usize::MAX), "pair"),
                name(Parameter::Budget),
                name(*tolerance)
            ),
            Self::RowsAboveTolerance { worst } => format!(
                "the error of a row sum is {worst:.1e}, above its tolerance, and more work does not lower it; give a larger {}",
                name(Parameter::Of(&ROW_TOLERANCE))
            ),
            Self::Rounded { doubt, tolerance } => format!("{doubt}, or a larger {}", name(*tolerance)),
            Self::FileAboveTolerance { file } => format!(
                "{}: these form factors reached their budget above their tolerance; compute them again with a larger {} or {}",
                file.display(),
                name(Parameter::Budget),
                name(Parameter::Tolerance)
            ),
            Self::FileRounded { file, doubt } => format!("{}: {doubt}", file.display()),
            Self::SlippedRays { n_lost, n_rays } => format!(
                "{n_lost} of {n_rays} rays left a closed scene, or hit back faces where two faces touch; the row sums show the size of this error"
            ),
            Self::NothingToClose => format!(
                "{} closure changes nothing: no row is known to sum to 1, because the scene is not known to be closed; if it is, give {}",
                name(Parameter::Balance),
                name(Parameter::Closed)
            ),
            Self::DoubtedRows { at, surface, count } => format!(
                "{at}row sums of {count} patches, first of `{surface}`, differ from 1 by more than their stated error (or 0.1) and are not repaired; check for gaps and inverted normals"
            ),
            Self::NotBalanced { row_error_max, n_passes } => {
                format!("row sums differ from their targets by up to {row_error_max:.1e} after {n_passes} passes of the repair")
            }
            Self::RoundedToF32 { relative } => format!(
                "form factors are rounded to f32, which may change the radiosity by {relative:.1e} of itself; use `{}`",
                named(Parameter::Precision, Some("f64"))
            ),
            Self::LampsOutshine { bound, tolerance } => {
                let remedy = tolerance.map_or_else(
                    || "make the emitters larger and dimmer, with the same power".to_owned(),
                    |tolerance| format!("give {}", named(Parameter::SolverTolerance, Some(&format!("{tolerance:e}")))),
                );
                format!(
                    "the residual tolerance is dominated by the emitters: the error bound is {bound:.1e} relative to the reflected radiosity; {remedy}"
                )
            }
            Self::NegativeLight { residual, row_sum_max } => format!(
                "no physical solution: the radiosity is negative on some patches (relative residual {residual:.3e}). Form-factor rows sum to up to {row_sum_max:.6}, so the system creates energy"
            ),
            Self::NotConverged { reason, residual } => {
                format!("the solver stopped without converging ({reason}) at a relative residual of {residual:.3e}")
            }
            Self::NoBound => format!(
                "no bound on the error of the radiosity can be proved: reflectances and row sums are too close to 1, or above; `{}` has the smallest residual",
                named(Parameter::Solver, Some("direct"))
            ),
            Self::TooInexact => "the radiosity may err by its own size or more: form factors are too inexact for reflectances this close to 1; give a smaller tolerance, \
                 more rays or f64"
                .to_owned(),
            Self::CoarseMesh { surface, change } => format!(
                "the mesh is too coarse for `{}`: with a quarter of the patches its mean radiosity changes by {change:.1e} of itself; subdivide more",
                printable(surface)
            ),
            // A new kind without a text still produces output.
            _ => format!("{self:?}"),
        }
    }
}

/// Returns the text about the run time of long work, with those of other settings.
fn long_work(forecast: &Forecast, named: Named<'_>) -> String {
    let about = if forecast.at_least { "at least" } else { "about" };
    let mut text = format!("form factors will take {about} {}", time_text(forecast.asked.1));
    for &(tolerance, seconds) in &forecast.looser {
        let _ = write!(text, ", to a tolerance of {tolerance:.0e} {}", time_text(seconds));
    }
    if let Some((rays, seconds)) = forecast.shooting {
        let error = Forecast::error_of_rays(rays);
        let _ = write!(
            text,
            ", by `{}` {} with errors of {error:.0e}",
            named(Parameter::Method, Some("sr")),
            time_text(seconds)
        );
    }
    text
}

/// The units of times in texts, in s; each is used from one and a half of it on.
const UNITS: [(f64, &str); 6] = [
    (31_536_000.0, "year"),
    (604_800.0, "week"),
    (86_400.0, "day"),
    (3600.0, "hour"),
    (60.0, "minute"),
    (1.0, "second"),
];

/// Returns a time in one unit, as text.
fn time_text(seconds: f64) -> String {
    let is_long = |pair: &&[(f64, &str)]| seconds + 0.5 * pair[1].0 >= 1.5 * pair[0].0;
    let (length, name, least) = UNITS
        .windows(2)
        .find(is_long)
        .map_or((1.0, "second", 0.0), |pair| (pair[0].0, pair[0].1, 2.0));
    let n = (seconds / length).round().max(least);
    let plural = if (n - 1.0).abs() < 0.5 { "" } else { "s" };
    format!("{n} {name}{plural}")
}
