//! `linesman host`: the computer that runs the MainDevice as a suspect.
//!
//! Nothing is changed: what would mend a finding is printed as the exact commands.

mod jitter;

use std::path::PathBuf;

use linesman_link::host_check::{
    Check, DriverSettings, Files, FirewallRules, Outcome, inspect, inspect_network,
};
use linesman_link::interface::{self, InterfaceKind};
use linesman_proto::time::Span;
use serde::Serialize;

use crate::amount::{MICROSECOND, SECOND, duration};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::{Output, wrapped};
use crate::version;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Cards to look at, too; all that have a socket for a cable unless said
    #[arg(value_name = "NIC")]
    cards: Vec<String>,
    /// Wake up in a cycle for so long (10, 1m) and tell how late that was
    #[arg(long, value_name = "SECONDS", value_parser = duration(SECOND, Span::ms(100), Span::s(600)))]
    measure: Option<Span>,
    /// The cycle to measure with (500, 1ms)
    #[arg(
        long,
        visible_alias = "cycle",
        value_name = "US",
        default_value = "1000",
        requires = "measure",
        value_parser = duration(MICROSECOND, Span::us(50), Span::s(1))
    )]
    cycle_us: Span,
    /// What Ethernet over EtherCAT needs, too: rights, forwarding, routes, firewall; with the interface of `run --eoe`, if it is
    /// there
    #[arg(long, value_name = "INTERFACE", num_args = 0..=1, default_missing_value = "")]
    eoe: Option<String>,
    /// Judge the files below this folder, a copy of another computer's /sys and /proc
    #[arg(long, value_name = "FOLDER", conflicts_with = "measure")]
    root: Option<PathBuf>,
    /// What is good and what could not be told, too
    #[arg(long, short)]
    verbose: bool,
    /// JSON, schema linesman.host/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// The answer as JSON.
#[derive(Clone, PartialEq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.host/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// The cards that were looked at.
    cards: Vec<String>,
    /// What was looked at.
    checks: Vec<CheckReport>,
    /// How late a cycle began; `null` when that was not measured.
    jitter: Option<jitter::Report>,
}

/// One thing that was looked at.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct CheckReport {
    /// `rights`, `machine`, `kernel`, `processor`, `card` or `network`.
    area: String,
    /// Its name.
    name: String,
    /// `good`, `unknown`, `doubtful` or `bad`.
    outcome: String,
    /// What was found.
    found: String,
    /// What that does to EtherCAT; empty where all is well.
    effect: String,
    /// What mends it, most promising first. Nothing of it was done.
    mend: Vec<String>,
}

/// Looks, and measures when asked to.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let files = match &arguments.root {
        Some(root) if !root.is_dir() => {
            return Err(Failure::new(
                format!("{}: no such folder", root.display()),
                "name a folder that holds copies of /sys and /proc",
            ));
        }
        Some(root) => Files::below(root),
        None => Files::own(),
    };
    let cards = cards(arguments)?;
    let mut checks = inspect(&files, &cards);
    if let Some(interface) = &arguments.eoe {
        // Rules of another computer are in no file.
        let rules = arguments.root.is_none().then(FirewallRules::ask);
        let interface = Some(interface.as_str()).filter(|name| !name.is_empty());
        checks.extend(inspect_network(&files, interface, rules.as_ref()));
    }
    let jitter = arguments.measure.map(|lasts| jitter::measure(arguments.cycle_us, lasts));
    let worst = checks.iter().map(|check| check.outcome).max();
    let late = jitter.as_ref().is_some_and(|jitter| !jitter.is_good());
    if arguments.json {
        output.json(&Report {
            schema: "linesman.host/1".to_owned(),
            tool: version::tool(),
            cards: cards.into_iter().map(|(name, _)| name).collect(),
            checks: checks.iter().map(report).collect(),
            jitter,
        });
    } else {
        print(&checks, arguments.verbose, output);
        if let Some(jitter) = &jitter {
            output.line(&format!("\n{}", jitter.text()));
        }
    }
    let is_good = worst.is_none_or(|worst| worst <= Outcome::Unknown) && !late;
    Ok(if is_good { Status::Good } else { Status::Findings })
}

/// The cards to look at, with what their drivers say. A copy of another computer has no drivers.
fn cards(arguments: &Arguments) -> Result<Vec<(String, DriverSettings)>, Failure> {
    if arguments.root.is_some() {
        let unknown = |name: &String| (name.clone(), DriverSettings::default());
        return Ok(arguments.cards.iter().map(unknown).collect());
    }
    let names = if arguments.cards.is_empty() {
        let has_socket = |kind: &InterfaceKind| {
            matches!(kind, InterfaceKind::Physical | InterfaceKind::VirtualMachine)
        };
        let all = interface::list()?;
        all.into_iter().filter(|card| has_socket(&card.kind)).map(|card| card.name).collect()
    } else {
        for name in &arguments.cards {
            interface::find(name)?;
        }
        arguments.cards.clone()
    };
    let ask = |name: String| {
        let settings = interface::driver_settings(&name)?;
        Ok((name, settings))
    };
    names.into_iter().map(ask).collect()
}

fn report(check: &Check) -> CheckReport {
    CheckReport {
        area: check.area.to_string(),
        name: check.name.to_owned(),
        outcome: check.outcome.to_string(),
        found: check.found.clone(),
        effect: check.effect.clone(),
        mend: check.mend.clone(),
    }
}

fn print(checks: &[Check], verbose: bool, output: &mut Output) {
    let (paint, width) = (output.paint(), output.width());
    let mut worst_first: Vec<&Check> = checks.iter().collect();
    worst_first.sort_by_key(|check| std::cmp::Reverse(check.outcome));
    for check in worst_first {
        let outcome = check.outcome.to_string();
        let painted = match check.outcome {
            Outcome::Bad => paint.bad(&outcome),
            Outcome::Doubtful => paint.warning(&outcome),
            Outcome::Good if verbose => paint.good(&outcome),
            Outcome::Unknown if verbose => paint.faint(&outcome),
            Outcome::Good | Outcome::Unknown => continue,
        };
        let mut text = format!("{painted}  {}, {}\n", check.area, paint.bold(check.name));
        text.push_str(&wrapped("  ", &check.found, width));
        if !check.effect.is_empty() {
            text.push_str(&wrapped("  effect: ", &check.effect, width));
        }
        for command in &check.mend {
            // Not wrapped: a command is copied as it stands.
            text.push_str(&format!("  mend:   {command}\n"));
        }
        output.text(&text);
    }
    let count = |outcome| checks.iter().filter(|check| check.outcome == outcome).count();
    let (bad, doubtful) = (count(Outcome::Bad), count(Outcome::Doubtful));
    let rest = format!("{} good, {} unknown", count(Outcome::Good), count(Outcome::Unknown));
    let hint = if verbose { "" } else { "; `--verbose` shows them" };
    output.line(&format!("{} checks: {bad} bad, {doubtful} doubtful, {rest}{hint}.", checks.len()));
    if bad + doubtful > 0 {
        output.line("Nothing was changed: the commands are yours to run.");
    }
}
