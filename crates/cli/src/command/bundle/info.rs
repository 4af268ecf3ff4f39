//! `linesman bundle info`: the manifest of a bundle.

use std::path::PathBuf;

use linesman_runtime::bundle::{MEMBERS, Manifest};

use super::{findings_in_words, open};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;
use crate::text::quantity::{count, time};

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The bundle
    #[arg(value_name = "BUNDLE.zip")]
    bundle: PathBuf,
    /// JSON, schema linesman.bundle/1: its manifest
    #[arg(long)]
    pub(super) json: bool,
}

/// Tells what it holds.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let bundle = open(&arguments.bundle)?;
    if arguments.json {
        output.json(&bundle.manifest);
        return Ok(Status::Good);
    }
    for line in lines(&bundle.manifest) {
        output.line(&line);
    }
    output.line(&format!("members   at most {}", MEMBERS.join(", ")));
    Ok(Status::Good)
}

fn lines(manifest: &Manifest) -> Vec<String> {
    let mut lines = vec![
        format!("written   by {}", manifest.tool),
        format!("source    {}", manifest.source),
        format!("run       began {}", manifest.start.as_deref().unwrap_or("in virtual time")),
    ];
    for trigger in &manifest.triggers {
        let finding = findings_in_words(std::slice::from_ref(&trigger.finding));
        lines.push(format!("set off   {} at {}: {finding}", trigger.id, time(trigger.at_ns.0)));
    }
    for stretch in &manifest.stretches {
        let (from, to) = (time(stretch.from_ns.0), time(stretch.to_ns.0));
        let left_out = match stretch.left_out_before.0 {
            0 => String::new(),
            left_out => format!(", {} before it left out", count(left_out, "frame")),
        };
        let frames = count(stretch.frames.0, "frame");
        lines.push(format!("frames    {from} to {to}: {frames}{left_out}"));
    }
    lines.extend(manifest.left_out.iter().map(|what| format!("left out  {what}")));
    if let Some(replaced) = manifest.anonymised {
        lines.push(format!("replaced  {}", super::anonymise::told(&replaced)));
    }
    lines
}
