//! Category 30, General: names, mailbox details, E-bus current, ports; 32 bytes.
//!
//! Reference: ETG.2010; ETG.1000.6 §5.4. Every byte is kept, also those without a known meaning.

use super::strings::StringIndex;
use crate::address::RegisterAddress;
use crate::port::{Port, PortMap};

/// What the SubDevice says about itself as a whole.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct General {
    /// Byte 0: the group it is sold under, such as "DigOut".
    pub group: StringIndex,
    /// Byte 1: name of its picture.
    pub image: StringIndex,
    /// Byte 2: order (type) name, such as "EL2004".
    pub order: StringIndex,
    /// Byte 3: its name in full.
    pub name: StringIndex,
    /// Byte 4: physical layer as old tools wrote it; [`General::ports`] counts.
    pub physical_layer: u8,
    /// Byte 5: what its CoE can do.
    pub coe: CoeDetails,
    /// Byte 6: bit 0, FoE is there.
    pub foe: u8,
    /// Byte 7: bit 0, EoE is there.
    pub eoe: u8,
    /// Byte 8: number of SoE channels.
    pub soe_channels: u8,
    /// Byte 9: number of DS402 channels.
    pub ds402_channels: u8,
    /// Byte 10: class of the system manager.
    pub system_manager_class: u8,
    /// Byte 11: switches.
    pub flags: GeneralFlags,
    /// Bytes 12 and 13: current from the E-bus in mA. Positive is consumed, negative is supplied.
    pub ebus_current_ma: i16,
    /// Byte 14: the group once more.
    pub group_again: StringIndex,
    /// Byte 15: reserved.
    pub reserved_15: u8,
    /// Bytes 16 and 17: what each port is, one nibble each, port 0 in the lowest.
    pub ports: PortMap<PortKind>,
    /// Bytes 18 and 19: where the identification value can be read, see
    /// [`General::identification`].
    pub physical_memory_address: RegisterAddress,
    /// Bytes 20..=31: reserved.
    pub reserved_20: [u8; 12],
}

impl General {
    /// Length of the category in bytes.
    pub const LEN: usize = 32;

    /// The category in 32 bytes of an image.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; Self::LEN]) -> Self {
        let ports = u16::from_le_bytes([bytes[16], bytes[17]]);
        let mut reserved_20 = [0; 12];
        reserved_20.copy_from_slice(&bytes[20..]);
        Self {
            group: StringIndex(bytes[0]),
            image: StringIndex(bytes[1]),
            order: StringIndex(bytes[2]),
            name: StringIndex(bytes[3]),
            physical_layer: bytes[4],
            coe: CoeDetails(bytes[5]),
            foe: bytes[6],
            eoe: bytes[7],
            soe_channels: bytes[8],
            ds402_channels: bytes[9],
            system_manager_class: bytes[10],
            flags: GeneralFlags(bytes[11]),
            ebus_current_ma: i16::from_le_bytes([bytes[12], bytes[13]]),
            group_again: StringIndex(bytes[14]),
            reserved_15: bytes[15],
            ports: PortMap::from_fn(|port| PortKind::from_nibble(ports >> (4 * port.index()))),
            physical_memory_address: RegisterAddress(u16::from_le_bytes([bytes[18], bytes[19]])),
            reserved_20,
        }
    }

    /// The 32 bytes of an image.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        bytes[..12].copy_from_slice(&[
            self.group.0,
            self.image.0,
            self.order.0,
            self.name.0,
            self.physical_layer,
            self.coe.0,
            self.foe,
            self.eoe,
            self.soe_channels,
            self.ds402_channels,
            self.system_manager_class,
            self.flags.0,
        ]);
        let ports = Port::ALL
            .into_iter()
            .fold(0, |word, port| word | self.ports[port].nibble() << (4 * port.index()));
        bytes[12..14].copy_from_slice(&self.ebus_current_ma.to_le_bytes());
        bytes[14] = self.group_again.0;
        bytes[15] = self.reserved_15;
        bytes[16..18].copy_from_slice(&ports.to_le_bytes());
        bytes[18..20].copy_from_slice(&self.physical_memory_address.value().to_le_bytes());
        bytes[20..].copy_from_slice(&self.reserved_20);
        bytes
    }

    /// How a MainDevice can ask for the identification value, for hot connect and against swapped
    /// twins.
    #[must_use]
    pub const fn identification(&self) -> Identification {
        if self.flags.identification_by_al_status() {
            Identification::AlStatus
        } else if self.flags.identification_by_memory() {
            Identification::Memory(self.physical_memory_address)
        } else {
            Identification::None
        }
    }
}

/// What a port is made for.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum PortKind {
    /// 0: there is no such port.
    #[default]
    None,
    /// 1: MII, that is Ethernet by copper or fibre.
    Mii,
    /// 3: E-bus, the contact between terminals.
    EBus,
    /// 4: fast hot connect: Ethernet with a quick link-up.
    FastHotConnect,
    /// Another nibble, 2 or 5..=15.
    Other(u8),
}

