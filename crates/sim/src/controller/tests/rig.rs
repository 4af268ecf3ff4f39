//! A controller on the bench: frames in, frames out.

use linesman_proto::port::PortMap;
use linesman_proto::time::Span;

use crate::hardware::{CountingProfile, Hardware, PortKind, Timing};

/// A controller like an ET1100 with four ports and forwarded counters.
pub(crate) fn hardware() -> Hardware {
    Hardware {
        controller_type: 0x11,
        revision: 0,
        build: 2,
        fmmus: 8,
        sync_managers: 8,
        ram_kib: 8,
        // Distributed clocks of 64 bits, separate forwarded errors.
        features: 0x008C,
        ports: PortMap([PortKind::Mii, PortKind::Ebus, PortKind::Mii, PortKind::Ebus]),
        counting: CountingProfile {
            forwarded: true,
            remakes_symbol_errors: false,
            counts_when_closed: false,
            counts_missing_start: true,
        },
        timing: Timing {
            forward: Span::ns(130),
            process: Span::ns(150),
            ebus_crossing: Span::ns(20),
            mii_crossing: Span::ns(400),
            ebus_loss_detection: Span::us(2),
            mii_loss_detection: Span::us(15),
            ebus_link_up: Span::us(500),
            mii_link_up: Span::ms(1_500),
        },
    }
}
