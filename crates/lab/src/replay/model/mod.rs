//! A segment of the devices that a recording shows.

mod choose;
mod image;

use linesman_proto::address::Path;
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{self as r, DlStatus, PortDescriptor, PortType};
use linesman_proto::sii::{Image, PortKind as SiiPort};
use linesman_proto::topology::derive::{SeenController, derive};
use linesman_proto::topology::{End, Tree, Wired};
use linesman_sim::controller::{Controller, LocalClock};
use linesman_sim::device::{SignalId, Signals};
use linesman_sim::hardware::PortKind;
use linesman_sim::segment::Segment;

use self::choose::{Candidate, choose};
use super::firmware::Learned as LearnedFirmware;
use super::learn::{DeviceSeen, Learned};

/// Input bytes of a device that can come from outside.
const INPUT_BYTES: usize = 512;
/// Length of a cable, in metres.
const CABLE_M: f64 = 1.0;

/// A segment, and what was found out about its devices.
#[derive(Debug)]
pub struct Model {
    /// The segment.
    pub segment: Segment,
    /// For each device what its inputs come from.
    pub inputs: Vec<Inputs>,
    /// What each device was taken for, for people.
    pub devices: Vec<String>,
    /// What had to be assumed, for people.
    pub notes: Vec<String>,
}

/// Where the inputs of a device come from.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Inputs {
    /// A signal for each byte, in the order of SyncManagers.
    Bytes(Vec<SignalId>),
    /// A signal for each bit: digital channels.
    Bits(Vec<SignalId>),
}

/// Why no segment can be made.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ModelError {
    /// No frame of the recording was answered.
    #[error("no device answered in the recording: there is nothing to build a segment from")]
    NoDevices,
    /// The wiring that DL status shows cannot be.
    #[error("the wiring of {count} devices cannot be built: {why}")]
    Wiring {
        /// How many.
        count: usize,
        /// Why.
        why: String,
    },
}

/// Makes a segment of what was learned. `images` are SII images that may belong to the devices: where
/// product and revision agree they fill in words that the recording does not show.
///
/// # Errors
/// [`ModelError`] when there is no device, or no wiring.
pub fn model(learned: &Learned, images: &[Vec<u8>]) -> Result<Model, ModelError> {
    if learned.devices.is_empty() {
        return Err(ModelError::NoDevices);
    }
    let mut notes = learned.notes.clone();
    let tree = tree(learned, &mut notes)?;
    let chosen = choose(learned, images, &tree);
    let mut signals = Signals::default();
    let mut inputs = Vec::new();
    let mut devices = Vec::new();
    let mut controllers = Vec::new();
    for ((seen, candidate), id) in learned.devices.iter().zip(chosen).zip((0..).map(DeviceId)) {
        let mine: Vec<SignalId> = (0..INPUT_BYTES).map(|_| signals.add()).collect();
        let firmware = LearnedFirmware::new(seen, mine.clone());
        devices.push(describe(seen, &candidate));
        inputs.push(Inputs::Bytes(mine));
        let Candidate { hardware, sii, .. } = candidate;
        let mut controller =
            Controller::new(id, hardware, LocalClock::default(), Box::new(firmware), sii);
        controller.expect_sii_times(seen.sii_times.iter().copied());
        controllers.push(controller);
    }
    let cable_m = vec![CABLE_M; tree.links().len()];
    let mut segment = Segment::of_controllers("recording", tree, controllers, &cable_m, signals);
    for (seen, id) in learned.devices.iter().zip((0..).map(DeviceId)) {
        if let Some(controller) = segment.controller_mut(id) {
            preset(controller, seen, PRESET);
            preset_events(controller, learned);
            for (address, byte) in &seen.memory {
                controller.preset(RegisterAddress(*address), &[*byte]);
            }
            if let Some(time) = seen.programming {
                controller.set_sii_programming_time(time);
            }
        }
    }
    Ok(Model { segment, inputs, devices, notes })
}

/// A segment that was made elsewhere, such as from a file, with the history that the recording shows:
/// station addresses, states, counters, and how long the SII took. Digital inputs follow the
/// recording; those of other devices are what the segment makes them.
#[must_use]
pub fn on_segment(mut segment: Segment, learned: &Learned) -> Model {
    let ids: Vec<DeviceId> = segment.devices().collect();
    let mut notes = learned.notes.clone();
    if ids.len() != learned.devices.len() {
        notes.push(format!(
            "the segment has {} controllers, the recording shows {}",
            ids.len(),
            learned.devices.len()
        ));
    }
    for (seen, id) in learned.devices.iter().zip(&ids) {
        if let Some(controller) = segment.controller_mut(*id) {
            controller.expect_sii_times(seen.sii_times.iter().copied());
            preset(controller, seen, HISTORY);
            preset_events(controller, learned);
        }
    }
    let inputs = ids.iter().map(|id| Inputs::Bits(segment.inputs(*id).to_vec())).collect();
    let devices = ids.iter().map(|id| segment.name(*id).to_owned()).collect();
    Model { segment, inputs, devices, notes }
}

/// What the history of a device leaves behind, whatever the device is.
const HISTORY: &[std::ops::Range<u16>] = &[
    0x0010..0x0012,
    0x0100..0x0104,
    0x0120..0x0122,
    0x0130..0x0136,
    0x0300..0x0328,
    0x0442..0x0446,
];