impl PortKind {
    /// The kind in the lowest four bits.
    #[must_use]
    pub const fn from_nibble(bits: u16) -> Self {
        match bits & 0x000F {
            0 => Self::None,
            1 => Self::Mii,
            3 => Self::EBus,
            4 => Self::FastHotConnect,
            other => Self::Other(other as u8),
        }
    }

    /// The four bits of the image.
    #[must_use]
    pub const fn nibble(self) -> u16 {
        match self {
            Self::None => 0,
            Self::Mii => 1,
            Self::EBus => 3,
            Self::FastHotConnect => 4,
            Self::Other(nibble) => (nibble & 0x0F) as u16,
        }
    }

    /// The name people know.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Mii => "MII",
            Self::EBus => "E-bus",
            Self::FastHotConnect => "fast hot connect",
            Self::Other(_) => "unknown",
        }
    }
}

/// What the CoE of a SubDevice can do, byte 5.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct CoeDetails(pub u8);

impl CoeDetails {
    /// Bit 0: SDO transfer.
    #[must_use]
    pub const fn sdo(self) -> bool {
        self.0 & 0x01 != 0
    }

    /// Bit 1: SDO information, the object dictionary can be asked for.
    #[must_use]
    pub const fn sdo_information(self) -> bool {
        self.0 & 0x02 != 0
    }

    /// Bit 2: PDOs can be assigned to SyncManagers (0x1C1x).
    #[must_use]
    pub const fn pdo_assign(self) -> bool {
        self.0 & 0x04 != 0
    }

    /// Bit 3: PDOs can be given other entries (0x16xx, 0x1Axx).
    #[must_use]
    pub const fn pdo_configuration(self) -> bool {
        self.0 & 0x08 != 0
    }

    /// Bit 4: the MainDevice is to read the PDOs from the dictionary at start-up.
    #[must_use]
    pub const fn upload_at_startup(self) -> bool {
        self.0 & 0x10 != 0
    }

    /// Bit 5: complete access.
    #[must_use]
    pub const fn complete_access(self) -> bool {
        self.0 & 0x20 != 0
    }
}

/// Switches of byte 11.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct GeneralFlags(pub u8);

impl GeneralFlags {
    /// Bit 0: SAFE-OP is supported before the configuration is taken over.
    #[must_use]
    pub const fn enable_safe_op(self) -> bool {
        self.0 & 0x01 != 0
    }

    /// Bit 1: LRW must not be used; LRD and LWR instead.
    #[must_use]
    pub const fn no_lrw(self) -> bool {
        self.0 & 0x02 != 0
    }

    /// Bit 2: the mailbox has a data link layer that repeats lost messages.
    #[must_use]
    pub const fn mailbox_data_link_layer(self) -> bool {
        self.0 & 0x04 != 0
    }

    /// Bit 3: the identification value can be asked for through AL control bit 5.
    #[must_use]
    pub const fn identification_by_al_status(self) -> bool {
        self.0 & 0x08 != 0
    }

    /// Bit 4: the identification value stands in the controller's memory.
    #[must_use]
    pub const fn identification_by_memory(self) -> bool {
        self.0 & 0x10 != 0
    }
}

/// How the identification value of a SubDevice can be read.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Identification {
    /// Not at all; only the station alias is left.
    #[default]
    None,
    /// Request by AL control bit 5, answer in register 0x0134.
    AlStatus,
    /// A word at this address of the controller's memory.
    Memory(RegisterAddress),
}

#[cfg(test)]
mod tests {
    use super::*;

    /// General of an EK1100, revision 18.
    const EK1100: [u8; 32] = [
        0x02, 0x00, 0x01, 0x04, 0x02, 0, 0, 0, 0, 0, 0, 0, 0x30, 0xF8, 0x03, 0x00, 0x31, 0x01, 0,
        0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    ];

    #[test]
    fn a_coupler_supplies_two_amperes_and_has_e_bus_on_port_b() {
        let general = General::from_bytes(&EK1100);
        assert_eq!(general.ebus_current_ma, -2000);
        assert_eq!(
            general.ports,
            PortMap([PortKind::Mii, PortKind::EBus, PortKind::Mii, PortKind::None])
        );
        assert_eq!((general.order, general.name), (StringIndex(1), StringIndex(4)));
        assert_eq!(general.identification(), Identification::None);
    }

    #[test]
    fn every_byte_goes_back_as_it_came() {
        assert_eq!(General::from_bytes(&EK1100).to_bytes(), EK1100);
        for seed in 0..=u8::MAX {
            let bytes = std::array::from_fn(|at| seed.wrapping_mul(31).wrapping_add(at as u8 * 7));
            assert_eq!(General::from_bytes(&bytes).to_bytes(), bytes);
        }
    }

    #[test]
    fn identification_prefers_the_al_status() {
        let with = |flags, address| {
            let physical_memory_address = RegisterAddress(address);
            General { flags: GeneralFlags(flags), physical_memory_address, ..General::default() }
                .identification()
        };
        assert_eq!(with(0x08, 0x0F18), Identification::AlStatus);
        assert_eq!(with(0x18, 0x0F18), Identification::AlStatus);
        assert_eq!(with(0x10, 0x0F18), Identification::Memory(RegisterAddress(0x0F18)));
        assert_eq!(with(0x03, 0x0F18), Identification::None);
    }
}
