//! Request and return as the MainDevice's card would have shown them, from copies inside the line.

use std::collections::BTreeSet;

use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{self, SOURCE_MARK};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, WKC_LEN};

/// Of a datagram: more follow.
const MORE: u8 = 0x80;
/// Code of the command that nobody answers.
const NOP: u8 = 0;

/// A datagram in the bytes of a frame.
#[derive(Clone, Copy)]
struct DatagramAt {
    at: usize,
    counter_at: usize,
}

/// What is known of SubDevices that answer only behind the last port of a probe inside the line.
#[derive(Clone, Default, Debug)]
pub(super) struct ProbeReach {
    answered: BTreeSet<u16>,
    /// Somebody was asked whom the frames had not reached when they came back to the probe.
    is_partial: bool,
    /// Sums over all SubDevices are planned: what a part of them adds says nothing.
    is_planned: bool,
}

/// The frame without what `before` SubDevices have done to it: positions are counted back, working counters are 0, the
/// source address is not marked. Data that were read on the way stay. `None` if it cannot be read.
pub(super) fn as_sent(frame: &[u8], before: u16) -> Option<Vec<u8>> {
    let mut bytes = frame.to_vec();
    let places = places(&bytes)?;
    *bytes.get_mut(6)? &= !SOURCE_MARK;
    for DatagramAt { at, counter_at } in places {
        if is_counted(bytes[at]) {
            let position = word(&bytes, at + 2).wrapping_sub(before);
            bytes[at + 2..at + 4].copy_from_slice(&position.to_le_bytes());
        }
        bytes[counter_at..counter_at + WKC_LEN].fill(0);
    }
    Some(bytes)
}

impl ProbeReach {
    pub(super) fn of_plan(is_planned: bool) -> Self {
        Self { is_planned, ..Self::default() }
    }

    /// Takes out of a request and its return what the SubDevices were asked whom the frame had not reached when it came
    /// back to the probe: those answer behind it.
    pub(super) fn mask(&mut self, request: &mut [u8], reply: &mut [u8]) {
        let (Some(sent), Some(back)) = (places(request), places(reply)) else { return };
        for (sent, back) in sent.into_iter().zip(back) {
            let address = word(reply, back.at + 2);
            let effect = Command::from_code(reply[back.at]).map(Command::effect);
            // Of ARMW and FRMW all others count what they write, too: the one that is addressed need not have answered.
            let is_answered = word(reply, back.counter_at) > 0
                && effect.is_some_and(|effect| !effect.multiple_write);
            let is_unreached = match effect.map(|effect| effect.addressing) {
                // Each SubDevice counts it up, and the one that finds 0 is meant.
                Some(Addressing::Position) => address == 0 || address > 0x7FFF,
                Some(Addressing::Station) => {
                    if is_answered {
                        self.answered.insert(address);
                    }
                    !self.answered.contains(&address)
                }
                Some(Addressing::Logical | Addressing::Broadcast) => {
                    self.is_planned && self.is_partial
                }
                Some(Addressing::None) | None => false,
            };
            self.is_partial |= is_unreached;
            if is_unreached {
                take_out(request, sent);
                take_out(reply, back);
            }
        }
    }
}

fn take_out(bytes: &mut [u8], DatagramAt { at, counter_at }: DatagramAt) {
    bytes[at] = NOP;
    bytes[at + 2..at + 6].fill(0);
    bytes[counter_at..counter_at + WKC_LEN].fill(0);
}

const fn is_counted(code: u8) -> bool {
    match Command::from_code(code) {
        Some(command) => {
            matches!(command.addressing(), Addressing::Position | Addressing::Broadcast)
        }
        None => false,
    }
}

/// The datagrams of a frame; `None` if one of them is not whole.
fn places(bytes: &[u8]) -> Option<Vec<DatagramAt>> {
    let (_, header_at) = ethernet::locate(bytes)?;
    let mut found = Vec::new();
    let mut at = header_at + ETHERCAT_HEADER_LEN;
    loop {
        let header = bytes.get(at..at + DATAGRAM_HEADER_LEN)?;
        let len = usize::from(u16::from_le_bytes([header[6], header[7]]) & 0x07FF);
        let is_last = header[7] & MORE == 0;
        let counter_at = at + DATAGRAM_HEADER_LEN + len;
        bytes.get(counter_at..counter_at + WKC_LEN)?;
        found.push(DatagramAt { at, counter_at });
        at = counter_at + WKC_LEN;
        if is_last {
            return Some(found);
        }
    }
}

fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame of one datagram with eight bytes of data, to a station address.
    fn frame(command: Command, station: u16, working_counter: u16) -> Vec<u8> {
        let mut bytes = vec![2; 12];
        bytes.extend([0x88, 0xA4, 20, 0x10, command.code(), 0]);
        bytes.extend(station.to_le_bytes());
        bytes.extend([0x10, 0x09, 8, 0, 0, 0]);
        bytes.extend([0; 8]);
        bytes.extend(working_counter.to_le_bytes());
        bytes
    }

    /// True if a frame that comes back with this counter is left as it is, beside one that was answered before.
    fn is_kept(command: Command, working_counter: u16) -> bool {
        let mut reach = ProbeReach::of_plan(false);
        let (mut request, mut reply) =
            (frame(command, 0x1007, 0), frame(command, 0x1007, working_counter));
        reach.mask(&mut request, &mut reply);
        reply[ETHERNET_LEN + ETHERCAT_HEADER_LEN] == command.code()
    }

    /// Length of the Ethernet header.
    const ETHERNET_LEN: usize = 14;

    #[test]
    fn station_that_a_read_reached_is_kept_and_one_beyond_the_probe_is_taken_out() {
        assert!(is_kept(Command::Fprd, 1));
        assert!(!is_kept(Command::Fprd, 0));
    }

    #[test]
    fn frmw_counted_by_writers_alone_does_not_show_that_its_station_was_reached() {
        assert!(!is_kept(Command::Frmw, 1));
    }
}
