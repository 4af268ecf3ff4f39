//! Specification of a type: data from which hardware, SII image and firmware are made.

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
    /// Who makes it.
    pub(super) vendor: u32,
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
    /// SII word 2: length of the SYNC pulse in units of 10 ns.
    pub(super) sync_impulse: u16,
    /// SII word 3.
    pub(super) pdi_configuration_2: u16,
    /// SyncManagers, in order.
    pub(super) sync_managers: &'static [SyncManagerSpec],
    /// Process data.
    pub(super) pdos: &'static [PdoSpec],
    /// What its mailbox speaks, as [`Protocols`](linesman_proto::sii::Protocols); 0 for a device without.
    pub(super) protocols: u16,
    /// SII, category General: what its CoE can do; 0 for a device without.
    pub(super) coe: CoeDetails,
    /// What is behind the controller.
    pub(super) application: ApplicationSpec,
    /// Operation modes with distributed clocks, for those that have them.
    pub(super) op_modes: &'static [OpModeSpec],
}

/// CoE with SDO, SDO information and PDO assignment.
pub(super) const COE: CoeDetails = CoeDetails(0x07);
/// The same with complete access.
pub(super) const COE_WITH_COMPLETE_ACCESS: CoeDetails = CoeDetails(0x27);
/// Complete access, and PDO mappings can be changed.
pub(super) const COE_WITH_PDO_CONFIGURATION: CoeDetails = CoeDetails(0x2F);
/// No CoE.
pub(super) const NO_COE: CoeDetails = CoeDetails(0x00);

/// Beckhoff, who makes the products that most types are named after.
pub(super) const BECKHOFF: u32 = 2;
/// Nobody: the generic devices are no products.
pub(super) const NOBODY: u32 = 0xFFFF_FFF0;

/// What is behind a controller.
#[derive(Clone, Copy, Debug)]
pub(super) enum ApplicationSpec {
    /// Nothing, or channels that the controller drives itself.
    Plain,
    /// A coding switch that can be read at this address.
    CodingSwitch(RegisterAddress),
    /// Analogue outputs that play several samples in each cycle, one SyncManager each.
    Oversampling {
        /// How many.
        channels: u8,
    },
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
    /// Objects with one value each, beside those that process data bring.
    pub(super) variables: &'static [VariableSpec],
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
    /// Analogue inputs 0x60n0, and analogue outputs 0x70n0 whose channels are counted on.
    AnalogInputsOutputs {
        /// How many inputs.
        inputs: u8,
        /// How many outputs.
        outputs: u8,
        /// What they measure and give.
        range: Range,
    },
    /// Ethernet ports, and no process data.
    SwitchPorts {
        /// How many.
        ports: u8,
    },
    /// One axis of a stepper motor.
    Stepper,
    /// One axis of a drive of CiA 402.
    Cia402,
    /// One axis of a drive that speaks SoE.
    Sercos,
    /// Time of this network and of another one.
    TwoTimes,
    /// One side of a bridge between two networks: their times, and values that cross over.
    Bridge {
        /// How many of 32 bits each way.
        values: u8,
    },
}

impl Function {
    /// Whether it moves an axis, and has a profile of drives.
    pub(super) const fn is_drive(self) -> bool {
        matches!(self, Self::Cia402 | Self::Sercos)
    }

    /// Signals driven and taken.
    const fn signals(self) -> (usize, usize) {
        match self {
            Self::None | Self::SwitchPorts { .. } => (0, 0),
            Self::DigitalOutputs { channels } | Self::AnalogOutputs { channels, .. } => {
                (channels as usize, 0)
            }
            Self::AnalogInputs { channels, .. } => (0, channels as usize),
            Self::AnalogInputsOutputs { inputs, outputs, .. } => {
                (outputs as usize, inputs as usize)
            }
            Self::Stepper => (1, 2),
            Self::Cia402 => (1, 4),
            Self::Sercos => (1, 1),
            Self::TwoTimes => (0, 1),
            Self::Bridge { values } => (values as usize, values as usize + 1),
        }
    }
}

/// A run of objects with settings that differ in their channel only.
#[derive(Clone, Copy, Debug)]
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
#[derive(Clone, Copy, Debug)]
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

/// An object with one value, subindex 0.
#[derive(Debug)]
pub(super) struct VariableSpec {
    /// Its index.
    pub(super) index: u16,
    /// Its name.
    pub(super) name: &'static str,
    /// Its type.
    pub(super) data_type: DataType,
    /// Its bits.
    pub(super) bits: u8,
    /// Its value after power-on.
    pub(super) default: u32,
    /// What can be done with it.
    pub(super) rights: Rights,
}

/// What can be done with an object of one value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Rights {
    /// It can be read.
    Read,
    /// It can be read, and mapped into inputs.
    Input,
    /// It can be written, and mapped into outputs.
    Output,
    /// It can be written, and is kept.
    Setting,
}

