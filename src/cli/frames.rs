//! The command `radiosity render --frames`: a sequence of lightings, cameras and poses.

use std::fmt::Write as _;
use std::path::Path;

use super::Outcome;
use super::args::RenderArgs;
use super::checks::describe_work;
use super::exit_code::ExitCode;
use super::failure::{Failure, flag};
use super::file_set::FileSet;
use super::frames_text::describe_pose;
use super::picture::{image_file, preview_of};
use super::run::Run;
use super::solution;
use super::sun;
use super::view::{expect_sensible, render_settings};
use crate::document::{FrameRecord, FramesDocument, PoseRecord, SolverRecord};
use crate::printable::counted;
use crate::scene::frames;
use crate::workflow::{
    Afterwards, FrameDefaults, FrameStudy, PoseStudy, Sequence, SequenceObserver, SequenceRequest, image_patches,
};

/// The report of a sequence.
struct Told<'a> {
    /// The name of the requested solver.
    solver: &'a str,
    /// True if the text includes the cost of the form factors.
    explain: bool,
    poses: Vec<(SolverRecord, PoseRecord)>,
    text: String,
    /// Frames by their numbers, each with the line about its written files.
    frames: Vec<(usize, FrameRecord, String)>,
    code: ExitCode,
}

impl SequenceObserver for Told<'_> {
    fn frame(&mut self, study: &FrameStudy<'_>) {
        let record = FrameRecord::new(study, &flag);
        let line = format!(
            "{}: wrote {} ({} × {}) and {}\n",
            record.name, record.image, record.width, record.height, record.preview
        );
        if study.gather.is_some_and(|report| report.n_above > 0) {
            self.code = ExitCode::NotConverged;
        }
        self.frames.push((study.number, record, line));
    }

    fn pose(&mut self, study: &PoseStudy<'_>) {
        let solved = SolverRecord::new(study.model, self.solver, study.solution, study.error);
        let record = PoseRecord::new(study, &solved);
        describe_pose(&mut self.text, self.solver, study, &record);
        if self.explain {
            describe_work(&mut self.text, study.factors);
        }
        if solution::code(study.solution, Some(study.factors), study.error) != ExitCode::Done {
            self.code = ExitCode::NotConverged;
        }
        self.poses.push((solved, record));
    }
}

pub(super) fn run(args: &RenderArgs, file: &Path, run: &mut Run) -> Result<Outcome, Failure> {
    expect_sensible(&args.image)?;
    let wanted = frames::load(file)?;
    run.has_lightings = true;
    run.expect(&args.storage, args.solver.demand(Some(&args.output)));
    let model = run.prepare(&args.scene, args.mesh, image_patches)?;
    let defaults = FrameDefaults {
        scene_file: &args.scene,
        view: &args.image.view.request(),
        settings: &|is_unfolded| render_settings(args, is_unfolded),
        output: &args.output,
    };
    let all = Sequence::new(file, wanted, &model, &defaults)?;
    files(args, file, &all)?.check()?;
    let lighting_files = all.lighting_files.iter().map(Option::as_deref);
    let lightings: Vec<_> = lighting_files.zip(all.lightings.iter().map(Option::as_ref)).collect();
    let daylight = sun::daylight(&args.sun)?;
    if daylight.shines() {
        args.sun.note(&mut run.cx);
    } else {
        run.warn_of_darkness(&model, &lightings);
    }
    all.announce(&model, &mut run.cx)?;
    let request = SequenceRequest {
        method: &run.request(&args.method, args.form_factor_tolerance, Afterwards::Image),
        solver: &args.solver.request(),
        daylight,
        file: image_file(args.file),
        viewer: args.display.as_deref(),
    };
    let mut told = Told {
        solver: &args.solver.solver,
        explain: args.common.explain,
        poses: Vec::new(),
        text: String::new(),
        frames: Vec::new(),
        code: ExitCode::Done,
    };
    let posed = all.render(&model, request, &mut told, &mut run.cx)?;
    run.bars.finish();
    told.frames.sort_by_key(|(number, ..)| *number);
    let written: String = told.frames.iter().map(|(.., line)| line.as_str()).collect();
    let records = told.frames.into_iter().map(|(_, record, _)| record).collect();
    let document = FramesDocument::new(told.poses, records, all.lightings.len());
    let mut text = run.explanation(&posed);
    let counts = (posed.mesh.n_patches(), counted(all.frames.len(), "frame"));
    let _ = write!(text, "{} patches, {}\n{}", counts.0, counts.1, told.text);
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    text.push_str(&written);
    Ok(Outcome {
        text,
        document: run.document_of(&posed, document),
        code: run.judged(told.code, args.audit.strict),
    })
}

fn files(args: &RenderArgs, list: &Path, all: &Sequence) -> Result<FileSet, Failure> {
    let mut files = FileSet::default();
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the list of frames", Some(list));
    for frame in &all.frames {
        preview_of(&frame.output)?;
        files.writes_picture(&format!("picture of frame `{}`", frame.name), &frame.output);
        files.reads("a lighting", all.lighting_files[frame.lighting].as_deref());
        files.reads("a camera", frame.camera_file.as_deref());
    }
    Ok(files)
}
