//! The command line: parse, dispatch, print an error with its hint, exit code.

use std::process::ExitCode;

use clap::Parser;
use plychain::cli::{Cli, line, run};

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let code = if error.use_stderr() { 1 } else { 0 };
            // Nothing better to do than to exit if even this cannot be printed.
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            line(&format!("error: {error}"));
            if let Some(hint) = error.hint_text() {
                line(&format!("hint: {hint}"));
            }
            ExitCode::from(error.exit_code())
        }
    }
}
