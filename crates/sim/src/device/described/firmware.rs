//! Firmware behind the controller of a described device.

use linesman_proto::address::RegisterAddress;
use linesman_proto::sii::{
    Direction, General, Identification, Identity, Protocols, SyncManagerKind,
};

use super::DescribedType;
use super::channel::{Driven, Taken};
use super::objects;
use super::signals::{Layout, Point};
use crate::device::application::Channel;
use crate::device::application::drive::Cia402;
use crate::device::application::oversampling::{Oversampling, SampleBuffer, Sampled};
use crate::device::emulated::{DigitalArea, Emulated, WordArea};
use crate::device::ethernet::EthernetFunction;
use crate::device::files::{Files, FirmwareSlot};
use crate::device::firmware::{Firmware, NoFirmware};
use crate::device::processor::{BusAccess, Description, ProcessBuffer, Processor, ResponseTimes};
use crate::device::signal::SignalId;

/// SII byte 0: nothing is connected to the controller.
const NO_PDI: u8 = 0x00;
/// SII byte 0: digital inputs and outputs.
const DIGITAL_IO: u8 = 0x04;

/// The longest firmware file that a described device takes, in bytes: no description says it.
const FIRMWARE_LIMIT: usize = 1_024 * 1_024;

/// What sort of firmware it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Kind {
    /// The controller answers requests for a state itself (register 0x0141, bit 0).
    Emulated,
    /// A processor does.
    Processor,
    /// Nobody does: neither device emulation nor an interface for a processor.
    Nothing,
}

pub(super) fn kind(described: &DescribedType) -> Kind {
    let configuration = &described.image.configuration;
    if configuration.device_emulation() {
        Kind::Emulated
    } else if matches!(configuration.pdi_control, NO_PDI | DIGITAL_IO) {
        Kind::Nothing
    } else {
        Kind::Processor
    }
}

pub(super) fn build(
    described: &DescribedType,
    identity: Identity,
    layout: &Layout,
    outputs: &[SignalId],
    inputs: &[SignalId],
) -> Box<dyn Firmware> {
    match kind(described) {
        Kind::Nothing => Box::new(NoFirmware),
        Kind::Emulated if layout.points.iter().any(|point| point.stride.is_some()) => {
            Box::new(sampling(described, layout, outputs, inputs))
        }
        Kind::Emulated => Box::new(emulated(described, layout, outputs, inputs)),
        Kind::Processor => Box::new(processor(described, identity, layout, outputs, inputs)),
    }
}

/// SyncManagers for process data, in order.
pub(super) fn buffers(described: &DescribedType) -> Vec<ProcessBuffer> {
    let records = (0u8..).zip(described.image.sync_managers());
    let buffers = records.filter_map(|(sync_manager, record)| {
        let direction = match record.kind {
            SyncManagerKind::Outputs => Direction::Outputs,
            SyncManagerKind::Inputs => Direction::Inputs,
            SyncManagerKind::Unused
            | SyncManagerKind::MailboxOut
            | SyncManagerKind::MailboxIn
            | SyncManagerKind::Other(_) => return None,
        };
        (!record.enable.is_virtual()).then_some(ProcessBuffer { sync_manager, direction })
    });
    buffers.collect()
}

fn processor(
    described: &DescribedType,
    identity: Identity,
    layout: &Layout,
    outputs: &[SignalId],
    inputs: &[SignalId],
) -> Processor {
    let dictionary = objects::dictionary(described, identity);
    let (mut driven, mut taken) = (Driven::default(), Taken::default());
    for point in &layout.points {
        let range = point.first..point.first + point.count;
        match point.direction {
            Direction::Outputs => {
                let signals = outputs.get(range).unwrap_or(&[]);
                driven.push(&dictionary, point.address, point.bits, signals);
            }
            Direction::Inputs => {
                let signals = inputs.get(range).unwrap_or(&[]);
                taken.push(&dictionary, point.address, point.bits, signals);
            }
        }
    }
    let mut channels: Vec<Box<dyn Channel>> = vec![Box::new(driven)];
    if let Some((first_output, first_input)) = layout.axis
        && let Some(position) = outputs.get(first_output)
        && let Some(switches) = inputs.get(first_input..).and_then(|mine| mine.first_chunk())
    {
        channels.push(Box::new(Cia402::new(&dictionary, *position, *switches)));
    }
    // Last, so that what is driven from outside counts.
    channels.push(Box::new(taken));
    let bootstrap = described.image.bootstrap_mailbox;
    let files = if described.image.protocols.has(Protocols::FOE) {
        let slot =
            FirmwareSlot { type_name: described.name.clone(), limit: FIRMWARE_LIMIT, password: 0 };
        Files::new(Vec::new(), Some(slot))
    } else {
        Files::default()
    };
    let processor = Processor::new(Description {
        dictionary,
        channels,
        buffers: buffers(described),
        excludes: excludes(described),
        mailbox: described.image.standard_mailbox,
        protocols: described.image.protocols,
        bootstrap: bootstrap.is_present().then_some(bootstrap),
        times: if layout.axis.is_some() { ResponseTimes::DRIVE } else { ResponseTimes::TERMINAL },
        bus: BusAccess::of(described.image.sync_managers().iter().map(|one| one.start)),
        ethernet: EthernetFunction::IpApplication,
        unit_alone: described.image.op_modes().any(|mode| mode.assign_activate & 0x0700 == 0x0100),
    });
    processor.with_files(files)
}

