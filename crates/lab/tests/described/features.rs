//! Features of descriptions beyond process data: identification, modules, start-up commands,
//! mappings.

use linesman_config::esi::{EsiDevice, EsiModule};
use linesman_config::plan::{Plan, PlanOptions};
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_maindevice::Event;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::register as r;
use linesman_proto::sii::{General, Identification, Image};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::{DescriptionFiles, SegmentFile};

use crate::clock::{self, access};
use crate::data::{Collection, files, root};
use crate::up::{segment, to_op};

const ID: u16 = 300;

fn type_name(file: &str, device: &EsiDevice) -> String {
    format!("esi:{file}#{}@0x{:08X}", device.type_name, device.revision)
}

/// The segment with another key for its last device.
fn with_key(file: &SegmentFile, files: &dyn DescriptionFiles, key: &str) -> SegmentFile {
    let text = format!("{}{key}\n", file.to_toml());
    SegmentFile::parse_with(&text, files).unwrap_or_else(|error| panic!("{text}\n{error}"))
}

/// In PREOP.
fn in_preop(file: &SegmentFile) -> Lab {
    let options = LabOptions { target: AlState::PreOp, ..LabOptions::default() };
    let mut lab = Lab::new(file, options).expect("a lab");
    lab.wait_up(Span::s(10)).expect("in PREOP");
    lab
}

/// Reads the identification in the way that the SII names (ETG.1020).
fn identification(lab: &mut Lab) -> (Identification, u16) {
    let id = lab.segment().devices().last().expect("a device");
    let sii = lab.segment().controller(id).expect("it is there").sii().to_vec();
    let image = Image::parse(&sii).expect("an image");
    let way = image.general().map_or(Identification::None, General::identification);
    let station = lab.plan().expect("a plan").devices.last().expect("a device").station;
    let mut word = |register: u16| {
        let data = access(lab, station, register, 2, None).expect("an answer");
        u16::from_le_bytes([data[0], data[1]])
    };
    let number = match way {
        Identification::Memory(at) => word(at.0),
        Identification::None => word(r::STATION_ALIAS.address.0),
        Identification::AlStatus => {
            let state = word(0x0130);
            access(lab, station, 0x0120, 2, Some(vec![state as u8 | 0x20, 0])).expect("taken");
            let until = lab.now() + Span::ms(60);
            lab.run_until(until).expect("time passes");
            let data = access(lab, station, 0x0134, 2, None).expect("an answer");
            u16::from_le_bytes([data[0], data[1]])
        }
    };
    (way, number)
}

#[test]
fn each_device_tells_its_identification_in_the_way_that_its_description_names() {
    let (Some(root), Some(names)) = (root(), files("esi", ".xml")) else { return };
    let mut counts = [0; 3];
    for name in &names {
        let collection = Collection::new(root.clone());
        let esi = collection.descriptions(name).unwrap();
        for device in esi.usable() {
            let expected = match (device.identification_address, device.identification_by_al_status)
            {
                (_, true) => 0,
                (Some(_), false) => 1,
                // Those who name no way have the alias; two of each file are enough.
                (None, false) if counts[2] < 2 * names.len() => 2,
                (None, false) => continue,
            };
            let Ok(file) = segment(&type_name(name, device), &collection) else { continue };
            if !device.sub_devices.is_empty() {
                continue;
            }
            let file = with_key(&file, &collection, &format!("id = {ID}"));
            let (way, number) = identification(&mut in_preop(&file));
            let found = match way {
                Identification::AlStatus => 0,
                Identification::Memory(_) => 1,
                Identification::None => 2,
            };
            assert_eq!((found, number), (expected, ID), "{name}: {}", device.type_name);
            counts[found] += 1;
        }
    }
    println!("{} by AL status, {} in memory, {} by alias", counts[0], counts[1], counts[2]);
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
}

#[test]
fn each_module_fits_into_the_slots_that_name_it() {
    let (Some(root), Some(names)) = (root(), files("esi", ".xml")) else { return };
    let (mut tried, mut devices) = (0, 0);
    for name in &names {
        let collection = Collection::new(root.clone());
        let esi = collection.descriptions(name).unwrap();
        for device in esi.usable() {
            let Some(slots) = &device.slots else { continue };
            devices += 1;
            let own = segment(&type_name(name, device), &collection).expect("a device with slots");
            for place in 0..slots.slots.len().min(2) {
                let fitting: Vec<&EsiModule> =
                    slots.slots[place].idents.iter().filter_map(|one| esi.module(*one)).collect();
                for module in fitting {
                    // What must be there is there, with this one in its place.
                    let filled: Vec<String> = slots
                        .slots
                        .iter()
                        .enumerate()
                        .map(|(at, slot)| match (at == place, slot.idents.first()) {
                            (true, _) => format!("\"0x{:X}\"", module.ident),
                            (false, Some(first)) if slot.required => format!("\"0x{first:X}\""),
                            (false, _) => "\"\"".to_owned(),
                        })
                        .collect();
                    let file =
                        with_key(&own, &collection, &format!("slots = [{}]", filled.join(", ")));
                    let mut lab = to_op(&file)
                        .unwrap_or_else(|why| panic!("{name}, {}: {why}", module.type_name));
                    let id = lab.segment().devices().last().expect("a device");
                    let object = ObjectAddress::new(0xF050, place as u8 + 1);
                    let detected = lab.read_object(id, object).expect("time passes");
                    let detected = detected.expect("an answer").expect("0xF050");
                    assert_eq!(detected, module.ident.to_le_bytes(), "{}", module.type_name);
                    tried += 1;
                }
            }
        }
    }
    println!("{tried} modules in the slots of {devices} devices");
    assert!(tried > 0);
}

