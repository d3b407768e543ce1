//! The text that the program prints about the poses of a sequence.
//!
//! Writing to a String cannot fail; the results of `write!` are dropped for that reason.

use std::fmt::Write as _;

use super::checks::describe_checks;
use super::solution::solver_line;
use crate::document::{PoseRecord, UpdateRecord};
use crate::workflow::PoseStudy;

/// Describes a pose: its frames, its solution, and its reuse of the first pose's form factors.
pub(super) fn describe_pose(text: &mut String, solver: &str, study: &PoseStudy<'_>, record: &PoseRecord) {
    let lightings = match study.n_lightings {
        1 => "1 lighting".to_owned(),
        n => format!("{n} lightings solved together"),
    };
    let _ = writeln!(text, "{}: {lightings}", record.frames.join(", "));
    let _ = writeln!(text, "{}", solver_line(solver, study.solution, study.error));
    if let Some(update) = &record.update {
        describe_update(text, update);
    }
    describe_checks(text, study.factors);
}

fn describe_update(text: &mut String, update: &UpdateRecord) {
    let UpdateRecord {
        n_moved_faces, n_kept, ..
    } = update;
    let _ = match update.n_recomputed {
        Some(n) if *n_kept > 0 => writeln!(
            text,
            "{n_moved_faces} faces moved: {n} of {} form factors between pairs computed anew, the others are as before",
            n + n_kept
        ),
        _ => writeln!(text, "{n_moved_faces} faces moved: all form factors computed anew"),
    };
}
