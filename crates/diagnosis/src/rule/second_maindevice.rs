//! # A second MainDevice
//!
//! Requests come from more than one source address.
//!
//! **How it is found.** Frames on their way out carry the address of the card that sent them. Two
//! addresses that each send requests of their own are two senders on one line, on one computer, too; the second card of a
//! ring only repeats what the first one sends. A MainDevice that is plugged in behind the point of observation
//! shows by its returns alone: frames come back, processed, that nobody here has sent.
//!
//! **What it means.** Two MainDevices fight for the line: each changes states, clears counters and writes
//! outputs that the other one does not expect. Or a configuration tool is plugged in beside. As long as it
//! only reads, it does no harm but takes time on the line; when it clears error counters, what was counted
//! is lost to everybody else, and that is all; once it writes anything else, SubDevices that leave their state,
//! refuse one, are missing in working counters or do not answer by their mailboxes are its doing, and listed
//! beneath.
//!
//! **What to do.** Find out who else is on the line and stop it, or listen only.

use linesman_config::fault::{Class, FaultName};
use linesman_proto::time::Span;

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity, Symptom};
use crate::observe::Sender;
use crate::observe::sender::OWN;

/// The page.
pub const PAGE: RulePage = RulePage {
    code: "C330",
    name: "second-maindevice",
    severity: Severity::Warning,
    class: Class::Configuration,
    source: include_str!("second_maindevice.rs"),
};

/// The rule.
pub const RULE: Rule = Rule { pages: &[PAGE], judge };

/// Where no direction is told, so many returns that nobody here asked for: a recording may miss a request.
const UNASKED: u64 = 4;
/// Who did not send anything for so long has gone. A tool that looks now and then does so every second.
const GONE: Span = Span::s(3);

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let model = view.model;
    let senders = &model.traffic.requests.senders();
    let has_host = senders.iter().any(|sender| sender.is_host);
    let is_one = |sender: &&Sender| {
        sender.own >= OWN
            || sender.is_elsewhere && (has_host || sender.own >= UNASKED)
            // Whoever has sent anything here is the other one.
            || !sender.is_elsewhere && senders.iter().any(|other| other.is_elsewhere)
    };
    let own: Vec<_> = senders.iter().filter(is_one).collect();
    // The cards of this host are one MainDevice; two that send by one card are two programs.
    let mut apart: Vec<&Sender> = Vec::new();
    for sender in own {
        let is_same =
            |known: &&&Sender| known.is_host && sender.is_host && known.card != sender.card;
        if apart.iter().find(is_same).is_none() {
            apart.push(sender);
        }
    }
    let [_, shown, ..] = &apart[..] else { return };
    let names: Vec<_> = apart.iter().map(|sender| sender.mac.to_string()).collect();
    let text =
        format!("requests of their own come from {} addresses: {}", apart.len(), names.join(", "));
    let place = Place::Network { network: model.network };
    let mut condition = Condition::new(&PAGE, place, FaultName::SecondMainDevice, shown.first.at)
        .confidence(0.85)
        .confirmed(shown.first.at)
        .shown_by(Evidence::frame(shown.first.at, shown.first.frame.unwrap_or(0), text));
    let elsewhere = || apart.iter().filter(|sender| sender.is_elsewhere);
    let sum = |count: fn(&Sender) -> u64| elsewhere().map(|sender| count(sender)).sum::<u64>();
    let (frames, writes, orders) =
        (sum(|sender| sender.own), sum(|sender| sender.writes), sum(|sender| sender.orders));
    if let Some(last) = elsewhere().map(|sender| sender.last).max() {
        let clears = match writes - orders {
            0 => String::new(),
            clears => format!(", {clears} clear error counters"),
        };
        let text = format!(
            "{frames} frames came back that nobody here has sent; {orders} of them write into SubDevices{clears}"
        );
        condition = condition.shown_by(Evidence::host(Some(last), text));
        if elsewhere().count() + 1 == apart.len() && last + GONE < view.now {
            condition = condition.ended(last);
        }
    }
    let is_unknown = elsewhere().count() == 0;
    if writes > 0 || is_unknown {
        condition = condition.explaining([Symptom::CountersCleared]);
    }
    if orders > 0 || is_unknown {
        condition = condition.explaining(model.devices.iter().flat_map(|device| {
            let id = device.id;
            // Who is ordered into INIT closes its mailbox: what was asked is never answered, and nothing
            // is taken until it is in PREOP again.
            let mailbox = Symptom::Mailbox(id);
            [Symptom::StateLost(id), Symptom::WorkingCounter(id), Symptom::Emergency(id), mailbox]
        }));
    }
    if orders > 0 {
        condition.severity = Severity::Error;
    }
    conditions.push(
        condition
            .advise("Find out which computer or controller has the other address, and stop it.")
            .advise("If it has to run, use `listen:` and do not send beside it."),
    );
}
