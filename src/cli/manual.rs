//! The commands `radiosity completions` and `radiosity man`: descriptions of the command line for shells and for readers.

use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;

use super::Outcome;
use super::args::{CompletionsArgs, ManArgs, ShellName};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::json::JsonDocument;
use super::output::{make_directory, write_all};

const NAME: &str = "radiosity";

/// Returns the completions of a shell.
pub(super) fn completions(args: CompletionsArgs, mut command: Command) -> Outcome {
    let shell = match args.shell {
        ShellName::Bash => Shell::Bash,
        ShellName::Zsh => Shell::Zsh,
        ShellName::Fish => Shell::Fish,
    };
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command, NAME, &mut script);
    done(String::from_utf8_lossy(&script).into_owned())
}

/// Writes a manual page of the program and one of each command.
pub(super) fn pages(args: &ManArgs, mut command: Command) -> Result<Outcome, Failure> {
    make_directory(&args.directory)?;
    command.build();
    let is_listed = |own: &&Command| own.get_name() != "help";
    let commands: Vec<Command> = command.get_subcommands().filter(is_listed).cloned().collect();
    let mut files = Vec::new();
    for own in std::iter::once(command).chain(commands) {
        let page = Man::new(own);
        let mut text = Vec::new();
        // Writing to memory cannot fail.
        let _ = page.render(&mut text);
        files.push((page.get_filename(), text));
    }
    let (_, line) = write_all(&args.directory, &files)?;
    Ok(done(format!("{line}\n")))
}

fn done(text: String) -> Outcome {
    Outcome {
        text,
        document: JsonDocument::default(),
        code: ExitCode::Done,
    }
}
