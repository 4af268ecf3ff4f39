//! Tap inside a line: its cards add no record to a frame, so the port of each copy is told by its way.
//!
//! A frame passes a channel on its way out, and within milliseconds the same frame on its way back. The first copy is
//! that of the way out. A copy without another one (its frame turned back before, was lost, or was damaged: cards drop
//! damaged frames) has the way that its interface has taken so far, where that was one way alone.

use std::collections::VecDeque;

use linesman_proto::esl::{EslRecord, PORTS};
use linesman_proto::frame::FrameView;
use linesman_proto::time::Instant;

use super::{LONGEST, MOST_UNDER_WAY, key};
use crate::observe::FrameSeen;

/// Most channels: each has two ports of those that a record can name.
pub const CHANNELS: u8 = PORTS / 2;
/// The habit of an interface is known after so many pairs of copies.
const KNOWN_AFTER: u64 = 16;
/// An interface takes one way alone if at least so many of a hundred copies went by it.
const ONE_WAY_PERCENT: u64 = 95;

/// Ways of the copies of frames past the channels of a tap.
#[derive(Clone, Default, Debug)]
pub struct TapWays {
    under_way: VecDeque<FirstCopy>,
    habits: Vec<InterfaceHabit>,
}

/// The first copy of a frame, which waits for the other one.
#[derive(Clone, Copy, Debug)]
struct FirstCopy {
    key: u64,
    channel: u8,
    time: Instant,
    interface: u32,
}

/// Ways that an interface has taken: of pairs of copies it had the first or the second one.
#[derive(Clone, Copy, Debug)]
struct InterfaceHabit {
    interface: u32,
    firsts: u64,
    seconds: u64,
}

impl TapWays {
    /// Record of a copy that came to a channel by an interface, as a probe would have added it.
    pub fn record(&mut self, channel: u8, interface: u32, frame: &FrameSeen<'_>) -> EslRecord {
        let is_damaged = frame.fcs == Some(false);
        let is_back = self.is_back(channel, interface, frame, is_damaged);
        EslRecord {
            port: Some(2 * channel + u8::from(is_back)),
            crc_error: is_damaged,
            // A card does not tell whether a controller has found the frame bad before.
            alignment_error: false,
            time_ns: frame.time.as_nanos(),
        }
    }

    fn is_back(
        &mut self,
        channel: u8,
        interface: u32,
        frame: &FrameSeen<'_>,
        is_damaged: bool,
    ) -> bool {
        let usual = self.habits.iter().find(|habit| habit.interface == interface);
        let usual = usual.and_then(InterfaceHabit::way);
        let parsed = FrameView::parse(frame.bytes).ok().filter(|_| !is_damaged);
        let Some(view) = parsed else { return usual.unwrap_or(false) };
        while self.under_way.front().is_some_and(|first| first.time + LONGEST < frame.time)
            || self.under_way.len() >= MOST_UNDER_WAY
        {
            self.under_way.pop_front();
        }
        let key = key(&view);
        let is_other = |first: &FirstCopy| first.key == key && first.channel == channel;
        match self.under_way.iter().position(is_other) {
            Some(at) => {
                let first = self.under_way.remove(at);
                if let Some(first) = first {
                    self.habit(first.interface).firsts += 1;
                }
                self.habit(interface).seconds += 1;
                usual.unwrap_or(true)
            }
            None => {
                let time = frame.time;
                self.under_way.push_back(FirstCopy { key, channel, time, interface });
                usual.unwrap_or(false)
            }
        }
    }

    fn habit(&mut self, interface: u32) -> &mut InterfaceHabit {
        let known = self.habits.iter().position(|habit| habit.interface == interface);
        let at = known.unwrap_or_else(|| {
            self.habits.push(InterfaceHabit { interface, firsts: 0, seconds: 0 });
            self.habits.len() - 1
        });
        &mut self.habits[at]
    }
}

impl InterfaceHabit {
    /// True for the way back, false for the way out; `None` where it takes both, or too little is known.
    fn way(&self) -> Option<bool> {
        let Self { firsts, seconds, .. } = *self;
        let all = firsts + seconds;
        let is_most = |some: u64| some * 100 >= all * ONE_WAY_PERCENT;
        if all < KNOWN_AFTER {
            None
        } else if is_most(seconds) {
            Some(true)
        } else if is_most(firsts) {
            Some(false)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::ethernet::MacAddress;
    use linesman_proto::time::Span;

    use super::*;
    use crate::ask::tests::frame::{Frame, lrw};
    use crate::observe::Direction;

    /// Ports of frames that come out by one interface and back by another; every tenth comes only back.
    fn ports(interfaces: [u32; 2]) -> Vec<(bool, u8)> {
        let mut ways = TapWays::default();
        let mut found = Vec::new();
        for cycle in 0..100_u64 {
            let out = Frame::from(MacAddress([2; 6]), cycle as u8, &[lrw(0, &[cycle as u8; 4])]);
            let back = out.clone().returned(&[3]);
            let at = Instant::ZERO + Span::ms(cycle);
            let copies = [(false, &out, at), (true, &back, at + Span::us(20))];
            for (is_back, frame, time) in copies {
                if !is_back && cycle % 10 == 9 {
                    continue;
                }
                let seen = FrameSeen {
                    network: Default::default(),
                    path: None,
                    direction: Direction::Received,
                    time,
                    number: cycle,
                    fcs: None,
                    truncated: false,
                    probe: None,
                    bytes: &frame.0,
                };
                let interface = interfaces[usize::from(is_back)];
                found.push((is_back, ways.record(2, interface, &seen).port.unwrap()));
            }
        }
        found
    }

    #[test]
    fn first_copy_by_one_interface_goes_out_and_second_comes_back() {
        let found = ports([7, 7]);
        let wrong = found.iter().filter(|(is_back, port)| *port != 4 + u8::from(*is_back)).count();
        assert_eq!(wrong, 10, "copies that only came back cannot be told: {found:?}");
    }

    #[test]
    fn interface_of_one_way_tells_the_way_of_a_copy_without_another() {
        let found = ports([7, 3]);
        let wrong = found.iter().filter(|(is_back, port)| *port != 4 + u8::from(*is_back)).count();
        assert_eq!(wrong, 1, "the one before the habit of the interface was known: {found:?}");
    }
}