/// PDOs that exclude each other. What the description assigns by default is left alone: some exclude
/// what they assign.
fn excludes(described: &DescribedType) -> Vec<(u16, u16)> {
    let assigned = |index: u16| {
        described.pdos.iter().any(|pdo| pdo.index == index && pdo.sync_manager.is_some())
    };
    let pairs = described
        .pdos
        .iter()
        .flat_map(|pdo| pdo.excludes.iter().map(move |other| (pdo.index, *other)));
    pairs.filter(|(one, other)| !(assigned(*one) && assigned(*other))).collect()
}

/// Outputs and inputs with several samples in each cycle. The samples begin where the description
/// has the first; how many there are the length of the SyncManager says.
fn sampling(
    described: &DescribedType,
    layout: &Layout,
    outputs: &[SignalId],
    inputs: &[SignalId],
) -> Oversampling {
    let mut sampled = [Vec::new(), Vec::new()];
    for buffer in buffers(described) {
        let (signals, into) = match buffer.direction {
            Direction::Outputs => (outputs, 0),
            Direction::Inputs => (inputs, 1),
        };
        let mine = layout.points.iter().filter(|point| {
            point.sync_manager == Some(buffer.sync_manager) && point.direction == buffer.direction
        });
        let mut made: Option<SampleBuffer> = None;
        for point in mine {
            let (Some(stride), Some(signal)) = (point.stride, signals.get(point.first)) else {
                continue;
            };
            let made = made.get_or_insert_with(|| SampleBuffer {
                sync_manager: buffer.sync_manager,
                stride,
                first: point.at,
                values: Vec::new(),
            });
            // Samples of a second kind have their place where the length of the first is known only.
            if point.at < made.first + made.stride {
                made.values.push(Sampled { signal: *signal, at: point.at, bits: point.bits });
            }
        }
        sampled[into].extend(made);
    }
    let [outputs, inputs] = sampled;
    Oversampling::new(outputs, inputs)
}

/// Pins that the controller drives and takes itself.
fn emulated(
    described: &DescribedType,
    layout: &Layout,
    outputs: &[SignalId],
    inputs: &[SignalId],
) -> Emulated {
    let mut areas = [Vec::new(), Vec::new()];
    let mut words = Vec::new();
    for buffer in buffers(described) {
        let manager = usize::from(buffer.sync_manager);
        let Some(record) = described.image.sync_managers().get(manager) else { continue };
        let (signals, into) = match buffer.direction {
            Direction::Outputs => (outputs, 0),
            Direction::Inputs => (inputs, 1),
        };
        let points: Vec<&Point> = layout
            .points
            .iter()
            .filter(|point| point.sync_manager == Some(buffer.sync_manager))
            .filter(|point| point.direction == buffer.direction)
            .collect();
        let mut pins = Vec::new();
        for point in points {
            let mine = signals.get(point.first..point.first + point.count).unwrap_or(&[]);
            if point.count < point.bits && point.at.is_multiple_of(8) {
                let at = RegisterAddress(record.start.0.saturating_add((point.at / 8) as u16));
                words.extend(mine.iter().map(|signal| WordArea {
                    sync_manager: buffer.sync_manager,
                    at,
                    signal: *signal,
                }));
                continue;
            }
            pins.resize((point.at + point.bits).max(pins.len()), SignalId::NOWHERE);
            for (pin, signal) in pins.iter_mut().skip(point.at).zip(mine) {
                *pin = *signal;
            }
        }
        if !pins.is_empty() {
            areas[into].push(DigitalArea {
                sync_manager: buffer.sync_manager,
                at: record.start,
                signals: pins,
            });
        }
    }
    let [outputs, inputs] = areas;
    // One of the words may be the switch that tells which of several alike it is.
    let way = described.image.general().map(General::identification);
    let switch = match way {
        Some(Identification::Memory(at)) => words.iter().find(|word| word.at == at),
        Some(Identification::AlStatus | Identification::None) | None => None,
    };
    let switch = switch.map(|word| word.signal);
    let device = Emulated::new(outputs, inputs).with_words(words);
    match switch {
        Some(switch) => device.with_coding_switch(switch),
        None => device,
    }
}
