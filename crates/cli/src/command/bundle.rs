//! `linesman bundle`: what a bundle holds, and one that can be given away.

mod anonymise;
mod info;
pub(crate) mod recording;

use std::path::Path;

use linesman_link::capture::CaptureError;
use linesman_link::input::{Content, Input};
use linesman_runtime::bundle::{Bundle, BundleFinding};

use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;
use crate::text::names::Names;

/// BundleAction can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Bundles are written by `run --bundles DIR` and `diagnose WHERE --bundles DIR`; `linesman diagnose BUNDLE` \
                  judges one again."
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    what: BundleAction,
}

/// BundleAction is done with a bundle.
#[derive(clap::Subcommand, Debug)]
enum BundleAction {
    /// BundleAction it holds, what set it off, what is not in it
    Info(info::Arguments),
    /// Another one without names, serial numbers, process data and addresses of network cards, in which the same is found
    Anonymise(anonymise::Arguments),
}

impl Arguments {
    /// Whether the answer is to be JSON.
    pub(crate) fn wants_json(&self) -> bool {
        match &self.what {
            BundleAction::Info(arguments) => arguments.json,
            BundleAction::Anonymise(arguments) => arguments.json,
        }
    }
}

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    match &arguments.what {
        BundleAction::Info(arguments) => info::run(arguments, output),
        BundleAction::Anonymise(arguments) => anonymise::run(arguments, output),
    }
}

fn open(path: &Path) -> Result<Bundle, Failure> {
    let input = Input::open(path).map_err(CaptureError::from)?;
    if input.content() != Content::Archive {
        let reason = format!("{}: no bundle, expected a zip archive", path.display());
        return Err(Failure::new(reason, "name a file that `--bundles` has written"));
    }
    Ok(Bundle::of(input)?)
}

/// The frames of an input: those of a bundle, where it is one.
pub(crate) fn frames(input: Input) -> Result<Input, Failure> {
    match input.content() {
        Content::Archive => Ok(Bundle::frames_of(input)?),
        Content::Capture | Content::Text => Ok(input),
    }
}

/// Findings in a line: code, cause and place of each.
pub(crate) fn findings_in_words(findings: &[BundleFinding]) -> String {
    let names = Names::default();
    let words = findings.iter().map(|finding| {
        format!("{} {} at {}", finding.code, finding.cause, names.place(&finding.place))
    });
    words.collect::<Vec<_>>().join(", ")
}
