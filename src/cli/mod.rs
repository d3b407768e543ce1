//! The command-line program.

mod args;
mod checks;
mod compare;
mod exit_code;
mod failure;
mod field;
mod file_set;
mod form_factors;
mod frames;
mod frames_text;
mod heat;
mod interrupt;
mod json;
mod lightings;
mod manual;
mod output;
mod picture;
mod points;
mod progress;
mod ranks;
mod render;
mod reproduce;
mod reproduction;
mod run;
mod scene;
mod solution;
mod solve;
mod sun;
mod sun_path;
mod surface_table;
mod verify;
mod verify_text;
mod view;
mod voxel;
mod voxel_text;

use std::ffi::OsString;
use std::io::{self, BufWriter, Write};
use std::panic::{AssertUnwindSafe, PanicHookInfo};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use args::{Cli, Command, CommonArgs};
use clap::{CommandFactory as _, FromArgMatches as _};
pub use exit_code::ExitCode;
use failure::Failure;
use json::{JsonDocument, in_order};
use run::Run;

use crate::embree::return_freed_blocks;
use crate::printable::{printable, printable_message, quoted};
use crate::ranks::End;

/// The result of a command: text for people, the same as a document, and the exit code.
struct Outcome {
    text: String,
    document: JsonDocument,
    code: ExitCode,
}

/// Runs the program on its arguments (the first is the program's name) and returns its exit code.
///
/// Of several ranks the first one prints, or a single one that failed; all return the same exit code.
#[must_use]
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    if let Err((failure, is_first)) = ranks::start() {
        if is_first {
            complain(&failure.message);
        }
        return failure.code;
    }
    MUTE.store(!ranks::is_first(), Ordering::Relaxed);
    let answer = answer(&arguments);
    let all = ranks::of_run();
    let verdict = all.end(End {
        code: answer.code as u8,
        failed: answer.failure.is_some(),
    });
    if let Some(failure) = answer.failure.filter(|_| verdict.speaks) {
        MUTE.store(false, Ordering::Relaxed);
        if !failure.message.is_empty() && all.is_first() {
            complain(&failure.message);
        } else if !all.is_first() {
            complain(&format!("rank {} on {}: {}", all.rank(), all.host(), failure.message));
        }
        if answer.json {
            print_document(&in_order(&failure.document()).into());
        }
    }
    if verdict.aborts {
        all.abort(verdict.code);
    }
    ExitCode::of(verdict.code)
}

/// True on ranks that do not print.
static MUTE: AtomicBool = AtomicBool::new(false);

/// The first defect of a rank that does not print.
static DEFECT: Mutex<Option<String>> = Mutex::new(None);

/// The end of the work: its exit code and its unprinted failure.
struct Answer {
    code: ExitCode,
    failure: Option<Failure>,
    json: bool,
}

impl Answer {
    fn printed(code: ExitCode) -> Self {
        Self {
            code,
            failure: None,
            json: false,
        }
    }
}

fn answer(arguments: &[OsString]) -> Answer {
    let cli = match parse(arguments) {
        Ok(cli) => cli,
        Err(error) => return usage(&error, arguments),
    };
    let common = cli.command.common();
    let json = common.is_some_and(|common| common.json);
    return_freed_blocks();
    interrupt::outlive_size_limits();
    // A panic is a defect of the program: one line reports it as such.
    std::panic::set_hook(Box::new(|defect| {
        let text = format!("a defect of the program, please report it: {}", one_line(defect));
        if MUTE.load(Ordering::Relaxed) {
            let mut first = DEFECT.lock().unwrap_or_else(PoisonError::into_inner);
            first.get_or_insert(text);
        } else {
            complain(&text);
        }
    }));
    let defect = |_| {
        let mut first = DEFECT.lock().unwrap_or_else(PoisonError::into_inner);
        Err(Failure::new("defect", first.take().unwrap_or_default()))
    };
    let result = std::panic::catch_unwind(AssertUnwindSafe(|| {
        ranks::expect_shared(&cli.command)?;
        match (&cli.command, common) {
            (Command::Completions(a), _) => Ok(manual::completions(*a, command())),
            (Command::Man(a), _) => manual::pages(a, command()),
            (other, Some(common)) => run(other, common),
            (other, None) => unreachable!("a command that computes nothing: {other:?}"),
        }
    }))
    .unwrap_or_else(defect);
    match result {
        Ok(outcome) => {
            let printed = if json {
                print_document(&outcome.document)
            } else {
                print(&outcome.text)
            };
            Answer::printed(if printed { outcome.code } else { ExitCode::Error })
        }
        Err(failure) => Answer {
            code: failure.code,
            failure: Some(failure),
            json,
        },
    }
}

