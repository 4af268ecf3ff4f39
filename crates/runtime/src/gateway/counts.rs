//! Counts of the gateway: what was asked, answered and refused.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

/// Why a request was not passed on, or not answered.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum GatewayRefusal {
    /// Its host is not on the allow list.
    NotAllowed,
    /// It is no frame of the gateway.
    Malformed,
    /// Too many requests of this client, of its host, or in all.
    TooManyRequests,
    /// Too many connections are open.
    TooManyConnections,
    /// It would change something, and the gateway is read-only.
    ReadOnly,
    /// Its protocol is not passed on: EoE, error replies, reserved types.
    Protocol,
    /// No SubDevice of the plan has this station address.
    UnknownStation,
    /// The line is not up yet.
    NotUp,
    /// The SubDevice has no mailbox, it is not open, or does not speak the protocol.
    NoMailbox,
    /// It does not fit into the mailbox of the SubDevice.
    TooLong,
    /// The SubDevice gave no answer.
    NoAnswer,
}

impl GatewayRefusal {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::NotAllowed,
        Self::Malformed,
        Self::TooManyRequests,
        Self::TooManyConnections,
        Self::ReadOnly,
        Self::Protocol,
        Self::UnknownStation,
        Self::NotUp,
        Self::NoMailbox,
        Self::TooLong,
        Self::NoAnswer,
    ];

    /// The word for reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotAllowed => "not-allowed",
            Self::Malformed => "malformed",
            Self::TooManyRequests => "too-many-requests",
            Self::TooManyConnections => "too-many-connections",
            Self::ReadOnly => "read-only",
            Self::Protocol => "protocol",
            Self::UnknownStation => "unknown-station",
            Self::NotUp => "not-up",
            Self::NoMailbox => "no-mailbox",
            Self::TooLong => "too-long",
            Self::NoAnswer => "no-answer",
        }
    }
}

/// Counts since the gateway was opened.
#[derive(Default, Debug)]
pub(super) struct GatewayCounts {
    requests: AtomicU64,
    answers: AtomicU64,
    refused: [AtomicU64; GatewayRefusal::ALL.len()],
}

impl GatewayCounts {
    pub(super) fn request(&self) {
        self.requests.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn answers(&self, count: usize) {
        self.answers.fetch_add(count as u64, Ordering::Relaxed);
    }

    pub(super) fn refuse(&self, why: GatewayRefusal) {
        if let Some(count) = self.refused.get(why as usize) {
            count.fetch_add(1, Ordering::Relaxed);
        }
    }

    pub(super) fn report(&self, listen: SocketAddr, read_only: bool) -> GatewayReport {
        let number = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let reasons = GatewayRefusal::ALL.iter().zip(&self.refused);
        let refused = reasons.map(|(why, count)| (why.name().to_owned(), number(count)));
        GatewayReport {
            listen: listen.to_string(),
            read_only,
            clients: 0,
            requests: number(&self.requests),
            answers: number(&self.answers),
            refused: refused.filter(|(_, count)| *count > 0).collect(),
        }
    }
}

/// What went through the mailbox gateway.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct GatewayReport {
    /// Where it listens: `127.0.0.1:34980`.
    pub listen: String,
    /// Whether only what changes nothing is passed on.
    pub read_only: bool,
    /// Clients that have asked so far: senders of datagrams (one that was silent for long counts anew), and
    /// connections.
    #[serde(default)]
    pub clients: u64,
    /// Datagrams, and frames of connections, that came in.
    pub requests: u64,
    /// Mailbox messages that went out.
    pub answers: u64,
    /// Requests and connections that were refused or not answered, by reason: `unknown-station`, `read-only`,
    /// `no-answer` and others. Reasons that did not occur are left out.
    #[serde(default)]
    pub refused: BTreeMap<String, u64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_has_a_count_and_a_word_of_its_own() {
        let counts = GatewayCounts::default();
        let listen = "127.0.0.1:34980".parse().unwrap();
        assert!(counts.report(listen, false).refused.is_empty());
        for (times, why) in GatewayRefusal::ALL.into_iter().enumerate() {
            (0..=times).for_each(|_| counts.refuse(why));
        }
        let report = counts.report(listen, true);
        assert_eq!(report.refused.len(), GatewayRefusal::ALL.len());
        for (times, why) in (1..).zip(GatewayRefusal::ALL) {
            assert_eq!(report.refused[why.name()], times, "{why:?}");
        }
    }
}
