//! `linesman lab merge`: parts of a score or of a swarm, played by several processes or machines, added up.

use std::path::{Path, PathBuf};

use linesman_lab::habit::Habit;
use linesman_lab::part::{PartError, SeedPart};
use linesman_lab::score::parts;
use linesman_lab::swarm::run as swarm;
use linesman_lab::swarm::{SeedSum, SwarmReport};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::score;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Parts that `lab score --part` or `lab swarm --part` has written; their seeds must follow one another without a gap
    #[arg(required = true, value_name = "PART.json")]
    parts: Vec<PathBuf>,
    /// Exit with 1 when fewer than so many of 100 single faults have cause and place right, admitted sets counted: when
    /// even the upper end of the 95 % interval lies below
    #[arg(long, value_name = "PERCENT", value_parser = clap::value_parser!(u8).range(1..=100))]
    floor: Option<u8>,
    /// Also each case that was judged wrongly, with what was said
    #[arg(long)]
    list: bool,
    /// JSON, schema linesman.score/2
    #[arg(long)]
    pub(crate) json: bool,
}

/// Adds them up: parts of a score or parts of a swarm, as the first one says.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let mut texts = Vec::with_capacity(arguments.parts.len());
    for path in &arguments.parts {
        texts.push((path.as_path(), files::text(path, "a part of a score or of a swarm")?));
    }
    let is_swarm = texts.first().is_some_and(|(_, text)| {
        serde_json::from_str::<PartFormat>(text)
            .is_ok_and(|format| format.schema == swarm::PART_SCHEMA)
    });
    if !is_swarm {
        let tally = parts::merge(read(&texts)?).map_err(|error| wrong(&error))?;
        return Ok(score::show(
            &tally.report(),
            arguments.json,
            arguments.list,
            arguments.floor,
            output,
        ));
    }
    if arguments.json || arguments.list || arguments.floor.is_some() {
        return Err(Failure::new(
            "these are parts of a swarm: `--json`, `--list` and `--floor` are for a score",
            "give the parts alone",
        ));
    }
    let whole = SeedPart::join(read(&texts)?, swarm::PART_SCHEMA, |seed: &SeedSum| seed.seed)
        .map_err(|error| wrong(&error))?;
    let _: Habit = whole.options;
    for seed in &whole.cases {
        output.line(&seed.words);
    }
    let report = SwarmReport { seeds: whole.cases };
    output.line(&super::sum(&report));
    Ok(super::status_of(&report))
}

/// The one key by which formats are told apart.
#[derive(serde::Deserialize)]
struct PartFormat {
    schema: String,
}

fn read<O: DeserializeOwned, C: DeserializeOwned>(
    texts: &[(&Path, String)],
) -> Result<Vec<SeedPart<O, C>>, Failure> {
    let one = |(path, text): &(&Path, String)| {
        serde_json::from_str(text).map_err(|error| {
            files::in_file_of(
                path,
                &error,
                "give files that `lab score --part` or `lab swarm --part` has written, all of one kind",
            )
        })
    };
    texts.iter().map(one).collect()
}

fn wrong(error: &PartError) -> Failure {
    Failure::new(
        format!("the parts do not add up: {error}"),
        "play all parts by one program with the same options, over ranges that follow one another",
    )
}

/// A part as it is written.
pub(super) fn text_of<O: Serialize, C: Serialize>(
    path: &Path,
    part: &SeedPart<O, C>,
) -> Result<String, Failure> {
    serde_json::to_string(part).map_err(|error| files::in_file(path, &error))
}