/// Writes an object of the last device.
fn write(lab: &mut Lab, index: u16, subindex: u8, data: &[u8]) -> Result<(), String> {
    let object = ObjectAddress::new(index, subindex);
    let id = lab.plan().expect("a plan").devices.last().expect("a device").id;
    let (before, now) = (lab.events().len(), lab.now());
    lab.main_mut().sdo_download(now, id, object, false, data);
    let done = |lab: &Lab| {
        lab.events().iter().skip(before).find_map(|(_, event)| {
            let Event::SdoDownloaded { result, .. } = event else { return None };
            Some(result.clone())
        })
    };
    lab.run_while(Span::s(5), Span::us(100), |lab| done(lab).is_some()).expect("time passes");
    match done(lab) {
        Some(Ok(())) => Ok(()),
        other => Err(format!("0x{index:04X}:{subindex:02X}: {other:?}")),
    }
}

/// Assigns the PDOs of a mapping, as a MainDevice does it, and goes to OP with a plan that fits.
fn to_op_with(file: &SegmentFile, device: &EsiDevice, at: usize) -> Result<(), String> {
    let mapping = &device.alternatives[at];
    let mut lab = in_preop(file);
    if let Some(mode) = clock::modes(device).next() {
        clock::switch_on(&mut lab, mode)?;
    }
    let assigned = device.assigned(Some(mapping), device.op_mode(None));
    for (sync_manager, _) in &mapping.assignments {
        let list = 0x1C10 + u16::from(*sync_manager);
        let pdos = assigned.iter().find(|one| one.sync_manager == *sync_manager);
        let pdos = pdos.map_or(&[][..], |one| &one.pdos);
        write(&mut lab, list, 0, &[0])?;
        for (pdo, place) in pdos.iter().zip(1..) {
            write(&mut lab, list, place, &pdo.0.index.to_le_bytes())?;
        }
        write(&mut lab, list, 0, &[pdos.len() as u8])?;
    }
    let mut inventory = lab.inventory().expect("scanned").clone();
    for manager in &mut inventory.devices.last_mut().expect("a device").profile.process {
        let carried = assigned.iter().find(|one| one.sync_manager == manager.index);
        manager.len = carried.map_or(0, |one| one.bytes() as u16);
    }
    let tree = inventory.tree().clone();
    let options = PlanOptions::default();
    let plan = Plan::build(&inventory.planned(AlState::Op), tree, &options);
    let plan = plan.map_err(|error| error.to_string())?;
    let (before, now) = (lab.events().len(), lab.now());
    lab.main_mut().start(now, plan);
    let reached = |lab: &Lab| {
        lab.events().iter().skip(before).any(|(_, event)| matches!(event, Event::AllReached))
    };
    let up = lab.run_while(Span::s(5), Span::ms(1), reached).expect("time passes");
    let id = lab.segment().devices().last().expect("a device");
    let controller = lab.segment().controller(id).expect("it is there");
    let state = controller.al_status().to_string();
    if up && state == "OP" { Ok(()) } else { Err(format!("{state}, {:?}", lab.events().last())) }
}

#[test]
fn each_alternative_mapping_of_a_device_with_coe_can_be_chosen() {
    let (Some(root), Some(names)) = (root(), files("esi", ".xml")) else { return };
    let (mut tried, mut devices, mut failed) = (0, 0, Vec::new());
    for name in &names {
        let collection = Collection::new(root.clone());
        let esi = collection.descriptions(name).unwrap();
        let choosable = |device: &&EsiDevice| {
            let coe = device.mailbox.as_ref().is_some_and(|mailbox| mailbox.coe.pdo_assign());
            coe && device.alternatives.len() > 1
        };
        for device in esi.usable().filter(choosable) {
            let Ok(file) = segment(&type_name(name, device), &collection) else { continue };
            devices += 1;
            for at in 0..device.alternatives.len() {
                tried += 1;
                if let Err(reason) = to_op_with(&file, device, at) {
                    let mapping = &device.alternatives[at].name;
                    failed.push(format!("{}: {mapping}: {reason}", type_name(name, device)));
                }
            }
        }
    }
    println!("{tried} mappings of {devices} devices");
    assert!(tried > 0 && failed.is_empty(), "{tried}: {}", failed.join("\n"));
}

#[test]
fn a_device_that_plays_its_sii_is_found_like_any_other() {
    let (Some(root), Some(names)) = (root(), files("esi", ".xml")) else { return };
    let mut tried = 0;
    for name in &names {
        let collection = Collection::new(root.clone());
        let esi = collection.descriptions(name).unwrap();
        let with_coe = esi.usable().filter(|device| device.has_coe()).take(2);
        for device in with_coe {
            let Ok(file) = segment(&type_name(name, device), &collection) else { continue };
            for place in ["emulated", "shared"] {
                let file = with_key(&file, &collection, &format!("sii = \"{place}\""));
                let lab = in_preop(&file);
                let found = lab.inventory().expect("scanned").devices.last().expect("one").clone();
                let identity = found.identity.expect("an identity");
                assert_eq!(identity.product_code, device.product_code, "{name}, {place}");
            }
            tried += 1;
        }
    }
    println!("{tried} devices");
    assert!(tried > 10);
}
