//! Capture probe on links: what passes it, in both directions, as it is at this point of the cable.
//!
//! A probe with several channels (ET2000: four) is looped into links. Each channel sits at a plug: between a port
//! and the cable that leads away from it. The port of the probe with the even number receives what comes from
//! upstream, that with the odd number what comes from downstream. What the port's own output has done to a frame
//! is seen, what the cable does behind the probe is not.
//!
//! References: `docs/SOURCES.md`, ET2000: less than 1 µs delay, stamps of 1 ns, right within 40 ns. A frame that a
//! controller found bad carries an odd nibble more: to the probe an alignment error beside that of the check
//! sequence (facts of the ESC, RX error counters).

use linesman_config::fault::FaultName;
use linesman_proto::esl::EslRecord;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::End;

use super::change::DirectedLink;
use super::world::World;
use crate::event_queue::EventQueue;
use crate::frame::WireFrame;
use crate::seed::Stream;
use crate::truth::FaultId;

/// Channels of a probe, of two ports each.
pub(crate) const CHANNELS: usize = 6;
/// Delay that a probe adds to the transit of its link.
const DELAY: Span = Span::ns(600);
/// Its stamps are later than the first bit by this much at most, in ns.
const ACCURACY_NS: u64 = 40;

/// A frame that a capture probe has seen.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ProbeFrame {
    /// When its first bit came, without the error of the stamp.
    pub at: Instant,
    /// Record that the probe adds to the frame.
    pub record: EslRecord,
}

/// A probe, and what it has seen.
#[derive(Debug)]
pub(crate) struct LoopedProbe {
    channels: Vec<ProbeChannel>,
    stamps: Stream,
    frames: EventQueue<(ProbeFrame, Vec<u8>)>,
}

#[derive(Clone, Copy, Debug)]
struct ProbeChannel {
    link: usize,
    /// Which end of the link it is plugged into.
    is_downstream: bool,
}

/// Stage of its way over a link at which something happens to a frame.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum DamageStage {
    Output,
    Cable,
    Input,
}

/// A frame on a link as the probe on it sees it.
#[derive(Debug)]
pub(super) struct ProbeView {
    port: u8,
    is_at_receiver: bool,
    frame: WireFrame,
}

impl LoopedProbe {
    pub(crate) fn new(stamps: Stream) -> Self {
        Self { channels: Vec::new(), stamps, frames: EventQueue::default() }
    }

    fn channel(&self, direction: DirectedLink) -> Option<(u8, bool)> {
        let at = self.channels.iter().position(|channel| channel.link == direction.link)?;
        let port = 2 * at as u8 + u8::from(!direction.downstream);
        Some((port, self.channels[at].is_downstream == direction.downstream))
    }
}

impl World {
    /// Plugs the next channel of a probe in at an end of a link; false if the link has one, or the probe no more.
    pub(crate) fn plug_probe(&mut self, link: usize, end: End) -> bool {
        let is_downstream = self.links[link].downstream == end;
        let Some(probe) = &mut self.capture_probe else { return false };
        let is_taken = probe.channels.iter().any(|channel| channel.link == link);
        if is_taken || probe.channels.len() == CHANNELS {
            return false;
        }
        probe.channels.push(ProbeChannel { link, is_downstream });
        self.links[link].transit += DELAY;
        self.probe_changes_round();
        true
    }

    /// The next frame that a probe has seen by `until`.
    pub(crate) fn poll_probe_frame(&mut self, until: Instant) -> Option<(ProbeFrame, Vec<u8>)> {
        let probe = self.capture_probe.as_mut()?;
        probe.frames.pop_until(until).map(|(_, frame)| frame)
    }

    /// A frame gets onto a link: what a probe on it is going to see.
    pub(super) fn probe_view(
        &self,
        direction: DirectedLink,
        frame: &WireFrame,
    ) -> Option<Box<ProbeView>> {
        let (port, is_at_receiver) = self.capture_probe.as_ref()?.channel(direction)?;
        Some(Box::new(ProbeView { port, is_at_receiver, frame: frame.clone() }))
    }

    /// True if what a fault does on a link comes before the probe.
    pub(super) fn is_before_probe(
        &self,
        view: &ProbeView,
        direction: DirectedLink,
        fault: FaultId,
    ) -> bool {
        let (from, _) = self.links[direction.link].from_to(direction.downstream);
        let name = self.truth.fault(fault).map(|fault| fault.name);
        let stage = match name {
            Some(FaultName::TransmitterDamaged) => DamageStage::Output,
            Some(FaultName::ReceiverDamaged) => DamageStage::Input,
            Some(FaultName::NicDamaged) if from.node().is_none() => DamageStage::Output,
            Some(FaultName::NicDamaged) => DamageStage::Input,
            Some(_) | None => DamageStage::Cable,
        };
        let last = if view.is_at_receiver { DamageStage::Cable } else { DamageStage::Output };
        stage <= last
    }

    /// A frame that got onto a link at `at` has passed the probe on it.
    pub(super) fn passes_probe(&mut self, view: ProbeView, direction: DirectedLink, at: Instant) {
        let link = &self.links[direction.link];
        let ports = self.ports(link.upstream, link.downstream, link.kind);
        let half = Span::ns(ports.as_nanos() / 2);
        let at = match view.is_at_receiver {
            true => (at + link.transit).before(half),
            false => at + half,
        };
        let ProbeView { port, frame, .. } = view;
        let Some(probe) = &mut self.capture_probe else { return };
        let record = EslRecord {
            port: Some(port),
            crc_error: !frame.damage.is_intact(),
            alignment_error: frame.damage.marked,
            time_ns: at.as_nanos() + probe.stamps.below(ACCURACY_NS + 1),
        };
        probe.frames.push(at, (ProbeFrame { at, record }, frame.bytes));
    }
}

impl ProbeView {
    pub(super) const fn is_at_receiver(&self) -> bool {
        self.is_at_receiver
    }

    /// The frame is cut off behind so many bytes.
    pub(super) fn cut_off(&mut self, bytes: usize) {
        self.frame.bytes.truncate(bytes);
        self.frame.damage.cut_off = true;
    }

    /// A byte is changed that is `offset` behind the first bit.
    pub(super) fn spoil(&mut self, offset: Span, flip: u8) {
        let at = self.frame.byte_at(offset);
        if let Some(byte) = at.and_then(|byte| self.frame.bytes.get_mut(byte)) {
            *byte ^= flip;
        }
        self.frame.damage.fcs_bad = true;
    }
}
