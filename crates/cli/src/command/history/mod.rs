//! `linesman history`: what a SubDevice has noted of itself, object 0x10F3.
//!
//! Reference: ETG.1020, diagnosis history. Subindex 1: how many messages fit; 2: where the newest is;
//! 3: up to where was acknowledged; 4: whether there are new ones; 5: flags; messages from 6 on, in a
//! ring.

pub(crate) mod message;
mod report;

use std::path::{Path, PathBuf};

use linesman_config::esi::Esi;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::{ObjectAddress, ObjectIndex};

use super::sdo::{download, upload};
use super::service::{ServiceError, ServiceLine, ServiceTarget, end};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
pub(crate) use report::Report;

const MAXIMUM: u8 = 1;
const NEWEST: u8 = 2;
const ACKNOWLEDGED: u8 = 3;
const NEW: u8 = 4;
const FLAGS: u8 = 5;
const FIRST_MESSAGE: u8 = 6;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) place: ServiceTarget,
    /// Only messages that nobody has acknowledged
    #[arg(long)]
    only_new: bool,
    /// Acknowledge all messages up to the newest, after they were read
    #[arg(long)]
    acknowledge: bool,
    /// Forget all messages, after they were read
    #[arg(long, conflicts_with = "acknowledge")]
    clear: bool,
    /// The device description with the texts of the messages
    #[arg(long, value_name = "FILE.xml")]
    esi: Option<PathBuf>,
    /// Save the messages: .csv, else JSON
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
    /// JSON, schema linesman.history/1; linesman.refusal/1 when it is refused
    #[arg(long)]
    pub(crate) json: bool,
}

/// The texts of a device description, by number.
type Texts = Vec<(u16, String)>;

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    if let Some(path) = &arguments.export {
        files::refuse_to_overwrite(path)?;
    }
    let esi = arguments.esi.as_deref().map(description).transpose()?;
    let mut session = ServiceLine::open(&arguments.place.line)?;
    let id = session.device(&arguments.place.device)?;
    let texts = esi.map_or_else(Vec::new, |esi| texts(&esi, &session, id, output));
    let opened = session.open_mailbox(id, output);
    let outcome =
        session.with_opened(opened, output, |session, _| read(session, id, &texts, arguments));
    let outcome = match outcome {
        Ok(report) => {
            if let Some(path) = &arguments.export {
                export(&report, path)?;
            }
            if arguments.json {
                output.json(&report);
            } else {
                output.text(&report.text(&session.label(id), output));
            }
            Ok(())
        }
        Err(trouble) => Err(trouble),
    };
    end(outcome, arguments.json, output)
}

fn description(path: &Path) -> Result<Esi, Failure> {
    let bytes = files::description(path)?;
    Esi::parse(&bytes).map_err(|error| files::in_file(path, &error))
}

/// The texts of the SubDevice's own description: of its product, and of its revision if that is there.
fn texts(esi: &Esi, session: &ServiceLine, id: DeviceId, output: &Output) -> Texts {
    let Some(identity) = session.known(id).and_then(|known| known.identity) else {
        return Vec::new();
    };
    let mut of_product: Vec<_> =
        esi.usable().filter(|device| device.product_code == identity.product_code).collect();
    of_product.sort_by_key(|device| device.revision != identity.revision);
    match of_product.first() {
        Some(device) => device.diagnosis_texts.clone(),
        None => {
            output.warn(&format!(
                "the description has no product 0x{:08X}: messages are shown by their numbers",
                identity.product_code
            ));
            Vec::new()
        }
    }
}

fn read(
    session: &mut ServiceLine,
    id: DeviceId,
    texts: &Texts,
    arguments: &Arguments,
) -> Result<Report, ServiceError> {
    let at = |subindex| ObjectAddress { index: ObjectIndex::DIAGNOSIS_HISTORY, subindex };
    let number = |session: &mut ServiceLine, subindex| {
        let bytes = upload(session, id, at(subindex), false)?;
        Ok::<u16, ServiceError>(
            bytes.iter().take(2).rev().fold(0, |n, byte| n << 8 | u16::from(*byte)),
        )
    };
    let [count, maximum, newest, acknowledged, new, flags] =
        [0, MAXIMUM, NEWEST, ACKNOWLEDGED, NEW, FLAGS].map(|subindex| number(session, subindex));
    let (last, newest, acknowledged) = (count? as u8, newest? as u8, acknowledged? as u8);
    let mut report = Report::new(session.report(id), maximum?, new? != 0, flags?);
    for subindex in order(last, newest) {
        let is_new = is_new(subindex, last, newest, acknowledged, report.has_new());
        if arguments.only_new && !is_new {
            continue;
        }
        match upload(session, id, at(subindex), false) {
            Ok(bytes) => report.push(subindex, is_new, &bytes, texts),
            // A slot that was never used.
            Err(ServiceError::Refused(refusal)) if refusal.abort_code().is_some() => {}
            Err(trouble) => return Err(trouble),
        }
    }
    if arguments.clear {
        download(session, id, at(ACKNOWLEDGED), false, vec![0])?;
        report.cleared();
    } else if arguments.acknowledge && newest >= FIRST_MESSAGE {
        download(session, id, at(ACKNOWLEDGED), false, vec![newest])?;
        report.acknowledged_to(newest);
    }
    Ok(report)
}

/// The subindices of the messages, oldest first: the ring begins behind the newest.
fn order(last: u8, newest: u8) -> Vec<u8> {
    let all = FIRST_MESSAGE..=last;
    if !all.contains(&newest) {
        return all.collect();
    }
    (newest + 1..=last).chain(FIRST_MESSAGE..=newest).collect()
}

/// Whether a message is newer than the last that was acknowledged.
fn is_new(subindex: u8, last: u8, newest: u8, acknowledged: u8, any_new: bool) -> bool {
    let order = order(last, newest);
    let place = |wanted: u8| order.iter().position(|one| *one == wanted);
    match (place(subindex), place(acknowledged)) {
        _ if !any_new => false,
        // What was acknowledged has been overwritten since, or nothing ever was.
        (_, None) => true,
        (Some(_), Some(_)) if acknowledged == newest => true,
        (Some(own), Some(acknowledged)) => own > acknowledged,
        (None, _) => false,
    }
}

fn export(report: &Report, path: &Path) -> Result<(), Failure> {
    let is_csv = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv"));
    let text = if is_csv { report.csv() } else { report.json_text() };
    files::write_new(path, "the messages", &text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ring_begins_behind_the_newest() {
        assert_eq!(order(8, 8), [6, 7, 8]);
        assert_eq!(order(8, 6), [7, 8, 6]);
        assert_eq!(order(8, 7), [8, 6, 7]);
        assert_eq!(order(5, 0), [0_u8; 0]);
        assert_eq!(order(7, 0), [6, 7]);
    }

    #[test]
    fn new_is_what_is_newer_than_the_acknowledged() {
        let new = |newest, acknowledged, any| -> Vec<u8> {
            order(9, newest)
                .into_iter()
                .filter(|one| is_new(*one, 9, newest, acknowledged, any))
                .collect()
        };
        assert_eq!(new(7, 9, true), [6, 7]);
        assert_eq!(new(7, 6, true), [7]);
        assert_eq!(new(7, 0, true), [8, 9, 6, 7]);
        assert_eq!(new(7, 7, false), [0_u8; 0]);
        // All round the ring once more: the slot is the same, the message is not.
        assert_eq!(new(7, 7, true), [8, 9, 6, 7]);
    }
}
