//! Device descriptions of real makers: every device of every file.

use std::fmt::Write as _;

use linesman_config::esi::EsiDevice;
use linesman_config::esi::image::image;
use linesman_lab::lab::Lab;
use linesman_proto::sii::{Direction, Identity, Image};
use linesman_sim::segment_file::DescriptionFiles;

use crate::clock;
use crate::data::{Collection, files, root};
use crate::up::{segment, to_op};

/// What became of a device.
#[derive(PartialEq, Eq, PartialOrd, Ord, Clone, Debug)]
enum Outcome {
    InOp,
    /// In OP with its clock only: it knows no other mode.
    InOpWithClock,
    /// Refused: a thing without controller.
    Passive(String),
    /// Refused: the file lacks a part of it.
    Incomplete(String),
    Failed(String),
}

fn type_name(file: &str, device: &EsiDevice) -> String {
    format!("esi:{file}#{}@0x{:08X}", device.type_name, device.revision)
}

fn is_the_described(lab: &Lab, device: &EsiDevice) -> Result<(), String> {
    let found = lab.inventory().expect("scanned").devices.last().expect("a device").clone();
    let identity = found.identity.expect("an identity");
    let last = device.sub_devices.last().copied();
    let expected = last.unwrap_or((device.product_code, device.revision));
    if (identity.product_code, identity.revision) == expected {
        Ok(())
    } else {
        Err(format!("found {identity:?}"))
    }
}

fn bring_up(file: &str, device: &EsiDevice, collection: &Collection) -> Outcome {
    let name = type_name(file, device);
    let segment = match segment(&name, collection) {
        Ok(segment) => segment,
        // Whoever is refused learns of file, line and reason.
        Err(reason) if !reason.contains(&format!("`{file}`, line {},", device.line)) => {
            return Outcome::Failed(format!("neither file nor line: {reason}"));
        }
        Err(reason) if reason.contains("a passive part") => return Outcome::Passive(reason),
        Err(reason) if reason.contains("which is not in the file") => {
            return Outcome::Incomplete(reason);
        }
        Err(reason) => return Outcome::Failed(reason),
    };
    let reached = |lab: Result<Lab, String>| lab.and_then(|lab| is_the_described(&lab, device));
    match (reached(to_op(&segment)), clock::modes(device).next()) {
        (Ok(()), _) => Outcome::InOp,
        // A description without a mode that leaves the clock alone: a MainDevice has no other choice.
        (Err(reason), Some(mode)) if clock::modes(device).count() == device.op_modes.len() => {
            match reached(clock::to_op(&segment, mode)) {
                Ok(()) => Outcome::InOpWithClock,
                Err(with_clock) => {
                    Outcome::Failed(format!("{reason}; with its clock: {with_clock}"))
                }
            }
        }
        (Err(reason), _) => Outcome::Failed(reason),
    }
}

/// All files; those that the variable ESI names, if it is set.
fn chosen() -> Option<Vec<String>> {
    let mut names = files("esi", ".xml")?;
    names.extend(files("esi/pairs", ".xml").unwrap_or_default());
    let only = std::env::var("ESI").ok();
    names.retain(|name| only.as_ref().is_none_or(|only| name.contains(only.as_str())));
    Some(names)
}

