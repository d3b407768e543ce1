//! The reproduction of a paper's tables, with its directory.

use std::path::PathBuf;

use clap::ValueEnum as _;
use serde::Serialize;

use super::args::ReproduceArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::run::Run;
use super::{Outcome, output};
use crate::experiment::findings::{Findings, Reproduced};

/// The reproduction of a paper's tables, with its directory.
pub(super) struct Reproduction {
    pub(super) run: Run,
    directory: PathBuf,
}

impl Reproduction {
    /// Makes the directory before any work.
    pub(super) fn new(args: &ReproduceArgs) -> Result<Self, Failure> {
        let paper = args.paper.to_possible_value();
        let paper = paper.as_ref().map_or("", |value| value.get_name());
        let default = || PathBuf::from(format!("reproduce-{paper}"));
        let directory = args.output.clone().unwrap_or_else(default);
        output::make_directory(&directory)?;
        let mut run = Run::new("reproduce", &args.common);
        run.cx.settings.paper = Some(paper.to_owned());
        Ok(Self { run, directory })
    }

    /// Writes the files, and returns the report.
    pub(super) fn finish(self, findings: Findings<impl Serialize>) -> Result<Outcome, Failure> {
        let (printed, mut files) = (findings.printed, findings.files);
        self.run.bars.finish();
        output::add_page(&mut files, &findings.captions, &printed, &self.run.cx.settings);
        let (names, written) = output::write_all(&self.directory, &files)?;
        if let Some(wrong) = &findings.wrong {
            self.run.warn(wrong);
        }
        let result = Reproduced {
            found: findings.document,
            files: names.into_iter().map(str::to_owned).collect(),
        };
        Ok(Outcome {
            text: format!("{printed}\n{written}\n"),
            document: self.run.document(result),
            code: findings.wrong.map_or(ExitCode::Done, |_| ExitCode::CheckFailed),
        })
    }
}
