//! Sequences of images.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use pyo3::prelude::*;
use radiosity::document::{FrameRecord, FramesDocument, PoseRecord, SolverRecord};
use radiosity::scene::frames;
use radiosity::workflow::{
    Afterwards, Daylight, Demand, FrameDefaults, FrameStudy, ImageFile, Parameter, PoseStudy, Sequence,
    SequenceObserver, SequenceRequest,
};

use crate::call::Call;
use crate::error::bad_argument;
use crate::image::{Wanted, view};
use crate::model::{Shared, call};
use crate::options::Options;

/// The records of a sequence.
struct Records<'a> {
    /// The name of the requested solver.
    solver: &'a str,
    naming: fn(Parameter, Option<&str>) -> String,
    poses: Vec<(SolverRecord, PoseRecord)>,
    frames: Vec<(usize, FrameRecord)>,
}

impl SequenceObserver for Records<'_> {
    fn frame(&mut self, study: &FrameStudy<'_>) {
        self.frames.push((study.number, FrameRecord::new(study, &self.naming)));
    }

    fn pose(&mut self, study: &PoseStudy<'_>) {
        let solved = SolverRecord::new(study.model, self.solver, study.solution, study.error);
        let record = PoseRecord::new(study, &solved);
        self.poses.push((solved, record));
    }
}

/// Renders all frames of a list, and returns the document as the program prints it.
///
/// The list is a text in TOML with its name for messages, or without a text the file of that name.
pub(crate) fn render(
    py: Python<'_>,
    shared: &Arc<Shared>,
    (text, name): (String, String),
    output: &Path,
    options: &Options<'_>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    if output
        .extension()
        .is_none_or(|ending| !ending.eq_ignore_ascii_case("exr"))
    {
        return Err(bad_argument(
            py,
            "output: images are written as .exr, with previews beside them",
        ));
    }
    let of_factors = options.table("form_factors")?;
    let (factors, memory) = (of_factors.form_factors(Afterwards::Image)?, of_factors.memory()?);
    of_factors.finish()?;
    let solver = options.solver()?;
    let daylight = Daylight {
        sun: options.sun(DVec3::Z)?,
        sky: options.sky(DVec3::Z)?,
    };
    let (seen, wanted) = (view(options)?, Wanted::of(py, options, false)?);
    let checkpoint = options.take::<PathBuf>("checkpoint")?;
    options.finish()?;
    let call = Call {
        memory,
        checkpoint,
        demand: Demand {
            output: Some(output.to_owned()),
            tolerance: Some(solver.tolerance),
            ..Demand::default()
        },
        ..call(progress, &shared.settings)
    };
    let done = call.run(py, |cx| {
        let list = PathBuf::from(name);
        let listed = if text.is_empty() {
            frames::load(&list)?
        } else {
            frames::parse(text, &list)?
        };
        let model = shared.lock();
        let defaults = FrameDefaults {
            scene_file: &model.file,
            view: &seen,
            settings: &|is_unfolded| wanted.settings(is_unfolded),
            output,
        };
        let all = Sequence::new(&list, listed, &model, &defaults)?;
        all.announce(&model, cx)?;
        let request = SequenceRequest {
            method: &factors,
            solver: &solver,
            daylight,
            file: ImageFile::default(),
            viewer: None,
        };
        let mut records = Records {
            solver: &solver.solver,
            naming: cx.naming,
            poses: Vec::new(),
            frames: Vec::new(),
        };
        all.render(&model, request, &mut records, cx)?;
        records.frames.sort_by_key(|(number, _)| *number);
        let of_frames = records.frames.into_iter().map(|(_, record)| record).collect();
        Ok(FramesDocument::new(records.poses, of_frames, all.lightings.len()))
    })?;
    Ok(serde_json::to_string(&done.value).unwrap_or_default())
}
