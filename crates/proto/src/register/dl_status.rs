//! DL status (0x0110): how each port stands.
//!
//! Reference: S2 2.4.3 and table 2. The low byte carries the links, the high byte two bits per
//! port: loop closed, communication.

use std::fmt;

use crate::port::Port;

/// The DL status register.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct DlStatus(pub u16);

impl DlStatus {
    const PDI_OPERATIONAL: u16 = 1 << 0;
    const PDI_WATCHDOG_OK: u16 = 1 << 1;
    const ENHANCED_LINK_DETECTION: u16 = 1 << 2;

    /// From the two bytes of the register.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 2]) -> Self {
        Self(u16::from_le_bytes(bytes))
    }

    /// The two bytes of the register.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 2] {
        self.0.to_le_bytes()
    }

    /// The register value.
    #[must_use]
    pub const fn value(self) -> u16 {
        self.0
    }

    /// Whether the SII was loaded without error, so that PDI and process RAM can be used.
    #[must_use]
    pub const fn pdi_operational(self) -> bool {
        self.0 & Self::PDI_OPERATIONAL != 0
    }

    /// Whether the PDI watchdog has not expired.
    #[must_use]
    pub const fn pdi_watchdog_ok(self) -> bool {
        self.0 & Self::PDI_WATCHDOG_OK != 0
    }

    /// Whether enhanced link detection is on for at least one port.
    #[must_use]
    pub const fn enhanced_link_detection(self) -> bool {
        self.0 & Self::ENHANCED_LINK_DETECTION != 0
    }

    /// How a port stands.
    #[must_use]
    pub const fn port_state(self, port: Port) -> PortState {
        PortState {
            link: self.0 & Self::link_bit(port) != 0,
            closed: self.0 & Self::closed_bit(port) != 0,
            communication: self.0 & Self::communication_bit(port) != 0,
        }
    }

    /// The ports in use: open with stable communication, in the order of their numbers.
    pub fn active_ports(self) -> impl Iterator<Item = Port> {
        Port::ALL.into_iter().filter(move |port| self.port_state(*port).is_active())
    }

    /// This status with another state of the SII and PDI.
    #[must_use]
    pub const fn with_pdi(self, operational: bool, watchdog_ok: bool) -> Self {
        self.set(Self::PDI_OPERATIONAL, operational).set(Self::PDI_WATCHDOG_OK, watchdog_ok)
    }

    /// This status with enhanced link detection on or off.
    #[must_use]
    pub const fn with_enhanced_link_detection(self, on: bool) -> Self {
        self.set(Self::ENHANCED_LINK_DETECTION, on)
    }

    /// This status with another state of a port.
    #[must_use]
    pub const fn with_port(self, port: Port, status: PortState) -> Self {
        self.set(Self::link_bit(port), status.link)
            .set(Self::closed_bit(port), status.closed)
            .set(Self::communication_bit(port), status.communication)
    }

    const fn set(self, bit: u16, on: bool) -> Self {
        Self(if on { self.0 | bit } else { self.0 & !bit })
    }

    const fn link_bit(port: Port) -> u16 {
        1 << (4 + port.index())
    }

    const fn closed_bit(port: Port) -> u16 {
        1 << (8 + 2 * port.index())
    }

    const fn communication_bit(port: Port) -> u16 {
        1 << (9 + 2 * port.index())
    }
}

impl fmt::Display for DlStatus {
    /// Each port in turn, then what is wrong with SII and PDI: `A carrier, open; B no carrier,
    /// closed; …; SII not loaded`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for port in Port::ALL {
            let gap = if port == Port::A { "" } else { "; " };
            write!(f, "{gap}{port} {}", self.port_state(port))?;
        }
        if !self.pdi_operational() {
            f.write_str("; SII not loaded")?;
        }
        if !self.pdi_watchdog_ok() {
            f.write_str("; PDI watchdog expired")?;
        }
        Ok(())
    }
}

/// How a port stands: three facts that go together in few ways only.
///
/// | link | closed | communication | |
/// |---|---|---|---|
/// | yes | no | yes | in use |
/// | no | yes | no | not in use |
/// | yes | yes | any | carrier, but the loop was closed by hand or the peer does not talk |
/// | no | no | no | held open by hand: frames die here |
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct PortState {
    /// There is a carrier.
    pub link: bool,
    /// The loop is closed: frames do not leave here but go on to the next port.
    pub closed: bool,
    /// Communication is stable.
    pub communication: bool,
}

impl PortState {
    /// A port with a neighbour that talks.
    pub const IN_USE: Self = Self { link: true, closed: false, communication: true };
    /// A port with nothing plugged.
    pub const UNUSED: Self = Self { link: false, closed: true, communication: false };

    /// Whether frames leave and return here: open with stable communication. The rule by which
    /// the tree of a segment is built.
    #[must_use]
    pub const fn is_active(self) -> bool {
        self.communication && !self.closed
    }

    /// Whether there is a carrier but no traffic: a half-broken cable, a peer whose logic has no
    /// supply, or a loop closed by hand.
    #[must_use]
    pub const fn is_link_without_communication(self) -> bool {
        self.link && !self.is_active()
    }
}

