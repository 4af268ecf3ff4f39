//! `linesman bundle anonymise`: a bundle that can be given to a maker without naming the customer.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use linesman_capture::anonymous::FrameAnonymiser;
use linesman_config::attachment::Attachment;
use linesman_config::project::{IdentificationChoice, IdentificationWay, Project, ProjectDevice};
use linesman_diagnosis::report::Number;
use linesman_diagnosis::{Diagnosis, Engine};
use linesman_runtime::bundle::{
    Anonymised, Bundle, BundleFinding, Manifest, differences, findings,
};

use super::recording::report;
use super::{findings_in_words, open};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::quantity::count;
use crate::version;

/// What can be asked.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Replaced are names of the project, its SubDevices, tasks and files, of cards and of the source; serial numbers, in \
                  the project, in SII reads and in object 0x1018; addresses of network cards, and IP addresses of EtherCAT over \
                  UDP; process data, parameters (objects from 0x2000 on), files and Ethernet over EtherCAT become zeros. The same \
                  becomes the same. Types, vendors, dates, states and error counters stay: the diagnosis needs them, and so does a \
                  maker.\n\nExit status: 0 the same is found in it, 1 something else is found, 2 nothing was written."
)]
pub(super) struct Arguments {
    /// The bundle
    #[arg(value_name = "BUNDLE.zip")]
    bundle: PathBuf,
    /// The other one
    #[arg(long, short, value_name = "OTHER.zip")]
    output: PathBuf,
    /// JSON, schema linesman.bundle/1: the manifest of the other one
    #[arg(long)]
    pub(super) json: bool,
}

/// Writes the other one.
pub(super) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    files::refuse_to_overwrite(&arguments.output)?;
    let written = write_anonymised(&arguments.bundle, &arguments.output)?;
    let manifest = &written.manifest;
    if arguments.json {
        output.json(manifest);
    } else {
        let told = manifest.anonymised.as_ref().map(told).unwrap_or_default();
        output.line(&format!("{}: replaced {told}.", arguments.output.display()));
    }
    for (which, what) in [
        (&written.missing, "not found in it any more"),
        (&written.new, "found in it and not before"),
    ] {
        if !which.is_empty() {
            output.warn(&format!("{what}: {}", findings_in_words(which)));
        }
    }
    let is_same = written.missing.is_empty() && written.new.is_empty();
    if is_same && !arguments.json {
        output.line("The same is found in it: codes, places and causes.");
    }
    Ok(if is_same { Status::Good } else { Status::Findings })
}

/// A bundle that was written without what tells whose machine it is.
struct AnonymisedBundle {
    manifest: Manifest,
    /// Findings of the first one that are not found in it.
    missing: Vec<BundleFinding>,
    /// Findings that are found in it alone.
    new: Vec<BundleFinding>,
}

/// Reads a bundle, and writes it anonymised.
fn write_anonymised(from: &Path, to: &Path) -> Result<AnonymisedBundle, Failure> {
    let mut bundle = open(from)?;
    let before = judged(&bundle)?.0;
    anonymise(&mut bundle)?;
    let (diagnosis, report) = judged(&bundle)?;
    let (first, second) = (findings(&before), findings(&diagnosis));
    let (missing, new) = differences(&first, &second);
    let owned = |all: Vec<&BundleFinding>| all.into_iter().cloned().collect::<Vec<_>>();
    let (missing, new) = (owned(missing), owned(new));
    bundle.diagnosis = Some(diagnosis);
    bundle.write(to, &report).map_err(|error| files::in_file(to, &error))?;
    Ok(AnonymisedBundle { manifest: bundle.manifest, missing, new })
}

/// The same for a bundle that is being written beside a run.
pub(super) fn anonymise_file(from: &Path, to: &Path) -> Result<(), String> {
    write_anonymised(from, to).map(drop).map_err(|failure| failure.reason)
}

/// Counts of what was replaced, in words.
pub(super) fn told(replaced: &Anonymised) -> String {
    [
        count(replaced.names.0, "name"),
        count(replaced.serial_numbers.0, "serial number"),
        count(replaced.mac_addresses.0, "card address").replace("addresss", "addresses"),
        format!("process data of {}", count(replaced.process_data.0, "datagram")),
        format!("contents of {}", count(replaced.mailbox_messages.0, "mailbox message")),
        format!(
            "contents of {}",
            count(replaced.foreign_frames.0, "frame") + " of other protocols"
        ),
    ]
    .join(", ")
}

/// What is found in a bundle, and the report of it. Its source is the one of the manifest: a name of a file may tell.
fn judged(bundle: &Bundle) -> Result<(Diagnosis, String), Failure> {
    let mut setup = bundle.setup();
    setup.source.clone_from(&bundle.manifest.source);
    let mut engine = Engine::new(setup);
    if let Some(asking) = bundle.diagnosis.as_ref().and_then(|said| said.asking.clone()) {
        engine.note_asking(asking);
    }
    bundle.replay(&mut engine, |_| {})?;
    let mut diagnosis = engine.diagnosis();
    diagnosis.tool = version::tool();
    let report = report(&diagnosis, &engine);
    Ok((diagnosis, report))
}

