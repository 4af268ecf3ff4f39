//! Choice of each device's controller: the one that answers as the recording shows.
//!
//! The recording rarely tells the type of a controller, but always how many answered an access to a
//! register. Of the controllers there are, the ones are taken with which these numbers come out, or
//! come nearest. Devices of one product have the same.

use std::collections::BTreeMap;

use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::register::{self as r, DlStatus, EscInformation};
use linesman_proto::sii::word;
use linesman_proto::time::Instant;
use linesman_proto::topology::Tree;
use linesman_sim::controller::{Controller, LocalClock};
use linesman_sim::device::{NoFirmware, Signals, library};
use linesman_sim::hardware::Hardware;

use super::image::{self, Choice};
use super::ports;
use crate::replay::learn::{DeviceSeen, Learned};

/// A way to make a device.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// Its controller.
    pub(super) hardware: Hardware,
    /// Its EEPROM.
    pub(super) sii: Vec<u8>,
    /// Bytes that the controller said of itself and that others of its type do not say.
    strange: u64,
    /// Registers 0x0000 to 0x0009.
    identity: [u8; EscInformation::LEN],
}

/// SII byte 0: a processor behind a serial interface.
const PROCESSOR: u8 = 0x05;
/// SII byte 0: nothing.
const NO_INTERFACE: u8 = 0x00;
/// SII byte 0: digital inputs and outputs.
const DIGITAL: u8 = 0x04;
/// SII byte 1: the controller answers requests for a state itself.
const EMULATION: u8 = 0x01;
/// SII byte 1: SYNC and latch units are on.
const CLOCK_UNITS: u8 = 0x0C;

/// How much more an answer of one device alone counts than one of all together.
const CERTAIN: u64 = 1_000;

/// The best candidate for each device.
pub(super) fn choose(learned: &Learned, images: &[Vec<u8>], tree: &Tree) -> Vec<Candidate> {
    let devices = &learned.devices;
    let candidates: Vec<Vec<Candidate>> = devices
        .iter()
        .enumerate()
        .map(|(node, seen)| candidates(seen, images, tree, node))
        .collect();
    // Whether a candidate answers each of the accesses.
    let answers: Vec<Vec<Vec<bool>>> = candidates
        .iter()
        .map(|list| list.iter().map(|one| answers(one, learned)).collect())
        .collect();
    let groups = groups(devices, &candidates);
    let mut taken = vec![0; devices.len()];
    let mut best = misfits(learned, &candidates, &answers, &taken);
    loop {
        let before = best;
        for group in &groups {
            let current = taken[group[0]];
            let mut winner = current;
            for other in 0..candidates[group[0]].len() {
                group.iter().for_each(|device| taken[*device] = other);
                let misfits = misfits(learned, &candidates, &answers, &taken);
                if misfits < best {
                    (best, winner) = (misfits, other);
                }
            }
            group.iter().for_each(|device| taken[*device] = winner);
        }
        if best == before {
            break;
        }
    }
    candidates.into_iter().zip(taken).map(|(mut list, taken)| list.swap_remove(taken)).collect()
}

/// Devices that are the same product with the same number of candidates, together.
fn groups(devices: &[DeviceSeen], candidates: &[Vec<Candidate>]) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<(Option<u32>, usize, usize), Vec<usize>> = BTreeMap::new();
    for (node, seen) in devices.iter().enumerate() {
        let product = seen.sii_u32(word::PRODUCT_CODE.value());
        // Of one whose product is not known nothing follows for others.
        let alone = if product.is_none() { node } else { usize::MAX };
        groups.entry((product, candidates[node].len(), alone)).or_default().push(node);
    }
    groups.into_values().collect()
}

fn candidates(seen: &DeviceSeen, images: &[Vec<u8>], tree: &Tree, node: usize) -> Vec<Candidate> {
    let identity = image::identity(seen);
    let built_in = library_image(identity);
    let given = images.iter().map(Vec::as_slice).find(|image| image::is_of(image, identity));
    let same = given.or(built_in.as_deref());
    let has_processor = seen.objects.speaks
        || seen.acknowledges
        || seen
            .sii
            .get(&word::MAILBOX_PROTOCOLS.value())
            .is_some_and(|word| *word != 0 && *word != 0xFFFF);
    // Without an interface there is nobody to trigger its watchdog.
    let is_watched =
        seen.word(r::DL_STATUS.address).map(DlStatus).is_none_or(|status| status.pdi_watchdog_ok());
    let guesses = [CLOCK_UNITS, 0].map(|clock| Choice {
        pdi_control: match (has_processor, is_watched) {
            (true, _) => PROCESSOR,
            (false, true) => DIGITAL,
            (false, false) => NO_INTERFACE,
        },
        esc_configuration: clock | if has_processor { 0 } else { EMULATION },
    });
    let as_same =
        same.and_then(|image| image.first_chunk::<2>()).map(|[pdi_control, configuration]| {
            Choice { pdi_control: *pdi_control, esc_configuration: *configuration }
        });
    let choices: Vec<Choice> = as_same.into_iter().chain(guesses).collect();
    let mut list: Vec<Candidate> = Vec::new();
    for choice in choices {
        let sii = image::compose(seen, same, choice);
        let ports = ports(seen, &sii, tree, node);
        let said_type = seen.byte(r::ESC_TYPE.address);
        let mut controllers = library::controllers(ports);
        if let Some(said) = said_type
            && controllers.iter().any(|hardware| hardware.controller_type == said)
        {
            controllers.retain(|hardware| hardware.controller_type == said);
        }
        for mut hardware in controllers {
            let usual = identity_of(&hardware);
            correct(&mut hardware, seen);
            let strange = (0u16..).zip(usual).filter(|(at, byte)| {
                // Ports differ from device to device.
                *at != r::PORT_DESCRIPTOR.address.0
                    && seen.byte(RegisterAddress(*at)).is_some_and(|said| said != *byte)
            });
            let strange = strange.count() as u64;
            let identity = identity_of(&hardware);
            let known = list.iter().any(|one| one.hardware == hardware && one.sii == sii);
            if !known {
                list.push(Candidate { hardware, sii: sii.clone(), strange, identity });
            }
        }
    }
    list
}

