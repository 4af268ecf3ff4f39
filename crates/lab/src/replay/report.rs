//! Report of a replay.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use linesman_proto::command::Addressing;

use super::compare::{Outcome, What, register_name};
use super::exception::{MOST_OF_A_HUNDRED, Reason, Reasons};
use super::model::Model;
use super::recording::{Datagram, Recording, Turn};

/// Examples that are kept of each kind of difference.
const EXAMPLES: usize = 3;
/// Kinds of differences that are listed.
const KINDS: usize = 40;

/// What a replay showed.
#[derive(Clone, PartialEq, Eq, Default, Debug, Serialize, schemars::JsonSchema)]
pub struct Report {
    /// Requests that were played.
    pub requests: u64,
    /// Requests that nobody answered in the recording: nothing can be said of them.
    pub unanswered: u64,
    /// Returns whose request was not recorded.
    pub returns_alone: u64,
    /// EtherCAT frames of the recording that could not be used: damaged or cut off.
    pub unusable: u64,
    /// Frames of other protocols, left out.
    pub other_traffic: u64,
    /// What each device was taken for, nearest first.
    pub devices: Vec<String>,
    /// What had to be assumed.
    pub notes: Vec<String>,
    /// Datagrams that were compared.
    pub compared: u64,
    /// Of them, those that agree in every byte.
    pub equal: u64,
    /// Those that agree but for fields that tell a time or count: by class and register.
    pub equal_but: Vec<Exempt>,
    /// Those that differ.
    pub different: u64,
    /// Of those that differ, the ones for which the recording shows no reason.
    pub unexplained: u64,
    /// Of those that differ, the ones that carry process data.
    pub process_data: u64,
    /// In what they differ, the most frequent first.
    pub differences: Vec<DifferenceKind>,
}

/// Fields that were not compared.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
pub struct Exempt {
    /// Why.
    pub reason: String,
    /// Which register.
    pub register: String,
    /// In how many datagrams.
    pub datagrams: u64,
}

/// Differences of one kind.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
pub struct DifferenceKind {
    /// Of which datagrams, and in what.
    pub what: String,
    /// Why, where the recording shows it.
    pub reason: Option<String>,
    /// How many.
    pub datagrams: u64,
    /// The first of them.
    pub examples: Vec<Example>,
}

/// One difference.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
pub struct Example {
    /// Number of the request in the recording.
    pub request: u64,
    /// Number of the answer.
    pub reply: u64,
    /// Which datagram of it, from 0.
    pub datagram: usize,
    /// As it was recorded.
    pub expected: String,
    /// As the segment gave it.
    pub received: String,
}

/// What a replay proves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// All answers agree.
    Agrees,
    /// All but few agree: at most one datagram in a hundred differs, none of process data, each for a
    /// reason that the recording shows.
    AgreesButForExceptions,
    /// More differ.
    Differs,
    /// No answer could be compared.
    NothingJudged,
}

impl Report {
    pub(super) fn of(recording: &Recording, model: &Model) -> Self {
        Self {
            requests: recording.turns.iter().filter(|turn| !turn.is_rebuilt).count() as u64,
            returns_alone: recording.alone,
            unusable: recording.unusable,
            other_traffic: recording.other_traffic,
            devices: model.devices.clone(),
            notes: model.notes.clone(),
            ..Self::default()
        }
    }

    /// A recording without a device.
    #[must_use]
    pub fn without_devices(recording: &Recording) -> Self {
        let unanswered = recording.turns.len() as u64;
        Self {
            requests: unanswered,
            unanswered,
            returns_alone: recording.alone,
            unusable: recording.unusable,
            other_traffic: recording.other_traffic,
            ..Self::default()
        }
    }