#[test]
fn every_device_of_every_description_goes_to_op_or_says_why_not() {
    let (Some(root), Some(names)) = (root(), chosen()) else { return };
    let (mut table, mut refused) = (String::new(), String::new());
    let mut failed = Vec::new();
    let mut total = ["in OP", "in OP with their clock", "passive", "incomplete", "failed"]
        .map(|what| (0, what));
    for name in &names {
        let collection = Collection::new(root.clone());
        let esi = collection.descriptions(name).unwrap();
        let mut counts = [0; 5];
        for device in &esi.devices {
            let outcome = match device {
                Ok(device) => bring_up(name, device, &collection),
                Err(error) => Outcome::Failed(error.to_string()),
            };
            match outcome {
                Outcome::InOp => counts[0] += 1,
                Outcome::InOpWithClock => counts[1] += 1,
                Outcome::Passive(reason) => {
                    counts[2] += 1;
                    let _ = writeln!(refused, "{reason}");
                }
                Outcome::Incomplete(reason) => {
                    counts[3] += 1;
                    let _ = writeln!(refused, "{reason}");
                }
                Outcome::Failed(reason) => {
                    counts[4] += 1;
                    let which = device.as_ref().map_or(name.clone(), |one| type_name(name, one));
                    failed.push(format!("{which}: {reason}"));
                }
            }
        }
        let _ = write!(table, "{name:48}");
        for ((sum, _), count) in total.iter_mut().zip(counts) {
            *sum += count;
            let _ = write!(table, " {count:6}");
        }
        table.push('\n');
    }
    let sums: Vec<String> =
        total.iter().map(|(count, what): &(usize, &str)| format!("{count} {what}")).collect();
    println!("{table}{refused}{}", sums.join(", "));
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn every_device_follows_its_clock_in_each_of_its_modes() {
    let (Some(root), Some(names)) = (root(), chosen()) else { return };
    let (mut devices, mut tried, mut failed) = (0, 0, Vec::new());
    for name in &names {
        let collection = Collection::new(root.clone());
        let esi = collection.descriptions(name).unwrap();
        for device in esi.usable() {
            let Ok(segment) = segment(&type_name(name, device), &collection) else { continue };
            devices += usize::from(clock::modes(device).next().is_some());
            for mode in clock::modes(device) {
                tried += 1;
                if let Err(reason) = clock::to_op(&segment, mode) {
                    let (type_name, mode) = (type_name(name, device), &mode.name);
                    failed.push(format!("{type_name} in {mode}: {reason}"));
                }
            }
        }
    }
    println!("{tried} modes of {devices} devices, {} in OP", tried - failed.len());
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn descriptions_and_images_of_one_device_agree() {
    let (Some(root), Some(names)) = (root(), files("esi/pairs", ".xml")) else { return };
    let collection = Collection::new(root.clone());
    for name in names {
        let stem = name.rsplit('/').next().unwrap().trim_end_matches(".xml");
        let esi = collection.descriptions(&name).unwrap();
        let real =
            Image::parse(&std::fs::read(root.join(format!("sii/pairs/{stem}.bin"))).unwrap());
        let real = real.unwrap();
        let device = esi.usable().next().unwrap();
        let made = image(device, esi.vendor_id, &device.pdos).unwrap();
        assert_eq!(made.identity, real.identity, "{stem}");
        assert_eq!(made.ebus_current_ma(), real.ebus_current_ma(), "{stem}");
        assert_eq!(made.protocols, real.protocols, "{stem}");
        assert_eq!(made.order(), Some(device.type_name.as_str()), "{stem}");
        // None of these five EEPROMs has room for PDOs, so there is nothing that could disagree.
        for direction in [Direction::Outputs, Direction::Inputs] {
            assert_eq!(real.pdos(direction).count(), 0, "{stem}");
        }
        // This project's image was not made from its description: mailbox and configuration differ.
        if stem == "kickcat-xmc4800-relax" {
            assert_ne!(made.standard_mailbox, real.standard_mailbox);
            continue;
        }
        assert_eq!(made.configuration, real.configuration, "{stem}");
        assert_eq!(made.standard_mailbox, real.standard_mailbox, "{stem}");
        assert_eq!(made.bootstrap_mailbox, real.bootstrap_mailbox, "{stem}");
        for (made, real) in made.sync_managers().iter().zip(real.sync_managers()) {
            assert_eq!(
                (made.start, made.control, made.kind, made.enable),
                (real.start, real.control, real.kind, real.enable),
                "{stem}"
            );
        }
    }
}

/// Single images whose device is described in one of the files: everything that both say agrees.
#[test]
fn images_agree_with_the_description_of_their_revision() {
    let Some(root) = root() else { return };
    let collection = Collection::new(root.clone());
    for (stem, file, revision) in
        [("ec-EK1100", "dls-Beckhoff-EK11xx", 0x0012_0000), ("dls-NI9144-rev1", "dls-NI9144", 1)]
    {
        let real = std::fs::read(root.join(format!("sii/{stem}.bin"))).unwrap();
        let real = Image::parse(&real).unwrap();
        let esi = collection.descriptions(&format!("esi/{file}.xml")).unwrap();
        let device = esi.usable().find(|device| {
            device.product_code == real.identity.product_code && device.revision == revision
        });
        let device = device.unwrap();
        let made = image(device, esi.vendor_id, &device.pdos).unwrap();
        assert_eq!(made.identity, Identity { serial_number: 0, ..real.identity }, "{stem}");
        assert_eq!(made.ebus_current_ma(), real.ebus_current_ma(), "{stem}");
        assert_eq!(made.general().unwrap().ports, real.general().unwrap().ports, "{stem}");
        assert_eq!(made.configuration, real.configuration, "{stem}");
        assert_eq!(made.standard_mailbox, real.standard_mailbox, "{stem}");
        let sizes = |image: &Image| image.process_data().map(|one| one.bits).collect::<Vec<_>>();
        assert_eq!(sizes(&made), sizes(&real), "{stem}");
        let records = |image: &Image| image.sync_managers().to_vec();
        assert_eq!(records(&made), records(&real), "{stem}");
    }
}
