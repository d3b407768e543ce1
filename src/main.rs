//! The command-line program: parse, run, map the result to an exit code.

use std::process::ExitCode;

fn main() -> ExitCode {
    radiosity::cli::main(std::env::args_os()).into()
}
