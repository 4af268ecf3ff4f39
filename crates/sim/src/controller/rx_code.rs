//! Extended receive errors: counters that run whether a port is open or closed, and the reason of
//! the first error behind a clear.
//!
//! Reference: S2 2.9.7 (0x0314), 2.9.8 and table 12 (0x0320). ET1150 and IP core from 4.0.0 on have
//! them.

use linesman_proto::port::{Port, PortMap};
use linesman_proto::register as r;
use linesman_proto::time::Instant;

use super::core::Core;
use super::memory::Rights;
use super::port_event::CountKind;

const IDLE_SYMBOL: u8 = 0x30;
const SYMBOL_IN_FRAME: u8 = 0x40;
const CHECKSUM: u8 = 0x60;
const FORWARDED: u8 = 0x61;

/// Reasons that the processing unit finds in an intact frame (S2 table 12).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum UnitError {
    /// It ends before its datagrams do.
    Short,
    /// It has come round the ring.
    Circulating,
    /// There is no EtherCAT in it.
    Foreign,
}

impl UnitError {
    const fn code(self) -> u8 {
        match self {
            Self::Short => 0x70,
            Self::Circulating => 0x72,
            Self::Foreign => 0x78,
        }
    }
}

/// Ends of the frames that came in at the ports, for a controller that keeps reasons of receive errors (0x0320).
#[derive(Clone, Debug)]
pub(super) struct RxReasons(Option<PortMap<Instant>>);

impl RxReasons {
    /// `are_kept` if the controller has the registers.
    pub(super) fn new(are_kept: bool) -> Self {
        Self(are_kept.then_some(PortMap([Instant::ZERO; 4])))
    }

    /// When the last frame of a port ends, to be set as one comes in; `None` where nobody keeps it.
    #[inline]
    pub(super) fn frame_ends(&mut self, port: Port) -> Option<&mut Instant> {
        self.0.as_mut().map(|ends| &mut ends[port])
    }

    fn is_in_frame(&self, port: Port, when: Instant) -> bool {
        self.0.as_ref().is_some_and(|ends| when < ends[port])
    }
}

impl Core {
    /// A port saw an error.
    pub(super) fn note_rx_error(&mut self, port: Port, kind: CountKind, when: Instant) {
        let code = match kind {
            CountKind::SymbolError if self.rx_reasons.is_in_frame(port, when) => SYMBOL_IN_FRAME,
            CountKind::SymbolError => IDLE_SYMBOL,
            CountKind::InvalidFrame => CHECKSUM,
            CountKind::ForwardedError => FORWARDED,
            // Damaged frames were noted at their port; the content is noted by the unit itself.
            CountKind::ProcessingUnitError | CountKind::LostLink => return,
        };
        self.put_rx_error(port, code);
    }

    /// The processing unit found fault with a frame that came by `port`.
    pub(super) fn note_unit_error(&mut self, port: Port, error: UnitError) {
        self.put_rx_error(port, error.code());
    }

    fn put_rx_error(&mut self, port: Port, code: u8) {
        let counter = usize::from(r::EXTENDED_RX_ERROR_COUNTER.of_port(port).0);
        if self.rights.byte(counter) & Rights::READ == 0 {
            return;
        }
        let before = self.memory.bytes()[counter];
        self.memory.put(counter, &[before.saturating_add(1)]);
        if before == 0 {
            let at = usize::from(r::RX_ERROR_CODE.of_port(port).0);
            self.memory.put(at, &[code, 0]);
        }
    }
}
