//! The page of all flags, from the definition of the command line.

use std::fmt::Write as _;

use clap::{Arg, Command};
use radiosity::cli;

use super::{cell, code, pages, read};

/// One flag with all commands in which it is the same.
struct Row {
    heading: String,
    flag: String,
    meaning: String,
    commands: Vec<String>,
}

/// Returns the page.
pub(super) fn page() -> String {
    let mut program = cli::command();
    program.build();
    let commands: Vec<&Command> = program
        .get_subcommands()
        .filter(|own| own.get_name() != "help")
        .collect();
    let rows = rows(&commands);
    let mut headings: Vec<&str> = Vec::new();
    for row in &rows {
        if !headings.contains(&row.heading.as_str()) {
            headings.push(&row.heading);
        }
    }
    let mut page = "# Flags\n\nThis page is generated from the command line itself. `radiosity COMMAND --help` prints the same for one command.\n\n## Commands\n\n\
        | command | purpose |\n|---|---|\n"
        .to_owned();
    for command in &commands {
        let usage = (*command).clone().render_usage().to_string();
        let usage = usage.trim_start_matches("Usage: ");
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        let _ = writeln!(page, "| {} | {} |", code(usage), cell(&about));
    }
    let _ = write!(page, "\n{}\n", program.get_after_help().unwrap());
    for heading in headings {
        let _ = write!(page, "\n## {heading}\n\n| flag | meaning | commands |\n|---|---|---|\n");
        for row in rows.iter().filter(|row| row.heading == heading) {
            let of = if row.commands.len() == commands.len() {
                "all".to_owned()
            } else {
                row.commands.join(", ")
            };
            let _ = writeln!(page, "| {} | {} | {of} |", code(&row.flag), row.meaning);
        }
    }
    page
}

/// Returns the flags of all commands, those under a heading that several commands have together.
fn rows(commands: &[&Command]) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for command in commands {
        let shown = command.get_arguments().filter(|argument| !argument.is_hide_set());
        for argument in shown.filter(|argument| !matches!(argument.get_id().as_str(), "help" | "version")) {
            let heading = argument.get_help_heading().unwrap_or("Input and output").to_owned();
            let (flag, meaning) = (flag(argument), meaning(argument));
            let name = format!("`{}`", command.get_name());
            match rows.iter_mut().find(|row| row.flag == flag && row.meaning == meaning) {
                Some(row) => row.commands.push(name),
                None => rows.push(Row {
                    heading,
                    flag,
                    meaning,
                    commands: vec![name],
                }),
            }
        }
    }
    rows
}

/// Returns a flag as it is given, with the name of its value.
fn flag(argument: &Arg) -> String {
    if argument.is_positional() {
        return argument.to_string();
    }
    let long = argument.to_string();
    argument
        .get_short()
        .map_or(long.clone(), |short| format!("-{short}, {long}"))
}

/// Returns the help of a flag with its values and its default.
fn meaning(argument: &Arg) -> String {
    let mut text = cell(&argument.get_help().map(ToString::to_string).unwrap_or_default());
    let values = argument.get_possible_values();
    if argument.get_action().takes_values() && !values.is_empty() {
        let shown = values.iter().filter(|value| !value.is_hide_set());
        let names: Vec<String> = shown
            .map(|value| match value.get_help() {
                Some(help) => format!("`{}` ({})", value.get_name(), cell(&help.to_string())),
                None => format!("`{}`", value.get_name()),
            })
            .collect();
        let _ = write!(text, ": {}", names.join(", "));
    }
    let defaults: Vec<String> = argument
        .get_default_values()
        .iter()
        .map(|value| value.display().to_string())
        .collect();
    if argument.get_action().takes_values() && !defaults.is_empty() {
        let _ = write!(text, " \\[default: {}\\]", defaults.join(", "));
    }
    text
}

#[test]
fn the_page_has_every_command_and_no_row_twice() {
    let page = page();
    for command in cli::command().get_subcommands() {
        assert!(
            page.contains(&format!("| `radiosity {}", command.get_name())),
            "{}",
            command.get_name()
        );
    }
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| `-")).collect();
    let mut once = rows.clone();
    once.sort_unstable();
    once.dedup();
    assert_eq!(once.len(), rows.len());
    assert!(rows.len() > 80, "{}", rows.len());
}

/// Returns the flags in a text that is code.
fn flags_in(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-'));
    words.filter(|word| word.starts_with("--") && word.len() > 2)
}

#[test]
fn every_flag_that_a_page_names_exists() {
    let mut program = cli::command();
    program.build();
    let known: Vec<String> = program
        .get_subcommands()
        .flat_map(Command::get_arguments)
        .filter_map(|argument| argument.get_long().map(|name| format!("--{name}")))
        .collect();
    let mut n_flags = 0;
    // CONTRIBUTING.md shows how a flag is added.
    for path in pages().into_iter().filter(|path| !path.ends_with("CONTRIBUTING.md")) {
        let text = read(&path);
        // Lines of commands, and code that begins with a flag: other programs have flags of their own.
        let commands = text.lines().filter(|line| line.starts_with("radiosity "));
        let inline = text.split('`').skip(1).step_by(2).filter(|code| code.starts_with("--"));
        for flag in commands.chain(inline).flat_map(flags_in) {
            n_flags += 1;
            assert!(known.iter().any(|name| name == flag), "{}: {flag}", path.display());
        }
    }
    assert!(n_flags > 150, "{n_flags}");
    assert!(flags_in("radiosity a --b-c=1 -d --").eq(["--b-c"]));
}