/// Returns the command line, in which a value may begin with a minus and a digit, so that its flag reports errors in numbers.
#[must_use]
pub fn command() -> clap::Command {
    Cli::command().mut_subcommands(|command| {
        command.mut_args(|argument| {
            let is_flag_with_value = !argument.is_positional() && argument.get_action().takes_values();
            argument.allow_negative_numbers(is_flag_with_value)
        })
    })
}

/// Joins negative numbers with an exponent to the flags before them: for clap, −1e-3 would be a flag.
fn with_exponents(arguments: &[OsString]) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::with_capacity(arguments.len());
    for argument in arguments {
        let is_number = argument
            .to_str()
            .is_some_and(|text| text.starts_with('-') && text.contains(['e', 'E']) && text.parse::<f64>().is_ok());
        match joined.last_mut() {
            Some(flag)
                if is_number
                    && flag
                        .to_str()
                        .is_some_and(|flag| flag.starts_with("--") && !flag.contains('=')) =>
            {
                flag.push("=");
                flag.push(argument);
            }
            _ => joined.push(argument.clone()),
        }
    }
    joined
}

/// Parses the arguments.
fn parse(arguments: &[OsString]) -> Result<Cli, clap::Error> {
    let mut matches = command().try_get_matches_from(with_exponents(arguments))?;
    Cli::from_arg_matches_mut(&mut matches)
}

fn run(command: &Command, common: &CommonArgs) -> Result<Outcome, Failure> {
    let reads_scene = !matches!(command, Command::Scene(_) | Command::Verify(_) | Command::Reproduce(_));
    if let (false, Some(flag)) = (reads_scene, common.reading.first_given()) {
        return Err(Failure::usage(format!(
            "{flag} says how a scene is read, and this command reads none"
        )));
    }
    let threads = common
        .threads
        .map_or_else(ranks::default_threads, std::num::NonZeroUsize::get);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| {
            Failure::new(
                "threads",
                format!("cannot start {threads} threads: {error}; give --threads a smaller number"),
            )
        })?;
    // All stages run inside the pool, so that --threads applies to them.
    pool.install(|| match command {
        Command::Scene(a) => scene::run(a),
        Command::FormFactors(a) => Run::of("form-factors", common, |run| form_factors::run(a, run)),
        Command::Solve(a) => Run::of("solve", common, |run| solve::run(a, run)),
        Command::Heat(a) => Run::of("heat", common, |run| heat::run(a, run)),
        Command::Points(a) => Run::of("points", common, |run| points::run(a, run)),
        Command::Render(a) => Run::of("render", common, |run| render::run(a, run)),
        Command::Field(a) => Run::of("field", common, |run| field::run(a, run)),
        Command::Voxel(a) => Run::of("voxel", common, |run| voxel::run(a, run)),
        Command::Verify(a) => verify::run(a),
        Command::Compare(a) => compare::run(a),
        Command::Reproduce(a) => reproduce::run(a),
        Command::Completions(_) | Command::Man(_) => unreachable!("they read no scene and need no threads"),
    })
}

/// Prints the help or version, or returns clap's message as a failure.
fn usage(error: &clap::Error, arguments: &[OsString]) -> Answer {
    use clap::error::ErrorKind;
    if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
        let printed = print(&error.render().to_string());
        return Answer::printed(if printed { ExitCode::Done } else { ExitCode::Error });
    }
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        if ranks::is_first() {
            // The whole help is the answer; printing only fails if stderr is closed.
            let _ = error.print();
        }
        return Answer::printed(ExitCode::Usage);
    }
    let mut line = usage_line(&error.render().to_string());
    for argument in arguments.iter().map(|argument| argument.to_string_lossy()) {
        let cut = quoted(&argument);
        if cut.len() < argument.len() {
            line = line.replace(&*argument, &cut);
        }
    }
    Answer {
        code: ExitCode::Usage,
        failure: Some(Failure::usage(line)),
        json: arguments.iter().any(|a| a == "--json"),
    }
}

