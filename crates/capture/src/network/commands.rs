//! Datagrams by command.

use std::collections::BTreeMap;

use linesman_diagnosis::report::Number;
use linesman_proto::command::Command;
use linesman_proto::frame::FrameView;
use serde::{Deserialize, Serialize};

use crate::access::DatagramAccess;

/// Datagrams of one command.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CommandReport {
    /// The name: `FPRD`, `LRW`.
    pub command: String,
    /// Its code.
    pub code: u8,
    /// Datagrams in all frames of the capture: each is recorded going out and coming back.
    pub recorded: Number,
    /// Datagrams that came back, once for each request.
    pub returned: Number,
    /// Those of them that nobody answered: working counter 0.
    pub unanswered: Number,
    /// Datagrams that did not come back.
    pub lost: Number,
}

/// Counts by command.
#[derive(Clone, Default, Debug)]
pub struct CommandCounts {
    counts: BTreeMap<u8, CommandTally>,
}

#[derive(Clone, Copy, Default, Debug)]
struct CommandTally {
    recorded: u64,
    returned: u64,
    unanswered: u64,
    lost: u64,
}

impl CommandCounts {
    /// Takes a frame as it was recorded.
    pub(crate) fn frame(&mut self, view: &FrameView<'_>) {
        for datagram in view.datagrams().map_while(Result::ok) {
            self.counts.entry(datagram.code()).or_default().recorded += 1;
        }
    }

    /// Takes a datagram with what became of it.
    pub(crate) fn access(&mut self, access: &DatagramAccess<'_>) {
        let counts = self.counts.entry(access.command.code()).or_default();
        match access.wkc {
            None => counts.lost += 1,
            Some(wkc) => {
                counts.returned += 1;
                counts.unanswered += u64::from(wkc == 0);
            }
        }
    }

    /// The counts as a report.
    pub(crate) fn report(&self) -> Vec<CommandReport> {
        let report = |(code, counts): (&u8, &CommandTally)| CommandReport {
            command: Command::from_code(*code)
                .map_or_else(|| "?".to_owned(), |command| command.name().to_owned()),
            code: *code,
            recorded: Number(counts.recorded),
            returned: Number(counts.returned),
            unanswered: Number(counts.unanswered),
            lost: Number(counts.lost),
        };
        self.counts.iter().map(report).collect()
    }
}