/// An operation mode with (or, for `assign_activate` 0, without) distributed clocks.
#[derive(Debug)]
pub(super) struct OpModeSpec {
    /// Its name.
    pub(super) name: &'static str,
    /// What is written to 0x0980.
    pub(super) assign_activate: u16,
    /// Positive: a SYNC0 every n cycles of the MainDevice. Negative: n times within a cycle. 0: none.
    pub(super) sync0_factor: i16,
}

impl OpModeSpec {
    /// With the frames, or as the device likes.
    pub(super) const fn free(name: &'static str) -> Self {
        Self { name, assign_activate: 0, sync0_factor: 0 }
    }

    /// With a SYNC0 in each cycle of the MainDevice.
    pub(super) const fn with_clock(name: &'static str, assign_activate: u16) -> Self {
        Self { name, assign_activate, sync0_factor: 1 }
    }
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

impl SyncManagerSpec {
    /// There is none: FMMUs read registers there.
    pub(super) const VIRTUAL: u8 = 0x04;

    /// Registers that FMMUs read; no SyncManager of the controller guards them.
    pub(super) const fn registers(start: u16) -> Self {
        Self {
            start,
            length: 0,
            control: SmControl::INPUTS_WITHOUT_EVENT,
            enable: Self::VIRTUAL,
            kind: Use::Inputs,
        }
    }

    /// Whether it stands for registers.
    pub(super) const fn is_virtual(&self) -> bool {
        self.enable & Self::VIRTUAL != 0
    }
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
#[derive(Clone, Copy, Debug)]
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
    /// A PDO on its own.
    pub(super) const fn single(
        index: u16,
        name: &'static str,
        sync_manager: Option<u8>,
        entries: &'static [EntrySpec],
    ) -> Self {
        Self { index, step: 1, channels: 1, name, sync_manager, entries }
    }

    /// Whether it carries outputs. The telegrams of servo drives have numbers of their own: 16 is
    /// what a drive tells, 24 what it is told.
    pub(super) const fn is_output(&self) -> bool {
        match self.index {
            16 => false,
            index => index < 0x1A00,
        }
    }

    /// The index of the PDO of a channel.
    pub(super) const fn index_of(&self, channel: u8) -> u16 {
        self.index + self.step * channel as u16
    }
}

/// A piece of a PDO.
#[derive(Clone, Copy, Debug)]
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
    /// A bit.
    pub(super) const fn bit(index: u16, subindex: u8, name: &'static str) -> Self {
        Self { index, subindex, name, data_type: DataType::BOOL, bits: 1 }
    }

    /// A number.
    pub(super) const fn number(
        index: u16,
        subindex: u8,
        name: &'static str,
        data_type: DataType,
        bits: u8,
    ) -> Self {
        Self { index, subindex, name, data_type, bits }
    }

    /// Bits that mean nothing.
    pub(super) const fn padding(bits: u8) -> Self {
        Self { index: 0, subindex: 0, name: "", data_type: DataType(0), bits }
    }

    /// The index of its object for a channel; 0 for padding.
    pub(super) const fn index_of(&self, channel: u8) -> u16 {
        if self.index == 0 { 0 } else { self.index + 0x10 * channel as u16 }
    }
}

impl Spec {
    /// What it is made of.
    pub(super) fn hardware(&self) -> Hardware {
        self.chip.with_ports(PortMap(self.ports))
    }

    /// How many signals it drives.
    pub(super) fn output_channels(&self) -> usize {
        match self.application {
            ApplicationSpec::Processor(processor) => processor.function.signals().0,
            ApplicationSpec::Oversampling { channels } => usize::from(channels),
            ApplicationSpec::Plain | ApplicationSpec::CodingSwitch(_) => self.channels(true),
        }
    }

    /// How many signals it takes.
    pub(super) fn input_channels(&self) -> usize {
        match self.application {
            ApplicationSpec::Processor(processor) => processor.function.signals().1,
            ApplicationSpec::Oversampling { .. } => 0,
            ApplicationSpec::Plain | ApplicationSpec::CodingSwitch(_) => self.channels(false),
        }
    }

    /// Pieces of process data that a controller without a processor has, padding and registers
    /// aside.
    fn channels(&self, outputs: bool) -> usize {
        let mine = (0..).zip(self.sync_managers).filter(|(_, manager)| !manager.is_virtual());
        mine.flat_map(|(index, _)| self.assigned(index))
            .filter(|pdo| pdo.is_output() == outputs)
            .map(|pdo| {
                let entries = pdo.entries.iter().filter(|entry| entry.index != 0).count();
                entries * usize::from(pdo.channels)
            })
            .sum()
    }

    /// The PDOs that a SyncManager has by default.
    pub(super) fn assigned(&self, sync_manager: u8) -> impl Iterator<Item = &'static PdoSpec> {
        self.pdos.iter().filter(move |pdo| pdo.sync_manager == Some(sync_manager))
    }

    /// Where its coding switch can be read.
    pub(super) const fn coding_switch(&self) -> Option<RegisterAddress> {
        match self.application {
            ApplicationSpec::CodingSwitch(at) => Some(at),
            ApplicationSpec::Plain
            | ApplicationSpec::Processor(_)
            | ApplicationSpec::Oversampling { .. } => None,
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
}