/// Returns clap's message as one line: the error, the arguments or values that it lists, and its tips, without the usage.
fn usage_line(message: &str) -> String {
    let mut parts = message
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .take_while(|line| !line.starts_with("Usage:"))
        .filter(|line| !line.starts_with("For more information"));
    let mut text = parts
        .next()
        .unwrap_or_default()
        .trim_start_matches("error: ")
        .to_owned();
    for part in parts {
        let joint = match part {
            _ if text.ends_with(':') || part.starts_with('[') => " ",
            _ if part.starts_with("tip:") => "; ",
            _ => ", ",
        };
        text.push_str(joint);
        text.push_str(part.trim_start_matches("tip: "));
    }
    text.push_str("; see --help");
    text
}

fn print_document(document: &JsonDocument) -> bool {
    printed(|stdout| {
        serde_json::to_writer_pretty(&mut *stdout, document)?;
        writeln!(stdout)
    })
}

/// Writes a text to stdout; returns false if that failed, unless the reader closed the pipe.
fn print(text: &str) -> bool {
    printed(|stdout| stdout.write_all(text.as_bytes()))
}

fn printed(write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> bool {
    if MUTE.load(Ordering::Relaxed) {
        return true;
    }
    let mut stdout = BufWriter::new(io::stdout().lock());
    match write(&mut stdout).and_then(|()| stdout.flush()) {
        Ok(()) => true,
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => true,
        Err(error) => {
            complain(&format!("cannot write to standard output: {error}"));
            false
        }
    }
}

/// Returns the width of a column of names: the longest name, up to a limit.
fn name_width<'a>(names: impl IntoIterator<Item = &'a str>) -> usize {
    const MOST: usize = 60;
    let lengths = names.into_iter().map(|name| name.chars().count());
    lengths.max().unwrap_or(0).min(MOST)
}

/// Returns names as messages show them, and the width of their column.
fn printable_names<'a>(names: impl Iterator<Item = &'a str>) -> (Vec<String>, usize) {
    let names: Vec<String> = names.map(printable).collect();
    let width = name_width(names.iter().map(String::as_str));
    (names, width)
}

/// Returns a number for a column of a table: with six decimals in a middle range, else in scientific notation.
fn cell(value: f64) -> String {
    let size = value.abs();
    if size > 0.0 && size.is_finite() && !(1e-3..1e5).contains(&size) {
        format!("{value:>12.5e}")
    } else {
        format!("{value:>12.6}")
    }
}

fn one_line(defect: &PanicHookInfo<'_>) -> String {
    let payload = defect.payload();
    let known = payload
        .downcast_ref::<&str>()
        .copied()
        .or(payload.downcast_ref::<String>().map(String::as_str));
    let text = known.unwrap_or("unknown").replace('\n', " ");
    defect.location().map_or_else(
        || text.clone(),
        |place| format!("{text} ({}:{})", place.file(), place.line()),
    )
}

/// Writes one line to stderr.
fn complain(message: &str) {
    if MUTE.load(Ordering::Relaxed) {
        return;
    }
    let _ = writeln!(io::stderr(), "radiosity: {}", printable_message(message));
}

/// Writes a warning to stderr.
fn warn(message: &str) {
    let _ = writeln!(io::stderr(), "radiosity: warning: {}", printable_message(message));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_keep_their_width_and_their_digits() {
        let cells = [0.0, 0.377_803, 1234.5, 1e300, -2.5e-300, 99_999.5, 4.56e-4].map(cell);
        assert_eq!(
            cells,
            [
                "    0.000000",
                "    0.377803",
                " 1234.500000",
                " 1.00000e300",
                "-2.50000e-300",
                "99999.500000",
                "  4.56000e-4"
            ]
        );
    }
}
