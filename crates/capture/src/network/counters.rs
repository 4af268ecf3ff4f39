//! Error counters, as the MainDevice or another tool has read and cleared them.

use std::collections::BTreeMap;

use linesman_diagnosis::model::{CounterTrack, NetworkModel};
use linesman_diagnosis::report::Number;
use linesman_proto::register::{self, ErrorCounter, ErrorCounters};
use serde::{Deserialize, Serialize};

use crate::access::{DatagramAccess, DatagramTarget};

/// All error counters. Reference: S2 2.9.
const COUNTERS: std::ops::Range<u16> = {
    let first = register::RX_ERROR_COUNTER.address.0;
    first..first + ErrorCounters::LEN as u16
};

/// Error counters of a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CountersReport {
    /// Number of the SubDevice.
    pub no: u32,
    /// Number of readings of any of them.
    pub readings: Number,
    /// Number of recorded writes that cleared any of them.
    pub cleared: Number,
    /// Number of falls of a group of them without such a write.
    pub fell_unseen: u32,
    /// Those that were read.
    pub counters: Vec<CounterReport>,
}

/// One error counter.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CounterReport {
    /// Events that it counts.
    pub name: String,
    /// The port that it belongs to: `A` to `D`.
    pub port: Option<String>,
    /// The first reading.
    pub first: Number,
    /// The latest reading.
    pub last: Number,
    /// By how much it rose, through clears.
    pub rose: Number,
    /// When it was last read higher than before.
    pub last_rise_ns: Option<Number>,
    /// True if it stands at its end and counts no more.
    pub at_end: bool,
}

/// Readings and clears by whom they mean.
#[derive(Clone, Default, Debug)]
pub struct CounterPolls {
    polls: BTreeMap<DatagramTarget, (u64, u64)>,
}

impl CounterPolls {
    /// Takes a datagram.
    pub(crate) fn access(&mut self, access: &DatagramAccess<'_>) {
        let end = u32::from(access.address.0) + u32::from(access.len);
        let touches = access.address.0 < COUNTERS.end && end > u32::from(COUNTERS.start);
        if !touches || matches!(access.target, DatagramTarget::Logical(_) | DatagramTarget::Nobody)
        {
            return;
        }
        let polls = self.polls.entry(access.target).or_default();
        polls.0 += u64::from(access.read.is_some());
        polls.1 += u64::from(access.written.is_some() && access.wkc.is_some_and(|wkc| wkc > 0));
    }

    /// The counters of all SubDevices that were read.
    pub(crate) fn report(&self, model: &NetworkModel) -> Vec<CountersReport> {
        let known = model.devices.iter().filter(|device| device.counters.is_known());
        known
            .map(|device| {
                let is_it = |target: DatagramTarget| {
                    target == DatagramTarget::All || target.device(model) == Some(device.id)
                };
                let polls = self.polls.iter().filter(|(target, _)| is_it(**target));
                let (readings, cleared) = polls
                    .fold((0, 0), |(read, clear), (_, polls)| (read + polls.0, clear + polls.1));
                let track = |(counter, track): (ErrorCounter, &CounterTrack)| CounterReport {
                    name: counter.name().to_owned(),
                    port: counter.port().map(|port| port.to_string()),
                    first: Number(track.first.value),
                    last: Number(track.last.value),
                    rose: Number(track.total.rise()),
                    last_rise_ns: track.last_rise().map(|rise| Number(rise.at.as_nanos())),
                    at_end: track.is_at_end(),
                };
                CountersReport {
                    no: device.id.no(),
                    readings: Number(readings),
                    cleared: Number(cleared),
                    fell_unseen: device.counters.foreign_clears(),
                    counters: device.counters.tracks().map(track).collect(),
                }
            })
            .collect()
    }
}
