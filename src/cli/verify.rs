//! The command `radiosity verify`.

use super::Outcome;
use super::args::VerifyArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::json::in_order;
use super::verify_text::describe;
use crate::document::VerifyDocument;
use crate::render::exr::reading_byte;
use crate::render::verify::{VerifyError, verify};
use crate::report::StageTimes;
use crate::workflow::{Memory, expect_room};

pub(super) fn run(args: &VerifyArgs) -> Result<Outcome, Failure> {
    let mut times = StageTimes::default();
    // Unreadable files are reported by the reader below.
    let memory = Memory {
        limit_byte: args.memory_limit,
        ..Memory::default()
    };
    if let Ok(needed) = reading_byte(&args.image) {
        expect_room(&args.image, "to read it", needed, &memory, "or render fewer pixels")?;
    }
    let report = times.time("verify", || verify(&args.image)).map_err(|error| {
        // Errors of reading name the file themselves.
        let message = match &error {
            VerifyError::Read(_) => error.to_string(),
            _ => format!("{}: {error}", args.image.display()),
        };
        Failure::new("verify", message).in_file(&args.image)
    })?;
    let (text, passed) = (describe(&report), report.passed);
    Ok(Outcome {
        text,
        document: in_order(&VerifyDocument::new(args.image.display().to_string(), times, report)).into(),
        code: if passed { ExitCode::Done } else { ExitCode::CheckFailed },
    })
}