fn anonymise(bundle: &mut Bundle) -> Result<(), Failure> {
    let mut frames = FrameAnonymiser::default();
    let mut names = NameReplacement::default();
    if let Some(project) = &mut bundle.project {
        names.project(project, &mut frames);
    }
    bundle.replace_frames(|bytes| frames.frame(bytes))?;
    let source = &mut bundle.manifest.source;
    let kind = source.split_once(':').map_or("cards", |(kind, _)| match kind {
        "listen" => "listen:cards",
        "sim" => "sim:segment",
        _ => "cards",
    });
    kind.clone_into(source);
    names.count += 1;
    let replaced = frames.replaced();
    bundle.manifest.anonymised = Some(Anonymised {
        names: Number(names.count),
        serial_numbers: Number(frames.serials()),
        mac_addresses: Number(frames.macs()),
        process_data: Number(replaced.process_data),
        mailbox_messages: Number(replaced.mailbox_messages),
        foreign_frames: Number(replaced.foreign_frames),
    });
    Ok(())
}

/// Replacement of names: the same one always becomes the same.
#[derive(Default)]
struct NameReplacement {
    tasks: BTreeMap<String, String>,
    groups: BTreeMap<String, String>,
    units: BTreeMap<String, String>,
    count: u64,
}

impl NameReplacement {
    fn project(&mut self, project: &mut Project, frames: &mut FrameAnonymiser) {
        self.blank(&mut project.name);
        for path in project.esi.drain(..) {
            self.count += u64::from(!path.is_empty());
        }
        let named = project.devices.iter().zip(1..);
        let devices: BTreeMap<String, String> =
            named.map(|(device, no)| (device.name.clone(), format!("D{no}"))).collect();
        self.count += devices.len() as u64;
        for task in &mut project.tasks {
            task.name = renamed(&mut self.tasks, &task.name, "task");
        }
        if let Some(ring) = &mut project.ring {
            attach(&devices, &mut ring.closes_at);
        }
        // Addresses of the customer's computers; frames show none of what a gateway did with them.
        self.count += u64::from(project.gateway.take().is_some());
        for group in &mut project.groups {
            group.name = renamed(&mut self.groups, &group.name, "group");
            for name in std::iter::once(&mut group.first).chain(&mut group.members) {
                if let Some(other) = devices.get(name) {
                    name.clone_from(other);
                }
            }
            group.places.iter_mut().for_each(|place| attach(&devices, place));
            number(&mut group.identification, frames);
        }
        for device in &mut project.devices {
            number(&mut device.identification, frames);
            if let Some(name) = devices.get(&device.name) {
                device.name.clone_from(name);
            }
            attach(&devices, &mut device.on);
            device.serial = device.serial.map(|serial| frames.serial(serial));
            self.device(device);
        }
        self.count += (self.tasks.len() + self.groups.len() + self.units.len()) as u64;
    }

    fn device(&mut self, device: &mut ProjectDevice) {
        if let Some(task) = &mut device.task {
            *task = renamed(&mut self.tasks, task, "task");
        }
        if let Some(unit) = &mut device.sync_unit {
            *unit = renamed(&mut self.units, unit, "unit");
        }
        // Values that are written at start-up are settings of the machine; the diagnosis does not look at them.
        device.start_up.clear();
        device.modules.clear();
        let described = device.description.iter_mut().flat_map(|description| &mut description.pdos);
        for pdo in described {
            self.blank(&mut pdo.name);
            pdo.entries.iter_mut().for_each(|entry| self.blank(&mut entry.name));
        }
        for entry in device.mappings.iter_mut().flat_map(|mapping| &mut mapping.entries) {
            self.blank(&mut entry.name);
        }
    }

    fn blank(&mut self, name: &mut String) {
        self.count += u64::from(!name.is_empty());
        name.clear();
    }
}

/// Replaces a serial number by which a device is told from its equals.
fn number(choice: &mut Option<IdentificationChoice>, frames: &mut FrameAnonymiser) {
    if let Some(choice) = choice
        && choice.by == IdentificationWay::Serial
    {
        choice.value = choice.value.map(|serial| frames.serial(serial));
    }
}

fn attach(devices: &BTreeMap<String, String>, on: &mut Attachment) {
    if let Attachment::Device { name, .. } = on
        && let Some(other) = devices.get(name)
    {
        name.clone_from(other);
    }
}

fn renamed(known: &mut BTreeMap<String, String>, name: &str, word: &str) -> String {
    let next = format!("{word}{}", known.len() + 1);
    known.entry(name.to_owned()).or_insert(next).clone()
}
