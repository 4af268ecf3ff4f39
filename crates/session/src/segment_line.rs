//! Virtual segment as a line: its cards, in virtual time.

use linesman_diagnosis::HostObservation;
use linesman_maindevice::Options;
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment::{HostPort, Segment};

use crate::card::{CardSample, CardWatch};
use crate::transport::{FrameSink, RxFrame};

/// Interval at which the virtual cards' counters are looked at, if nothing is told of their links.
const LOOK_EVERY: Span = Span::ms(100);
/// The longest frame, without check sequence.
const FRAME: usize = 1_514;

/// A segment, its cards and their time.
pub struct SegmentLine {
    segment: Segment,
    paths: usize,
    now: Instant,
    arrival: Vec<u8>,
    look_at: Instant,
    cards: [SegmentCard; 2],
}

/// A card: what it had counted when it was looked at last.
#[derive(Clone, Copy, Default)]
struct SegmentCard {
    watch: CardWatch,
    counted: HostPort,
}

impl SegmentLine {
    /// A segment with one card, or with two at the ends of a ring.
    #[must_use]
    pub fn new(segment: Segment, ring: bool) -> Self {
        Self {
            segment,
            paths: if ring { 2 } else { 1 },
            now: Instant::ZERO,
            arrival: Vec::with_capacity(FRAME),
            look_at: Instant::ZERO,
            cards: [SegmentCard::default(); 2],
        }
    }

    /// The segment.
    #[must_use]
    pub const fn segment(&self) -> &Segment {
        &self.segment
    }

    /// The segment, to break and heal it, or to set what its inputs see.
    pub const fn segment_mut(&mut self) -> &mut Segment {
        &mut self.segment
    }

    /// The cards.
    pub fn paths(&self) -> impl Iterator<Item = Path> + use<> {
        Path::ALL.into_iter().take(self.paths)
    }

    /// Options of a MainDevice for this line: `options` with what the length of the line and its cards ask for.
    #[must_use]
    pub fn options(&self, options: Options) -> Options {
        let options = Options { ring: self.paths > 1, ..options };
        options.on_line(self.segment.tree().len(), self.segment.longest_way())
    }

    /// The present.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// It is `now`, unless it is later already; the segment gets there when time [advances](Self::advance).
    pub fn set_now(&mut self, now: Instant) {
        self.now = self.now.max(now);
    }

    /// Time passes up to `now`, never back.
    pub fn advance(&mut self, now: Instant) {
        self.set_now(now);
        self.segment.advance(self.now);
    }

    /// When something happens on the segment, or the cards are looked at.
    #[must_use]
    pub fn poll_timeout(&self) -> Instant {
        self.segment.poll_timeout().map_or(self.look_at, |at| at.min(self.look_at))
    }

    /// Takes in what has come back; gives how many frames that were, damaged ones among them.
    pub fn receive(&mut self, sink: &mut dyn FrameSink) -> usize {
        let mut count = 0;
        while let Some(came) = self.segment.poll_arrival(&mut self.arrival) {
            count += 1;
            // What is not intact the card drops and counts; nobody behind it sees it.
            if came.intact {
                let room = sink.room();
                let len = self.arrival.len().min(room.len());
                room[..len].copy_from_slice(&self.arrival[..len]);
                let truncated = len < self.arrival.len();
                sink.frame_received(RxFrame { at: came.at, path: came.path, len, truncated });
            }
        }
        count
    }

    /// Sends a frame.
    pub fn send(&mut self, path: Path, frame: &[u8]) {
        self.segment.handle_frame(self.now, path, frame);
    }

    /// Tells what the cards noticed, if it is time to look or they have news of their links. Without `counters`
    /// nothing is told of frames that were spoiled or dropped.
    pub fn look_at_host(&mut self, counters: bool, tell: &mut dyn FnMut(&HostObservation)) {
        let has_news = self.segment.takes_card_news();
        if !has_news && self.now < self.look_at {
            return;
        }
        self.look_at = self.now + LOOK_EVERY;
        for path in self.paths() {
            let card = &mut self.cards[path.index()];
            let port = self.segment.host(path);
            let before = std::mem::replace(&mut card.counted, port);
            let mut sample = CardSample {
                carrier: port.carrier,
                carrier_changes: port.carrier_changes - before.carrier_changes,
                send_failures: port.tx_dropped - before.tx_dropped,
                ..CardSample::default()
            };
            if counters {
                sample.crc = port.rx_crc_errors - before.rx_crc_errors;
                sample.damaged = port.rx_length_errors - before.rx_length_errors;
                sample.card_drops = port.rx_dropped - before.rx_dropped;
            }
            for what in card.watch.events(&sample) {
                let network = Network::default();
                tell(&HostObservation { network, path, time: self.now, what });
            }
        }
    }
}
