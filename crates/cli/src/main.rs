//! The command line of Linesman.
//!
//! [`cli`] says which commands there are, one file of [`command`] does each. A command writes its
//! answer through [`output`] and ends with an [`exit::Status`], or with a [`failure::Failure`] when
//! nothing could be judged.

mod amount;
mod cli;
mod command;
mod drawing;
mod exit;
mod failure;
mod files;
mod hint;
mod output;
mod page;
mod text;
mod version;

use std::process::ExitCode;

use clap::Parser;
use linesman_runtime::part::guard;

use crate::cli::Cli;
use crate::failure::Failure;
use crate::output::Output;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    let mut output = Output::new(cli.color).at(cli.command.place());
    let json = cli.command.wants_json();
    // A fault of the program itself ends it like any other failure.
    let ran = guard("linesman", "there is no answer", || command::run(cli.command, &mut output));
    let ended = match ran.unwrap_or_else(|failure| Err(failure.into())) {
        // What was said to have failed on the way keeps the command from being a success.
        Ok(exit::Status::Good) if output.has_failed() => exit::Status::NotJudged.into(),
        Ok(status) => status.into(),
        Err(failure) => refuse(&failure, json, &mut output),
    };
    match output.loss() {
        None => ended,
        // An answer that is not whole is none, whatever it was.
        Some(loss) => {
            output.complain(&loss);
            exit::Status::NotJudged.into()
        }
    }
}

/// Says why nothing could be judged.
fn refuse(failure: &Failure, json: bool, output: &mut Output) -> ExitCode {
    let failure = output.made(failure);
    if json {
        output.json(&failure.report());
    }
    output.complain(&failure);
    exit::Status::NotJudged.into()
}

/// Help and version are answers; everything else that clap says is about a wrong command line.
fn usage(error: &clap::Error) -> ExitCode {
    let wants_json = std::env::args_os().any(|argument| argument == "--json");
    if error.use_stderr() && wants_json {
        let text = error.to_string();
        // What is wrong stands before the first empty line, often over several lines.
        let wrong = text.lines().take_while(|line| !line.trim().is_empty());
        let reason = wrong.map(str::trim).collect::<Vec<_>>().join(" ");
        let failure = Failure::new(reason.trim_start_matches("error: "), "see `linesman --help`");
        return refuse(&failure, true, &mut Output::new(cli::ColorChoice::Never));
    }
    // A closed pipe is the only thing that can go wrong here.
    let _ = error.print();
    if error.use_stderr() { exit::Status::NotJudged.into() } else { ExitCode::SUCCESS }
}
