//! How a type is described: data from which hardware, SII image and firmware are made.

use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::coe::DataType;
use linesman_proto::port::PortMap;
use linesman_proto::register::SmControl;
use linesman_proto::sii::{CoeDetails, MailboxArea, MailboxPair};

use super::chip::Chip;
use crate::device::application::analog::Range;
use crate::device::processor::ResponseTimes;
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
    /// SII, category General: what its CoE can do; 0 for a device without.
    pub(super) coe: CoeDetails,
    /// What is behind the controller.
    pub(super) behind: Behind,
    /// Operation modes with distributed clocks, for those that have them.
    pub(super) op_modes: &'static [OpModeSpec],
}

/// CoE with SDO, SDO information and PDO assignment.
pub(super) const COE: CoeDetails = CoeDetails(0x07);
/// The same with complete access.
pub(super) const COE_WITH_COMPLETE_ACCESS: CoeDetails = CoeDetails(0x27);
/// No CoE.
pub(super) const NO_COE: CoeDetails = CoeDetails(0x00);

/// What is behind a controller.
#[derive(Clone, Copy, Debug)]
pub(super) enum Behind {
    /// Nothing, or channels that the controller drives itself.
    Plain,
    /// A coding switch that can be read at this address.
    CodingSwitch(RegisterAddress),
    /// A processor.
    Processor(&'static ProcessorSpec),
}

/// A processor.
#[derive(Debug)]
pub(super) struct ProcessorSpec {
    /// What its process data do.
    pub(super) function: Function,
    /// Version of its hardware, object 0x1009.
    pub(super) hardware_version: &'static str,
    /// Version of its software, object 0x100A.
    pub(super) software_version: &'static str,
    /// Objects with settings.
    pub(super) settings: &'static [SettingsSpec],
    /// How quick it is.
    pub(super) times: ResponseTimes,
}

/// What process data do.
#[derive(Clone, Copy, Debug)]
pub(super) enum Function {
    /// There are none.
    None,
    /// Digital outputs 0x70n0:01.
    DigitalOutputs {
        /// How many.
        channels: u8,
    },
    /// Analogue inputs 0x60n0.
    AnalogInputs {
        /// How many.
        channels: u8,
        /// What they measure.
        range: Range,
    },
    /// Analogue outputs 0x70n0.
    AnalogOutputs {
        /// How many.
        channels: u8,
        /// Subindex of the value.
        subindex: u8,
        /// What they give.
        range: Range,
    },
    /// One axis.
    Stepper,
}

impl Function {
    /// Signals driven and taken.
    const fn signals(self) -> (usize, usize) {
        match self {
            Self::None => (0, 0),
            Self::DigitalOutputs { channels } | Self::AnalogOutputs { channels, .. } => {
                (channels as usize, 0)
            }
            Self::AnalogInputs { channels, .. } => (0, channels as usize),
            Self::Stepper => (1, 2),
        }
    }
}

/// A run of objects with settings that differ in their channel only.
#[derive(Debug)]
pub(super) struct SettingsSpec {
    /// Index of the first; 0x10 more for each further one.
    pub(super) index: u16,
    /// How many.
    pub(super) channels: u8,
    /// Its name; the number of the channel is put behind when there are several.
    pub(super) name: &'static str,
    /// What is in it.
    pub(super) entries: &'static [SettingSpec],
}

/// A setting.
#[derive(Debug)]
pub(super) struct SettingSpec {
    /// Its subindex.
    pub(super) subindex: u8,
    /// Its name.
    pub(super) name: &'static str,
    /// Its type.
    pub(super) data_type: DataType,
    /// Its bits.
    pub(super) bits: u8,
    /// Its value after power-on.
    pub(super) default: u32,
    /// The greatest value that is taken.
    pub(super) maximum: Option<u32>,
}

/// An operation mode with (or, for `assign_activate` 0, without) distributed clocks.
#[derive(Debug)]
pub(super) struct OpModeSpec {
    /// Its name.
    pub(super) name: &'static str,
    /// What is written to 0x0980.
    pub(super) assign_activate: u16,
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
    /// Mailbox messages from the MainDevice.
    MailboxOut,
    /// Mailbox messages to the MainDevice.
    MailboxIn,
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
    /// The SyncManager it belongs to by default; `None` when it is not assigned.
    pub(super) sync_manager: Option<u8>,
    /// What is in it.
    pub(super) entries: &'static [EntrySpec],
}

impl PdoSpec {
    /// Whether it carries outputs.
    pub(super) const fn is_output(&self) -> bool {
        self.index < 0x1A00
    }

    /// The index of the PDO of a channel.
    pub(super) const fn index_of(&self, channel: u8) -> u16 {
        self.index + self.step * channel as u16
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

impl EntrySpec {
    /// The index of its object for a channel; 0 for padding.
    pub(super) const fn index_of(&self, channel: u8) -> u16 {
        if self.index == 0 { 0 } else { self.index + 0x10 * channel as u16 }
    }
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
        match self.behind {
            Behind::Processor(processor) => processor.function.signals().0,
            Behind::Plain | Behind::CodingSwitch(_) => self.channels(true),
        }
    }

    /// How many signals it takes.
    pub(super) fn input_channels(&self) -> usize {
        match self.behind {
            Behind::Processor(processor) => processor.function.signals().1,
            Behind::Plain | Behind::CodingSwitch(_) => self.channels(false),
        }
    }

    fn channels(&self, outputs: bool) -> usize {
        let mine = self.pdos.iter().filter(|pdo| pdo.is_output() == outputs);
        mine.map(|pdo| usize::from(pdo.channels)).sum()
    }

    /// Where its coding switch can be read.
    pub(super) const fn coding_switch(&self) -> Option<RegisterAddress> {
        match self.behind {
            Behind::CodingSwitch(at) => Some(at),
            Behind::Plain | Behind::Processor(_) => None,
        }
    }

    /// The SyncManager for this use.
    pub(super) fn sync_manager(&self, kind: Use) -> Option<&'static SyncManagerSpec> {
        self.sync_managers.iter().find(|manager| manager.kind == kind)
    }

    /// Its mailbox; both sizes 0 for a device without.
    pub(super) fn mailbox(&self) -> MailboxPair {
        let area = |kind| {
            self.sync_manager(kind).map_or(MailboxArea::default(), |manager| MailboxArea {
                offset: RegisterAddress(manager.start),
                size: manager.length,
            })
        };
        MailboxPair { receive: area(Use::MailboxOut), send: area(Use::MailboxIn) }
    }

    /// Where the outputs are that the controller switches itself.
    pub(super) fn switching_outputs(&self) -> Option<Switching> {
        self.switching(Use::Outputs)
    }

    /// Where the inputs are that the controller takes itself.
    pub(super) fn switching_inputs(&self) -> Option<Switching> {
        self.switching(Use::Inputs).filter(|_| self.coding_switch().is_none())
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
