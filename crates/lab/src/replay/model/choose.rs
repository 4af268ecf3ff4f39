//! Which controller each device has: the one that answers as the recording shows.
//!
//! The recording rarely tells the type of a controller, but always how many answered an access to a
//! register. Of the controllers there are, the ones are taken with which these numbers come out, or
//! come nearest. Devices of one product have the same.

use std::collections::BTreeMap;

use linesman_proto::address::DeviceId;
use linesman_proto::register as r;
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
}

/// SII byte 0: a processor behind a serial interface.
const PROCESSOR: u8 = 0x05;
/// SII byte 0: digital inputs and outputs.
const DIGITAL: u8 = 0x04;
/// SII byte 1: the controller answers requests for a state itself.
const EMULATION: u8 = 0x01;
/// SII byte 1: SYNC and latch units are on.
const CLOCK_UNITS: u8 = 0x0C;

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
    let mut best = misfits(learned, &answers, &taken);
    loop {
        let before = best;
        for group in &groups {
            let current = taken[group[0]];
            let mut winner = current;
            for other in 0..candidates[group[0]].len() {
                group.iter().for_each(|device| taken[*device] = other);
                let misfits = misfits(learned, &answers, &taken);
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
        || seen
            .sii
            .get(&word::MAILBOX_PROTOCOLS.value())
            .is_some_and(|word| *word != 0 && *word != 0xFFFF);
    let choices: Vec<Choice> = [CLOCK_UNITS, 0]
        .map(|clock| Choice {
            pdi_control: if has_processor { PROCESSOR } else { DIGITAL },
            esc_configuration: clock | if has_processor { 0 } else { EMULATION },
        })
        .into();
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
            correct(&mut hardware, seen);
            let known = list.iter().any(|one| one.hardware == hardware && one.sii == sii);
            if !known {
                list.push(Candidate { hardware, sii: sii.clone() });
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
fn misfits(learned: &Learned, answers: &[Vec<Vec<bool>>], taken: &[usize]) -> u64 {
    let does = |device: usize, access: usize| answers[device][taken[device]][access];
    let mut misfits = 0;
    for (access, presence) in learned.presence.iter().enumerate() {
        let expected = match presence.device {
            Some(device) => u16::from(does(device, access)),
            None => (0..taken.len()).filter(|device| does(*device, access)).count() as u16,
        };
        misfits += u64::from(expected.abs_diff(presence.answered));
    }
    misfits
}
