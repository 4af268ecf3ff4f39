//! Throughput to expect of EoE (S0 L2899-2925): by the size of the mailbox, the fastest cycle and the free bandwidth.
//!
//! The mailbox of a SubDevice takes one message and gives one in each cycle of the fastest task. A TCP segment of 1,460 bytes
//! is a frame of 1,514, and that is as many messages as it has fragments. Where the wire has less time left than that
//! takes, it is the free bandwidth that counts. To a SubDevice that takes messages quicker than the cycle it may be more: a mailbox that
//! was full is tried again within the cycle.

use linesman_proto::address::DeviceId;
use linesman_proto::frame::size::{frame_size, wire_time};
use linesman_proto::mailbox::HEADER_LEN;
use linesman_proto::mailbox::eoe::{EOE_HEADER_LEN, fragments};
use linesman_proto::time::Span;

use crate::plan::{DevicePlan, Plan};

/// The longest frame without a VLAN tag, in bytes.
const FRAME: usize = 1_514;
/// What of it is data of a TCP connection, in bytes: without the headers of Ethernet, IP and TCP.
const DATA: u64 = 1_460;
/// The cycle of a line without cyclic frames: the mailbox is looked into so often.
const WITHOUT_CYCLE: Span = Span::ms(1);

/// What limits the throughput.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum RateLimit {
    /// One message in each cycle.
    Cycle,
    /// The time that cyclic frames leave on the wire.
    Bandwidth,
}

/// The throughput to expect of one SubDevice, in one direction.
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
    /// Time that one message takes.
    pub period: Span,
    /// What makes it take so long.
    pub limit: RateLimit,
    /// Data of a TCP connection, in bytes a second.
    pub bytes_per_second: u64,
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
        let cycles =
            self.tasks.iter().filter(|task| !task.frames.is_empty()).map(|task| task.cycle);
        let cycle = cycles.min().unwrap_or(WITHOUT_CYCLE);
        // The message itself, and a look whether there is room for it, or one to be fetched.
        let wire = wire_time(frame_size([mailbox])) + wire_time(frame_size([1]));
        let free = (100.0 - self.load_percent()).max(0.1);
        let bandwidth = Span::ns((wire.as_nanos() as f64 * 100.0 / free) as u64);
        let (period, limit) = match bandwidth > cycle {
            true => (bandwidth, RateLimit::Bandwidth),
            false => (cycle, RateLimit::Cycle),
        };
        let for_frame = period.as_nanos().saturating_mul(fragments as u64).max(1);
        Some(EthernetRate {
            device: device.id,
            from_device,
            mailbox,
            fragments,
            period,
            limit,
            bytes_per_second: DATA * 1_000_000_000 / for_frame,
        })
    }
}
