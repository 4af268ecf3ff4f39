//! Process data of a plan as a diagnosis needs them: the working counter of each cyclic datagram, and the FMMUs that
//! say which SubDevice adds how much to it.

use linesman_proto::address::{DeviceId, LogicalAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::register::FmmuConfig;

use super::Plan;
use super::expect::{self, PathView, Presence};

/// Process data that were planned.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct PlannedExchange {
    /// The logical datagrams.
    pub counters: Vec<PlannedCounter>,
    /// The FMMUs, with the SubDevice and their number in it.
    pub fmmus: Vec<(DeviceId, u8, FmmuConfig)>,
}

/// The working counter of a logical datagram while all SubDevices are in OP.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PlannedCounter {
    /// LRD, LWR or LRW.
    pub command: Command,
    /// Its first logical address.
    pub start: LogicalAddress,
    /// Its length in bytes.
    pub len: u16,
    /// The working counter.
    pub working_counter: u16,
}

impl PlannedExchange {
    /// The working counter that was planned for a datagram.
    #[must_use]
    pub fn counter(&self, command: Command, start: LogicalAddress, len: u16) -> Option<u16> {
        let is_it =
            |one: &&PlannedCounter| one.command == command && one.start == start && one.len == len;
        self.counters.iter().find(is_it).map(|one| one.working_counter)
    }
}

impl Plan {
    /// The process data of this plan.
    #[must_use]
    pub fn exchange(&self) -> PlannedExchange {
        let present = Presence::full(self.devices.len());
        let mut counters = Vec::new();
        for (.., datagram) in self.datagrams().filter(|(.., one)| one.role.is_judged()) {
            let DatagramAddress::Logical(start) = datagram.address else { continue };
            let Ok(len) = u16::try_from(datagram.len) else { continue };
            let working_counter = expect::expect(datagram, &present, PathView::Merged).0;
            counters.push(PlannedCounter {
                command: datagram.command,
                start,
                len,
                working_counter,
            });
        }
        let of = |device: &super::DevicePlan| {
            let id = device.id;
            device.fmmus.iter().map(move |(no, fmmu)| (id, *no, *fmmu)).collect::<Vec<_>>()
        };
        PlannedExchange { counters, fmmus: self.devices.iter().flat_map(of).collect() }
    }
}
