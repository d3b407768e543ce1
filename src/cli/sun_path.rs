//! The flag `--sun-path` of `solve` and `heat`: the sun at many times, with form factors computed once.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Serialize;

use super::args::{HeatArgs, SolveArgs, SunArgs};
use super::checks::describe_patches;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::run::Run;
use super::solution::code_of;
use super::{Outcome, sun};
use crate::document::PathDocument;
use crate::heat::{Boundary, SunPath};
use crate::printable::counted;
use crate::report::series::{SeriesReport, SeriesWriter};
use crate::report::solution::Format;
use crate::report::{ReportError, sun_path};
use crate::solver::StopReason;
use crate::workflow::{BlockSink, Context, FormFactorStudy, Model, PathStudy, TotalError, WorkflowError};

/// Reads the path of the sun, if there is one, in a scene where `up` is up.
pub(super) fn read(file: Option<&Path>, args: &SunArgs, up: DVec3) -> Result<Option<SunPath>, Failure> {
    let axes = [DVec3::from_array(args.north), up];
    let read = |table| sun_path::read(table, args.sun_radius.unwrap_or(0.0), axes);
    Ok(file.map(read).transpose()?)
}

/// Refuses a checkpoint without work to store: form factors are read from a file, and there is no path of the sun.
pub(super) fn expect_work(
    checkpoint: Option<&Path>,
    form_factors: Option<&Path>,
    path: Option<&Path>,
) -> Result<(), Failure> {
    if checkpoint.is_some() && form_factors.is_some() && path.is_none() {
        let wrong = "the argument '--form-factors <F.npz>' cannot be used with '--checkpoint <FILE>'";
        return Err(Failure::usage(wrong.to_owned()));
    }
    Ok(())
}

/// Returns the main file of an output, which is a series along a path.
pub(super) fn output(output: &Path, path: Option<&Path>) -> Result<PathBuf, ReportError> {
    match path {
        Some(_) => SeriesWriter::file_of(output),
        None => Format::of(output).map(|_| output.to_owned()),
    }
}

/// A path of the sun in a scene with its form factors.
pub(super) struct OnPath<'a> {
    pub(super) model: Model,
    pub(super) factors: &'a FormFactorStudy,
    pub(super) path: &'a SunPath,
}

impl OnPath<'_> {
    /// Solves for the light at each time.
    pub(super) fn solve(mut self, args: &SolveArgs, run: &mut Run) -> Result<Outcome, Failure> {
        args.sun.note_path(args.sun_path.as_deref(), &mut run.cx);
        let sky = sun::sky(&args.sun, DVec3::Z)?;
        let request = args.solver.request();
        let (study, written) = self.written(args.output.as_deref(), run, |on, sink, cx| {
            on.model
                .solve_along_sun_path(on.factors, (on.path, sky), &request, sink, cx)
        })?;
        let converged = study.steps.iter().map(|step| step.quality.stop_reason);
        let code = self.code(converged, &study, true);
        Ok(self.finish(study, (code, args.audit.strict), written.as_ref(), run))
    }

    /// Computes the heat at each time.
    pub(super) fn heat(mut self, args: &HeatArgs, boundary: &Boundary, run: &mut Run) -> Result<Outcome, Failure> {
        args.sun.note_path(args.sun_path.as_deref(), &mut run.cx);
        let request = args.solver.request();
        let (study, written) = self.written(args.output.as_deref(), run, |on, sink, cx| {
            on.model
                .heat_along_sun_path(on.factors, (on.path, boundary), &request, sink, cx)
        })?;
        let bands = study
            .steps
            .iter()
            .flat_map(|step| step.solar.iter().chain([&step.thermal]));
        let is_exact = study.steps.iter().all(crate::workflow::HeatStep::is_exact);
        let code = self.code(bands.map(|band| band.stop_reason), &study, is_exact);
        Ok(self.finish(study, (code, args.audit.strict), written.as_ref(), run))
    }

    /// Runs `work` with a sink for the values of patches, which writes them.
    fn written<S>(
        &mut self,
        output: Option<&Path>,
        run: &mut Run,
        work: impl FnOnce(&mut Self, Option<BlockSink<'_>>, &mut Context) -> Result<PathStudy<S>, WorkflowError>,
    ) -> Result<(PathStudy<S>, Option<PathBuf>), Failure> {
        // Only the document contains the results of surfaces.
        run.cx.demand.drops_surfaces = !run.common.json;
        let Some(output) = output else {
            return Ok((work(self, None, &mut run.cx)?, None));
        };
        let mut writer = SeriesWriter::new(output)?;
        let study = work(self, Some(&mut |block| Ok(writer.push(block)?)), &mut run.cx)?;
        let report = SeriesReport {
            scene: &self.model.scene,
            mesh: &self.model.mesh,
            times: &self.path.times(),
            time_texts: &self.path.texts(),
            time_unit: self.path.unit(),
            settings: &run.cx.settings.record(),
        };
        let written = run.cx.time("write", || writer.finish(&report))?;
        Ok((study, Some(written)))
    }

    fn code<S>(&self, mut reasons: impl Iterator<Item = StopReason>, study: &PathStudy<S>, is_exact: bool) -> ExitCode {
        let is_done = reasons.all(|reason| reason == StopReason::Converged);
        if is_done && is_exact && study.error != TotalError::TooGreat {
            code_of(Some(self.factors))
        } else {
            ExitCode::NotConverged
        }
    }

    fn finish<S: Serialize + Send + 'static>(
        self,
        study: PathStudy<S>,
        code: (ExitCode, bool),
        written: Option<&PathBuf>,
        run: &mut Run,
    ) -> Outcome {
        run.bars.finish();
        let mut text = run.explanation(&self.model);
        describe_patches(&mut text, &self.model);
        run.describe_form_factors(&mut text, self.factors);
        let n = counted(study.steps.len(), "time");
        let _ = write!(
            text,
            "{n} of the sun, {}: {}",
            study.solver,
            counted(study.n_passes, "pass")
        );
        if let TotalError::Relative(error) = study.error {
            let _ = write!(
                text,
                ", largest relative error of a time about {error:.1e} (mesh excluded)"
            );
        }
        if study.n_resumed > 0 {
            let _ = write!(text, "; {} from the checkpoint", study.n_resumed);
        }
        let _ = writeln!(text);
        let mut document = PathDocument::new(&self.model, self.factors, self.path, study);
        let steps = std::mem::take(&mut document.steps);
        let document = run.document_of(&self.model, document).with_list("steps", steps);
        run.outcome(text, document, written, code)
    }
}