/// Registers whose values at the start matter and are no consequence of others.
const PRESET: &[std::ops::Range<u16>] = &[
    0x0000..0x000A,
    0x0010..0x0014,
    0x0020..0x0032,
    0x0100..0x0104,
    0x0108..0x010A,
    0x0120..0x0122,
    0x0130..0x0132,
    0x0134..0x0136,
    0x0140..0x0154,
    0x0200..0x0208,
    0x0300..0x0328,
    0x0400..0x0446,
    0x0500..0x0503,
    0x0504..0x0510,
    0x0600..0x0700,
    0x0800..0x0880,
    0x0920..0x092C,
    0x0930..0x0932,
    0x0934..0x0936,
    0x0980..0x0984,
    0x09A0..0x09AA,
    0x0E00..0x0F04,
];

/// Events that no datagram carried before they were served did not stand; the mask is that of the
/// first answer, unless it was read.
fn preset_events(controller: &mut Controller, learned: &Learned) {
    let events = &learned.events;
    // Where the last event went with a read, those that were not read until then had none.
    let had = !events.ended || events.owners.contains(&controller.id().index());
    let request = if had { events.request } else { 0 };
    controller.preset(r::ECAT_EVENT_REQUEST.address, &request.to_le_bytes());
    if events.mask != 0 {
        controller.preset(r::ECAT_EVENT_MASK.address, &events.mask.to_le_bytes());
    }
}

fn preset(controller: &mut Controller, seen: &DeviceSeen, ranges: &[std::ops::Range<u16>]) {
    for range in ranges {
        let known = seen.initial.range(range.clone());
        let mut run: Option<(u16, Vec<u8>)> = None;
        for (address, byte) in known {
            match &mut run {
                Some((start, bytes)) if *start + bytes.len() as u16 == *address => {
                    bytes.push(*byte)
                }
                _ => {
                    if let Some((start, bytes)) = run.replace((*address, vec![*byte])) {
                        controller.preset(RegisterAddress(start), &bytes);
                    }
                }
            }
        }
        if let Some((start, bytes)) = run {
            controller.preset(RegisterAddress(start), &bytes);
        }
    }
    // A state that was there before has been asked for.
    let (status, control) = (r::AL_STATUS.address, r::AL_CONTROL.address);
    if let (Some(state), None) = (seen.byte(status), seen.byte(control)) {
        controller.preset(control, &[state & 0x0F, 0]);
    }
}

/// The wiring, by the open ports of DL status; one behind the other where it was not read.
fn tree(learned: &Learned, notes: &mut Vec<String>) -> Result<Tree, ModelError> {
    let count = learned.devices.len();
    let status: Option<Vec<DlStatus>> =
        learned.devices.iter().map(|seen| seen.word(r::DL_STATUS.address).map(DlStatus)).collect();
    if let Some(status) = status {
        let seen: Vec<SeenController> = status
            .iter()
            .map(|status| SeenController::open_at(&status.active_ports().collect::<Vec<_>>()))
            .collect();
        match derive(&seen) {
            Ok(tree) if tree.len() == count => return Ok(tree),
            Ok(_) => {
                notes.push("DL status shows another number of devices: wired as a line".into())
            }
            Err(error) => notes.push(format!("wired as a line, since {error}")),
        }
    } else {
        notes.push(
            "DL status was not read of every device: they are wired one behind the other"
                .to_owned(),
        );
    }
    let wired: Vec<Wired> = (0..count)
        .map(|node| Wired {
            on: match node.checked_sub(1) {
                None => End::MainDevice(Path::A),
                Some(before) => End::Controller(before, Port::B),
            },
            entry: Port::A,
        })
        .collect();
    Tree::from_wiring(&wired, None)
        .map_err(|error| ModelError::Wiring { count, why: error.to_string() })
}

/// What its ports are: by the port descriptor, else by the SII, else by what is plugged in.
fn ports(seen: &DeviceSeen, image: &[u8], tree: &Tree, node: usize) -> PortMap<PortKind> {
    let open: Vec<Port> = tree.open_ports(node).collect();
    let told = match seen.byte(r::PORT_DESCRIPTOR.address) {
        Some(byte) => PortMap::from_fn(|port| match PortDescriptor(byte).port(port) {
            PortType::Ebus => PortKind::Ebus,
            PortType::Mii => PortKind::Mii,
            PortType::NotImplemented | PortType::NotConfigured => PortKind::Absent,
        }),
        None => {
            let image = Image::parse(image).ok();
            let general = image.as_ref().and_then(|image| image.general());
            PortMap::from_fn(|port| match general.map(|general| general.ports[port]) {
                Some(SiiPort::EBus) => PortKind::Ebus,
                Some(SiiPort::Mii | SiiPort::FastHotConnect) => PortKind::Mii,
                Some(SiiPort::None | SiiPort::Other(_)) | None => PortKind::Absent,
            })
        }
    };
    PortMap::from_fn(|port| match told[port] {
        PortKind::Absent if open.contains(&port) || port.index() < 2 => PortKind::Mii,
        kind @ (PortKind::Absent | PortKind::Ebus | PortKind::Mii) => kind,
    })
}

fn describe(seen: &DeviceSeen, candidate: &Candidate) -> String {
    let [vendor, product, revision] = image::identity(seen)
        .map(|value| value.map_or("unknown".to_owned(), |value| format!("0x{value:08X}")));
    let hardware = &candidate.hardware;
    format!(
        "vendor {vendor}, product {product}, revision {revision}; controller type 0x{:02X}, {} FMMUs, \
         {} SyncManagers; {} SII words, {} SII times, {} steps, {} mailbox messages",
        hardware.controller_type,
        hardware.fmmus,
        hardware.sync_managers,
        seen.sii.len(),
        seen.sii_times.len(),
        seen.steps.len(),
        seen.mailbox.len()
    )
}