impl fmt::Display for PortState {
    /// `carrier, open`, `no carrier, closed`, `carrier, no communication, closed`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.link, self.communication) {
            (true, true) => "carrier, ",
            (true, false) => "carrier, no communication, ",
            (false, true) => "no carrier, communication, ",
            (false, false) => "no carrier, ",
        })?;
        f.write_str(if self.closed { "closed" } else { "open" })
    }
}

/// How the register table writes this register: as a whole, or its high byte alone, which some
/// MainDevices poll because it has loops and communication of all ports.
pub(super) fn view(offset: u16, data: &[u8]) -> Option<String> {
    match (offset, data) {
        (0, [low, high, ..]) => Some(DlStatus::from_bytes([*low, *high]).to_string()),
        (1, [high, ..]) => {
            let status = DlStatus::from_bytes([0, *high]);
            let ports = Port::ALL.map(|port| {
                let state = status.port_state(port);
                let communication = if state.communication { "" } else { "no " };
                let opening = if state.closed { "closed" } else { "open" };
                format!("{port} {communication}communication, {opening}")
            });
            Some(ports.join("; "))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A status as a controller with this many used ports and a loaded SII shows it.
    fn status(used: &[Port]) -> DlStatus {
        Port::ALL.into_iter().fold(
            DlStatus::default().with_pdi(true, true).with_enhanced_link_detection(true),
            |status, port| {
                let used = used.contains(&port);
                status.with_port(port, if used { PortState::IN_USE } else { PortState::UNUSED })
            },
        )
    }

    // proves: ESC-14 partial
    #[test]
    fn the_words_of_the_sources() {
        assert_eq!(status(&[Port::A]), DlStatus(0x5617));
        assert_eq!(
            DlStatus(0x5617).to_string(),
            "A carrier, open; B no carrier, closed; C no carrier, closed; D no carrier, closed"
        );
        assert_eq!(status(&[Port::A, Port::B]), DlStatus(0x5A37));
        assert_eq!(
            DlStatus(0x5A37).to_string(),
            "A carrier, open; B carrier, open; C no carrier, closed; D no carrier, closed"
        );
    }

    /// The rows of S2 table 2, typical modes: high byte, then D, C, B, A in use or not.
    // proves: ESC-14 partial
    #[test]
    fn the_high_byte_decodes_as_in_the_data_sheet() {
        let table = [
            (0x55, [false, false, false, false]),
            (0x56, [false, false, false, true]),
            (0x59, [false, false, true, false]),
            (0x5A, [false, false, true, true]),
            (0x65, [false, true, false, false]),
            (0x66, [false, true, false, true]),
            (0x69, [false, true, true, false]),
            (0x6A, [false, true, true, true]),
            (0x95, [true, false, false, false]),
            (0x96, [true, false, false, true]),
            (0x99, [true, false, true, false]),
            (0x9A, [true, false, true, true]),
            (0xA5, [true, true, false, false]),
            (0xA6, [true, true, false, true]),
            (0xA9, [true, true, true, false]),
            (0xAA, [true, true, true, true]),
        ];
        for (high, used) in table {
            let status = DlStatus(u16::from_be_bytes([high, 0]));
            for (port, used) in [Port::D, Port::C, Port::B, Port::A].into_iter().zip(used) {
                assert_eq!(status.port_state(port).is_active(), used, "0x{high:02X}, port {port}");
                assert_eq!(status.port_state(port).closed, !used, "0x{high:02X}, port {port}");
            }
        }
    }

    #[test]
    fn a_loop_closed_by_hand_is_no_neighbour() {
        let status = DlStatus(0xD600);
        let port = status.port_state(Port::D);
        assert!(port.communication && port.closed && !port.is_active());
        assert_eq!(status.active_ports().collect::<Vec<_>>(), [Port::A]);
    }

    #[test]
    fn carrier_without_communication_is_told_apart() {
        let bad = PortState { link: true, closed: true, communication: false };
        let status = status(&[Port::A]).with_port(Port::B, bad);
        assert!(status.port_state(Port::B).is_link_without_communication());
        assert!(!status.port_state(Port::A).is_link_without_communication());
        assert!(!status.port_state(Port::C).is_link_without_communication());
        assert_eq!(status.port_state(Port::B).to_string(), "carrier, no communication, closed");
    }

    #[test]
    fn the_high_byte_alone_says_nothing_of_carriers() {
        assert_eq!(
            view(1, &[0x5A]).unwrap(),
            "A communication, open; B communication, open; \
             C no communication, closed; D no communication, closed"
        );
        assert_eq!(view(0, &[0x37]), None);
    }

    #[test]
    fn every_word_is_rebuilt_from_its_parts() {
        for value in 0..=u16::MAX {
            let status = DlStatus(value);
            let rebuilt = Port::ALL.into_iter().fold(
                DlStatus::default()
                    .with_pdi(status.pdi_operational(), status.pdi_watchdog_ok())
                    .with_enhanced_link_detection(status.enhanced_link_detection()),
                |rebuilt, port| rebuilt.with_port(port, status.port_state(port)),
            );
            // Bit 3 is reserved.
            assert_eq!(rebuilt.value(), value & !0x0008);
            assert_eq!(DlStatus::from_bytes(status.to_bytes()), status);
        }
    }
}