    /// What it proves.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        match (self.compared, self.different) {
            (0, _) => Verdict::NothingJudged,
            (_, 0) => Verdict::Agrees,
            (compared, different)
                if different * 100 <= compared * MOST_OF_A_HUNDRED
                    && self.unexplained == 0
                    && self.process_data == 0 =>
            {
                Verdict::AgreesButForExceptions
            }
            (_, _) => Verdict::Differs,
        }
    }

    pub(super) fn add(
        &mut self,
        turn: &Turn,
        number: usize,
        recorded: &Datagram<'_>,
        outcome: Outcome,
        reasons: &Reasons,
    ) {
        self.compared += 1;
        match outcome {
            Outcome::Equal => self.equal += 1,
            Outcome::EqualBut(class, address) => {
                let (reason, register) = (class.name().to_owned(), register_name(address));
                let known = self
                    .equal_but
                    .iter_mut()
                    .find(|one| one.reason == reason && one.register == register);
                match known {
                    Some(known) => known.datagrams += 1,
                    None => self.equal_but.push(Exempt { reason, register, datagrams: 1 }),
                }
            }
            Outcome::Differs(difference) => {
                self.different += 1;
                let reason = reasons.of_difference(turn, recorded).map(Reason::name);
                self.unexplained += u64::from(reason.is_none());
                self.process_data += u64::from(is_logical(recorded));
                let what = kind(recorded, difference.what);
                let same =
                    |one: &DifferenceKind| one.what == what && one.reason.as_deref() == reason;
                let place = match self.differences.iter().position(same) {
                    Some(place) => place,
                    None if self.differences.len() >= KINDS => return,
                    None => {
                        self.differences.push(DifferenceKind {
                            what,
                            reason: reason.map(str::to_owned),
                            datagrams: 0,
                            examples: Vec::new(),
                        });
                        self.differences.len() - 1
                    }
                };
                let known = &mut self.differences[place];
                known.datagrams += 1;
                if known.examples.len() < EXAMPLES {
                    known.examples.push(Example {
                        request: turn.request.number,
                        reply: turn.reply.as_ref().map_or(0, |reply| reply.number),
                        datagram: number,
                        expected: difference.expected,
                        received: difference.received,
                    });
                }
            }
        }
    }

    /// Datagrams that agree but for fields that are not compared.
    #[must_use]
    pub fn equal_but_count(&self) -> u64 {
        self.equal_but.iter().map(|one| one.datagrams).sum()
    }
}

fn is_logical(recorded: &Datagram<'_>) -> bool {
    recorded.command.is_some_and(|one| one.addressing() == Addressing::Logical)
}

/// `FPRD 0x0130 AL status: data`.
fn kind(recorded: &Datagram<'_>, what: What) -> String {
    let command = recorded.command.map_or("unknown command", |command| command.name());
    let place = if is_logical(recorded) {
        format!("{command} {}", recorded.logical)
    } else {
        format!("{command} {} {}", recorded.ado, register_name(recorded.ado))
    };
    match what {
        What::WorkingCounter => format!("{place}: working counter"),
        What::Data(address) if address == recorded.ado => format!("{place}: data"),
        What::Data(address) => format!("{place}: data at {address} {}", register_name(address)),
        What::ProcessData(_) => format!("{place}: process data"),
        What::Position => format!("{place}: position"),
        What::Events => format!("{place}: event field"),
        What::Missing => format!("{place}: did not come back"),
    }
}

/// Counts of one key, the most frequent first.
fn sorted<T>(list: &[T], count: impl Fn(&T) -> u64) -> Vec<&T> {
    let mut by_count: BTreeMap<std::cmp::Reverse<u64>, Vec<&T>> = BTreeMap::new();
    for one in list {
        by_count.entry(std::cmp::Reverse(count(one))).or_default().push(one);
    }
    by_count.into_values().flatten().collect()
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, device) in (1..).zip(&self.devices) {
            writeln!(f, "device {number}: {device}")?;
        }
        for note in &self.notes {
            writeln!(f, "assumed: {note}")?;
        }
        writeln!(f, "requests       {:>8}", self.requests)?;
        for (name, count) in [
            ("  unanswered", self.unanswered),
            ("returns alone", self.returns_alone),
            ("unusable", self.unusable),
            ("other traffic", self.other_traffic),
        ] {
            if count > 0 {
                writeln!(f, "{name:<14} {count:>8}")?;
            }
        }
        writeln!(f, "datagrams      {:>8}", self.compared)?;
        writeln!(f, "  equal        {:>8}", self.equal)?;
        writeln!(f, "  equal but    {:>8}", self.equal_but_count())?;
        for one in sorted(&self.equal_but, |one| one.datagrams) {
            writeln!(f, "               {:>8}  {}: {}", one.datagrams, one.reason, one.register)?;
        }
        writeln!(f, "  different    {:>8}", self.different)?;
        for one in sorted(&self.differences, |one| one.datagrams) {
            let reason = one.reason.as_deref().unwrap_or("no reason known");
            writeln!(f, "               {:>8}  {}; {reason}", one.datagrams, one.what)?;
            for example in &one.examples {
                writeln!(
                    f,
                    "                         frame {} to {}, datagram {}: expected {}, received {}",
                    example.request,
                    example.reply,
                    example.datagram,
                    example.expected,
                    example.received
                )?;
            }
        }
        Ok(())
    }
}
