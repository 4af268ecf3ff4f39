//! How a type is described: data from which hardware, SII image and firmware are made.

use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::coe::DataType;
use linesman_proto::port::PortMap;
use linesman_proto::register::SmControl;

use super::chip::Chip;
use crate::hardware::{Hardware, PortKind};

/// One controller of a type.
#[derive(Debug)]
pub(super) struct Spec {
    /// Order designation.
    pub(super) name: &'static str,
    /// Name in full.
    pub(super) title: &'static str,
    /// The group it is sold under.
    pub(super) group: &'static str,
    /// Product code.
    pub(super) product: u32,
    /// Variant in the low word, revision in the high word.
    pub(super) revision: u32,
    /// Its controller.
    pub(super) chip: &'static Chip,
    /// What its ports are.
    pub(super) ports: [PortKind; 4],
    /// Current from the E-bus in mA.
    pub(super) ebus_current_ma: i16,
    /// SII byte 0: what the processor is connected by; 0 for none, 4 for digital I/O.
    pub(super) pdi_control: u8,
    /// SII byte 1: device emulation, clock units.
    pub(super) esc_configuration: u8,
    /// SII word 3.
    pub(super) pdi_configuration_2: u16,
    /// SyncManagers, in order.
    pub(super) sync_managers: &'static [SyncManagerSpec],
    /// Process data.
    pub(super) pdos: &'static [PdoSpec],
    /// Where a coding switch can be read, if it has one.
    pub(super) identification_switch: Option<RegisterAddress>,
}

/// A SyncManager as the SII describes it.
#[derive(Debug)]
pub(super) struct SyncManagerSpec {
    /// First byte.
    pub(super) start: u16,
    /// Default length in bytes.
    pub(super) length: u16,
    /// Control byte.
    pub(super) control: SmControl,
    /// Whether it is to be switched on, and when.
    pub(super) enable: u8,
    /// What it is for.
    pub(super) kind: Use,
}

/// What a SyncManager is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Use {
    /// Process data from the MainDevice.
    Outputs,
    /// Process data to the MainDevice.
    Inputs,
}

/// A run of PDOs that differ in their channel only.
#[derive(Debug)]
pub(super) struct PdoSpec {
    /// Index of the first: 0x1600 and up for outputs, 0x1A00 and up for inputs.
    pub(super) index: u16,
    /// From one channel to the next.
    pub(super) step: u16,
    /// How many.
    pub(super) channels: u8,
    /// Its name; the number of the channel is put behind when there are several.
    pub(super) name: &'static str,
    /// The SyncManager it belongs to by default.
    pub(super) sync_manager: u8,
    /// What is in it.
    pub(super) entries: &'static [EntrySpec],
}

impl PdoSpec {
    /// Whether it carries outputs.
    pub(super) const fn is_output(&self) -> bool {
        self.index < 0x1A00
    }

    /// Bits of all its channels together.
    pub(super) fn bits(&self) -> usize {
        let one: usize = self.entries.iter().map(|entry| usize::from(entry.bits)).sum();
        one * usize::from(self.channels)
    }
}

/// A piece of a PDO.
#[derive(Debug)]
pub(super) struct EntrySpec {
    /// Index of its object for the first channel; 0x10 more for each further one. 0 is padding.
    pub(super) index: u16,
    /// Its subindex.
    pub(super) subindex: u8,
    /// Its name.
    pub(super) name: &'static str,
    /// Its type.
    pub(super) data_type: DataType,
    /// Its bits.
    pub(super) bits: u8,
}

/// Channels that a controller switches without a processor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Switching {
    /// The SyncManager that guards them.
    pub(super) sync_manager: u8,
    /// Where their bits begin.
    pub(super) at: RegisterAddress,
}

impl Spec {
    /// What it is made of.
    pub(super) fn hardware(&self) -> Hardware {
        self.chip.with_ports(PortMap(self.ports))
    }

    /// How many signals it drives.
    pub(super) fn output_channels(&self) -> usize {
        self.channels(true)
    }

    /// How many signals it takes.
    pub(super) fn input_channels(&self) -> usize {
        self.channels(false)
    }

    fn channels(&self, outputs: bool) -> usize {
        let mine = self.pdos.iter().filter(|pdo| pdo.is_output() == outputs);
        mine.map(|pdo| usize::from(pdo.channels)).sum()
    }

    /// Where the outputs are that the controller switches itself.
    pub(super) fn switching_outputs(&self) -> Option<Switching> {
        self.switching(Use::Outputs)
    }

    /// Where the inputs are that the controller takes itself.
    pub(super) fn switching_inputs(&self) -> Option<Switching> {
        self.switching(Use::Inputs).filter(|_| self.identification_switch.is_none())
    }

    fn switching(&self, kind: Use) -> Option<Switching> {
        (0..).zip(self.sync_managers).find(|(_, manager)| manager.kind == kind).map(
            |(sync_manager, manager)| Switching {
                sync_manager,
                at: RegisterAddress(manager.start),
            },
        )
    }
}