/// What the controller said of itself counts.
fn correct(hardware: &mut Hardware, seen: &DeviceSeen) {
    let take = |register: &r::Register, slot: &mut u8| {
        if let Some(byte) = seen.byte(register.address) {
            *slot = byte;
        }
    };
    take(&r::ESC_TYPE, &mut hardware.controller_type);
    take(&r::ESC_REVISION, &mut hardware.revision);
    take(&r::FMMU_COUNT, &mut hardware.fmmus);
    take(&r::SYNC_MANAGER_COUNT, &mut hardware.sync_managers);
    take(&r::RAM_SIZE, &mut hardware.ram_kib);
    hardware.fmmus = hardware.fmmus.min(16);
    hardware.sync_managers = hardware.sync_managers.min(16);
    hardware.ram_kib = hardware.ram_kib.clamp(1, 60);
    if let Some(build) = seen.word(r::ESC_BUILD.address) {
        hardware.build = build;
    }
    if let Some(features) = seen.word(r::ESC_FEATURES.address) {
        hardware.features = features;
    }
}

/// The image of a library type of the same product and revision.
fn library_image(identity: [Option<u32>; 3]) -> Option<Vec<u8>> {
    identity[1]?;
    library::types().find_map(|kind| {
        let mut signals = Signals::default();
        let built = library::build(kind.name(), 0, &mut signals).ok()?;
        built.into_iter().map(|one| one.sii).find(|sii| image::is_of(sii, identity))
    })
}

/// Registers 0x0000 to 0x0009 of a controller, but for its ports.
fn identity_of(hardware: &Hardware) -> [u8; EscInformation::LEN] {
    EscInformation {
        controller: r::ControllerType(hardware.controller_type),
        revision: hardware.revision,
        build: hardware.build,
        fmmus: hardware.fmmus,
        sync_managers: hardware.sync_managers,
        ram_kb: hardware.ram_kib,
        ports: r::PortDescriptor::default(),
        features: r::Features(hardware.features),
    }
    .to_bytes()
}

fn answers(candidate: &Candidate, learned: &Learned) -> Vec<bool> {
    let mut signals = Signals::default();
    let mut controller = Controller::new(
        DeviceId(0),
        candidate.hardware.clone(),
        LocalClock::default(),
        Box::new(NoFirmware),
        candidate.sii.clone(),
    );
    controller.power_on_before(Instant::ZERO, &mut signals);
    let presence = learned.presence.iter();
    presence.map(|one| controller.has_register(one.address, one.len, one.writes)).collect()
}

/// How many accesses would be answered by another number than they were.
fn misfits(
    learned: &Learned,
    candidates: &[Vec<Candidate>],
    answers: &[Vec<Vec<bool>>],
    taken: &[usize],
) -> u64 {
    let does = |device: usize, access: usize| answers[device][taken[device]][access];
    let chosen = || taken.iter().zip(candidates).map(|(taken, list)| &list[*taken]);
    let mut misfits: u64 = chosen().map(|one| one.strange).sum();
    for (start, data, answered) in &learned.identities {
        if usize::from(*answered) != taken.len() {
            continue;
        }
        for (at, byte) in (usize::from(start.0)..).zip(data) {
            let all = chosen().fold(0, |all, one| all | one.identity[at]);
            misfits += 4 * u64::from((all ^ byte).count_ones());
        }
    }
    for (access, presence) in learned.presence.iter().enumerate() {
        let expected = match presence.device {
            Some(device) => u16::from(does(device, access)),
            None => (0..taken.len()).filter(|device| does(*device, access)).count() as u16,
        };
        // What one device said alone is certain; of what all said it is not known who.
        let weight = if presence.device.is_some() { CERTAIN } else { 1 };
        misfits += weight * u64::from(expected.abs_diff(presence.answered));
    }
    misfits
}
