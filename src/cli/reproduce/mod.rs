//! `radiosity reproduce`.

mod baranoski;
mod lewis;
mod malgouyres;
mod pictures;
mod solvers;
mod stability;

use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::ValueEnum as _;
use serde_json::{Value, json};

use super::Outcome;
use super::args::{PaperName, ReproduceArgs};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::output::{self, Files};
use super::run::Run;

pub(super) fn run(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    match args.paper {
        PaperName::Baranoski => baranoski::run(args),
        PaperName::Stability => stability::run(args),
        PaperName::Lewis => lewis::run(args),
        PaperName::Malgouyres => malgouyres::run(args),
        PaperName::Pictures => pictures::run(args),
    }
}

/// A paper's tables on their way into a directory.
struct Reproduction {
    run: Run,
    directory: PathBuf,
}

/// What was found. Files that hold times of ours have `time` in their names, as `index.html` does; the others are the same bytes in every run.
struct Findings {
    /// The report as it is printed.
    printed: String,
    files: Files,
    /// The command's own part of the document.
    result: Value,
    /// What to warn of, if a figure of ours is not what it must be.
    wrong: Option<String>,
}

impl Reproduction {
    /// Makes the directory before any work is done for it.
    fn new(args: &ReproduceArgs) -> Result<Self, Failure> {
        let paper = args.paper.to_possible_value();
        let paper = paper.as_ref().map_or("", |value| value.get_name());
        let default = || PathBuf::from(format!("reproduce-{paper}"));
        let directory = args.output.clone().unwrap_or_else(default);
        output::make_directory(&directory)?;
        let mut run = Run::new("reproduce", &args.common);
        run.cx.set("paper", json!(args.paper));
        Ok(Self { run, directory })
    }

    /// Writes the files and says so.
    fn finish(self, findings: Findings) -> Result<Outcome, Failure> {
        let Findings {
            printed,
            mut files,
            mut result,
            wrong,
        } = findings;
        self.run.bars.finish();
        output::add_page(&mut files, &printed, &self.run.cx.settings);
        let (names, written) = output::write_all(&self.directory, &files)?;
        result["files"] = json!(names);
        if let Some(wrong) = &wrong {
            self.run.warn(wrong);
        }
        Ok(Outcome {
            text: format!("{printed}\n{written}\n"),
            document: self.run.document(result),
            code: wrong.map_or(ExitCode::Done, |_| ExitCode::CheckFailed),
        })
    }
}

/// Reads a list like `3,5-7` of tables that are built.
fn parse_tables(list: &str, built: RangeInclusive<u8>) -> Result<Vec<u8>, Failure> {
    let (least, most) = (built.start(), built.end());
    let mut tables = Vec::new();
    for part in list.split(',') {
        let ends = part.split_once('-').unwrap_or((part, part));
        let number = |text: &str| text.trim().parse::<u8>().ok();
        let range = number(ends.0).zip(number(ends.1)).filter(|(a, b)| a <= b);
        let Some((first, last)) = range else {
            return Err(Failure::usage(format!(
                "`{part}` names no tables; write --tables {least}-{most} or --tables {least},{most}"
            )));
        };
        if !(built.contains(&first) && built.contains(&last)) {
            return Err(Failure::usage(format!(
                "`{part}`: of this paper tables {least} to {most} are built; write --tables {least}-{most}"
            )));
        }
        tables.extend(first..=last);
    }
    tables.sort_unstable();
    tables.dedup();
    Ok(tables)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_tables() {
        let read = |list: &str| parse_tables(list, 3..=8).map_err(|failure| failure.message);
        assert_eq!(read("3-8"), Ok(vec![3, 4, 5, 6, 7, 8]));
        assert_eq!(read("7, 3,5-7"), Ok(vec![3, 5, 6, 7]));
        for wrong in ["", "2", "3-9", "8-3", "x", "3-"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
