//! Throughput to expect of EoE (S0 L2899-2925): by the size of the mailbox, the fastest cycle and the free bandwidth.
//!
//! A TCP segment of 1,460 bytes is a frame of 1,514, and that is as many mailbox messages as it has fragments. The messages
//! of some cycles are played in advance: beside the cyclic frames so many others leave in each cycle
//! ([`ACYCLIC_FRAMES`]), one behind the answer to the other, and all share the wire. A message from a SubDevice takes two frames, a
//! look whether there is one and the mailbox itself; one to it takes one, and one more for each try that finds the mailbox
//! full ([`FullPause`]). Divided numbers (one message in a cycle, or the share of the wire that is free) are 25 % off and
//! more: they leave out that two messages fit into a cycle, and that a frame waits for the answer to the one before.

use linesman_proto::address::DeviceId;
use linesman_proto::ethernet::{MAX_LEN, MIN_LEN};
use linesman_proto::frame::size::{BYTE_NS, WIRE_OVERHEAD, frame_size, wire_time};
use linesman_proto::mailbox::HEADER_LEN;
use linesman_proto::mailbox::eoe::{EOE_HEADER_LEN, fragments};
use linesman_proto::register::SYNC_MANAGER;
use linesman_proto::time::{Instant, Span};

use super::FullPause;
use crate::plan::{DevicePlan, Plan};

/// Frames of procedures that leave in a cycle, at most.
pub const ACYCLIC_FRAMES: usize = 4;
/// Bytes of registers from the status of SyncManager 0 to that of SyncManager 1, with both: they are read in the frame of each
/// fragment to a SubDevice, and tell which mailbox is full.
pub const MAILBOX_STATUSES: u16 = SYNC_MANAGER.len + 1;
/// The longest frame without a VLAN tag, in bytes.
const FRAME: usize = 1_514;
/// What of it is data of a TCP connection, in bytes: without the headers of Ethernet, IP and TCP.
const DATA: u64 = 1_460;
/// The cycle of a line without cyclic frames: the mailbox is looked into so often.
const WITHOUT_CYCLE: Span = Span::ms(1);
/// Time that a SubDevice is taken to need for a message. No plan tells: it is what those of a virtual segment need.
const MESSAGE_TIME: Span = Span::us(600);
/// Cycles that are played before messages are counted: a wire that is nearly full takes so long until as many frames wait
/// as will.
const SETTLING: u64 = 500;
/// Cycles in which they are counted.
const COUNTED: u64 = 1_500;
/// Share of the rate that one cause takes away at least before it counts as the limit, in percent.
const NOTABLE_PERCENT: u64 = 5;

/// What limits the throughput.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum RateLimit {
    /// Frames beside the cyclic ones in each cycle.
    Cycle,
    /// The time that cyclic frames leave on the wire.
    Bandwidth,
    /// The time that the SubDevice takes for a message: 600 µs are assumed.
    SubDevice,
}

/// The throughput to expect of one SubDevice, in one direction, while nothing goes the other way.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct EthernetRate {
    /// Whose.
    pub device: DeviceId,
    /// From the SubDevice; else to it.
    pub from_device: bool,
    /// Size of its mailbox, in bytes.
    pub mailbox: usize,
    /// Fragments of a frame of 1,514 bytes.
    pub fragments: usize,
    /// Time that one message takes, on average.
    pub period: Span,
    /// What makes it take so long.
    pub limit: RateLimit,
    /// Data in TCP segments of 1,460 bytes, in bytes a second, without acknowledgements.
    pub bytes_per_second: u64,
}

impl EthernetRate {
    /// Data of a TCP connection from the SubDevice, in bytes a second, when every second segment is acknowledged:
    /// the frame of an acknowledgement is one mailbox message the other way, and takes one frame where a message from the
    /// SubDevice takes two. `None` in the other direction: no plan tells how soon a SubDevice acknowledges. With large
    /// mailboxes and cycles below 1 ms it may be some quarter less: the time that the SubDevice takes for an acknowledgement is
    /// left out.
    #[must_use]
    pub fn tcp_bytes_per_second(&self) -> Option<u64> {
        let fragments = self.fragments as u64;
        self.from_device.then(|| self.bytes_per_second * 4 * fragments / (4 * fragments + 1))
    }
}

impl Plan {
    /// The throughput to expect of each SubDevice that speaks EoE, to it and from it.
    #[must_use]
    pub fn ethernet_rates(&self) -> Vec<EthernetRate> {
        let rates = |device| [false, true].map(|from| self.ethernet_rate(device, from));
        self.ethernet_devices().flat_map(rates).flatten().collect()
    }

    fn ethernet_rate(&self, device: &DevicePlan, from_device: bool) -> Option<EthernetRate> {
        let areas = device.mailbox?.areas;
        let area = if from_device { areas.send } else { areas.receive };
        let mailbox = usize::from(area.size);
        let room = mailbox.checked_sub(HEADER_LEN + EOE_HEADER_LEN).filter(|room| *room >= 32)?;
        let fragments = fragments(&[0; FRAME], 0, 0, room + EOE_HEADER_LEN).count();
        let period = |loads: bool, message_time: Span| {
            let mut wire = PlayedWire::of(self, loads);
            let messages = match from_device {
                true => wire.messages_from(mailbox, device.mailbox_state.is_some()),
                false => wire.messages_to(mailbox, message_time),
            };
            (wire.end - wire.begin) / messages.max(1)
        };
        let found = period(true, MESSAGE_TIME);
        let is_shortened = |other: u64| other * (100 + NOTABLE_PERCENT) < found * 100;
        let limit = if is_shortened(period(false, MESSAGE_TIME)) {
            RateLimit::Bandwidth
        } else if is_shortened(period(true, Span::ZERO)) {
            RateLimit::SubDevice
        } else {
            RateLimit::Cycle
        };
        let for_frame = found.saturating_mul(fragments as u64).max(1);
        Some(EthernetRate {
            device: device.id,
            from_device,
            mailbox,
            fragments,
            period: Span::ns(found),
            limit,
            bytes_per_second: DATA * 1_000_000_000 / for_frame,
        })
    }
}

