//! `plychain completions` and `plychain man`: made from the command line's own description.

use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Cli, print};
use crate::error::{Error, Result};

/// Arguments of `completions`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain completions bash > ~/.local/share/bash-completion/completions/plychain
  plychain completions zsh > ~/.zfunc/_plychain")]
pub struct CompletionsArguments {
    /// The shell
    shell: Shell,
}

pub fn completions(arguments: &CompletionsArguments) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command(), "plychain", &mut text);
    print(&String::from_utf8_lossy(&text))
}

/// Arguments of `man`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  plychain man | man -l -
  plychain man --out ~/.local/share/man/man1")]
pub struct ManArguments {
    /// Directory for the pages of the program and of every verb (default: the program's page on standard output)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn man(arguments: &ManArguments) -> Result<()> {
    let command = Cli::command().name("plychain");
    let Some(folder) = &arguments.out else {
        let mut text = Vec::new();
        clap_mangen::Man::new(command)
            .render(&mut text)
            .map_err(|e| Error::program("man", "a page").found(e))?;
        return print(&String::from_utf8_lossy(&text));
    };
    let failed = |e: std::io::Error| {
        let place = format!("--out {}", folder.display());
        Error::input(place, "a directory that can be written").found(e)
    };
    std::fs::create_dir_all(folder).map_err(failed)?;
    clap_mangen::generate_to(command, folder).map_err(failed)?;
    print(&format!("written to {}\n", folder.display()))
}
