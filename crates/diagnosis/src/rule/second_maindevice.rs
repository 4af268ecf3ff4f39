//! # A second MainDevice
//!
//! Requests come from more than one source address.
//!
//! **How it is found.** Frames on their way out carry the address of the card that sent them. Two
//! addresses that each send requests of their own are two senders on one line; the second card of a ring
//! only repeats what the first one sends.
//!
//! **What it means.** Two MainDevices fight for the line: each changes states, clears counters and writes
//! outputs that the other one does not expect. Or a configuration tool is plugged in beside.
//!
//! **What to do.** Find out who else is on the line and stop it, or listen only.

use linesman_config::fault::{Class, FaultName};

use super::{Rule, RulePage, View};
use crate::finding::{Condition, Evidence, Place, Severity};
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

fn judge(view: &View<'_>, conditions: &mut Vec<Condition>) {
    let line = view.line;
    let senders = line.traffic.senders.iter();
    let own: Vec<_> = senders.filter(|sender| sender.own >= OWN).collect();
    // The cards of this host are one MainDevice.
    let ours = own.iter().position(|sender| sender.is_host);
    let others = own.iter().enumerate().filter(|(at, sender)| !sender.is_host || ours == Some(*at));
    let apart: Vec<_> = others.map(|(_, sender)| *sender).collect();
    let [_, shown, ..] = &apart[..] else { return };
    let names: Vec<_> = apart.iter().map(|sender| sender.mac.to_string()).collect();
    let text =
        format!("requests of their own come from {} addresses: {}", apart.len(), names.join(", "));
    let place = Place::Network { network: line.network };
    conditions.push(
        Condition::new(&PAGE, place, FaultName::SecondMainDevice, shown.first.at)
            .confidence(0.8)
            .confirmed(shown.first.at)
            .shown_by(Evidence::frame(shown.first.at, shown.first.frame.unwrap_or(0), text))
            .advise("Find out which computer or controller has the other address, and stop it.")
            .advise("If it has to run, use `listen:` and do not send beside it."),
    );
}