/// The wire while messages of one SubDevice go over it, played in advance. All times in ns from the first cycle on.
struct PlayedWire {
    /// When cyclic frames leave, and how long they hold the wire, in order of time.
    cyclic: Vec<(u64, u64)>,
    next: usize,
    /// Until when the wire is held.
    held: u64,
    /// Frames that may still leave in this cycle.
    left: usize,
    /// From the end of a frame on the wire until it is back.
    way: u64,
    /// From when on messages are counted.
    begin: u64,
    /// The end of what is played.
    end: u64,
    /// Messages that were counted.
    count: u64,
    /// The cycle has read that the mailbox holds something, and nobody has fetched it since: when it was back.
    told_full: Option<u64>,
}

impl PlayedWire {
    /// The wire of a plan; without the load of its cyclic frames it has only their times.
    fn of(plan: &Plan, loads: bool) -> Self {
        let tasks: Vec<(u64, u64)> = (plan.tasks.iter())
            .filter(|task| !task.frames.is_empty())
            .map(|task| {
                let wire = task.frames.iter().map(|frame| wire_time(frame.size()).as_nanos());
                (task.cycle.as_nanos().max(1), if loads { wire.sum() } else { 0 })
            })
            .collect();
        let fastest = tasks.iter().map(|(cycle, _)| *cycle).min();
        let begin = fastest.unwrap_or(WITHOUT_CYCLE.as_nanos()) * SETTLING;
        let end = begin / SETTLING * (SETTLING + COUNTED);
        let tasks = if tasks.is_empty() { vec![(WITHOUT_CYCLE.as_nanos(), 0)] } else { tasks };
        let mut cyclic: Vec<(u64, u64)> = (tasks.iter())
            .flat_map(|(cycle, wire)| (0..=end / cycle).map(move |at| (at * cycle, *wire)))
            .collect();
        cyclic.sort_unstable();
        let way = plan.least_delay().as_nanos();
        Self { cyclic, next: 0, held: 0, left: 0, way, begin, end, count: 0, told_full: None }
    }

    /// Sends datagrams of procedures of so many bytes that are ready at `now`, in one frame where the time until the next
    /// cycle has room for it. Gives the time at which they have passed the SubDevices, if that is before the end.
    fn send(&mut self, mut now: u64, mut datagrams: &[usize]) -> Option<u64> {
        let shortest = wire_time(MIN_LEN).as_nanos();
        let mut back = None;
        while !datagrams.is_empty() {
            while let Some((at, wire)) = self.cyclic.get(self.next).filter(|(at, _)| *at <= now) {
                self.held = self.held.max(*at) + wire;
                self.left = ACYCLIC_FRAMES;
                self.told_full = Some(self.held + self.way);
                self.next += 1;
            }
            let (due, _) = self.cyclic.get(self.next)?;
            // A frame that would be under way when the next cycle begins is not sent, unless none else was.
            if self.left == 0 || self.left < ACYCLIC_FRAMES && due - now < shortest {
                now = *due;
                continue;
            }
            let room = usize::try_from((due - now) / BYTE_NS).unwrap_or(MAX_LEN);
            let room = room.saturating_sub(WIRE_OVERHEAD).clamp(MIN_LEN, MAX_LEN);
            let size = |count: usize| frame_size(datagrams[..count].iter().copied());
            let count = (2..=datagrams.len()).rev().find(|count| size(*count) <= room).unwrap_or(1);
            self.left -= 1;
            self.held = self.held.max(now) + wire_time(size(count)).as_nanos();
            // The gap behind a frame is no time of its own.
            back = Some((self.held + self.way).saturating_sub(12 * BYTE_NS));
            datagrams = &datagrams[count..];
        }
        back.filter(|back| *back < self.end)
    }

    /// A message has passed.
    fn passed(&mut self, at: u64) {
        self.count += u64::from(at >= self.begin);
    }

    /// Messages that come of a SubDevice that always has one.
    fn messages_from(&mut self, mailbox: usize, is_mapped: bool) -> u64 {
        let mut now = 0;
        loop {
            let told = self.told_full.take_if(|at| is_mapped && *at <= now).is_some();
            if !told {
                let Some(looked) = self.send(now, &[1]) else { return self.count };
                now = looked;
            }
            let Some(fetched) = self.send(now, &[mailbox]) else { return self.count };
            now = fetched;
            self.passed(now);
        }
    }

    /// Messages that go to a SubDevice that takes so long for each; the next one waits in its mailbox meanwhile.
    fn messages_to(&mut self, mailbox: usize, message_time: Span) -> u64 {
        let mut now = 0;
        // When the message that is worked on is done, and the one that waits behind it.
        let (mut busy, mut waits) = (0, false);
        let mut pause = FullPause::default();
        loop {
            let Some(written) = self.send(now, &[mailbox, MAILBOX_STATUSES.into()]) else {
                return self.count;
            };
            now = written;
            if waits && busy <= written {
                (busy, waits) = (busy + message_time.as_nanos(), false);
            }
            if !waits {
                match busy <= written {
                    true => busy = written + message_time.as_nanos(),
                    false => waits = true,
                }
                self.passed(now);
                pause.accepted(Instant::from_nanos(now));
                continue;
            }
            now += pause.refused(Instant::from_nanos(now)).as_nanos();
        }
    }
}
