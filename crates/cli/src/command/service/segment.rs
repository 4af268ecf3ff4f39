//! Service client of a virtual segment, in virtual time.

use std::path::{Path, PathBuf};

use linesman_config::inventory::Inventory;
use linesman_diagnosis::Diagnosis;
use linesman_lab::lab::Lab;
use linesman_lab::options::{Begin, LabOptions};
use linesman_maindevice::Event;
use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Span;
use linesman_runtime::service_session::service_plan;
use linesman_sim::segment_file::SegmentFile;

use super::{ServiceClient, ServiceRefused};
use crate::command::line_access;
use crate::failure::Failure;
use crate::files;

/// Virtual seconds cost little.
const SCAN_PATIENCE: Span = Span::s(60);
/// Every step of a service has a limit of its own.
const SERVICE_PATIENCE: Span = Span::s(3_600);
/// Between two looks whether it is done.
const STEP: Span = Span::ms(1);

/// A virtual segment.
pub(super) struct SegmentClient {
    lab: Lab,
    path: PathBuf,
    /// Events up to here have been looked through.
    seen: usize,
    told: usize,
}

/// Builds and scans the segment.
pub(super) fn open(path: &Path) -> Result<(SegmentClient, Inventory, Vec<String>), Failure> {
    serve(&files::segment_file(path)?, path)
}

/// Builds and scans a segment of one device that is as its maker describes it: its dictionary, without the
/// device (SW-13). `device` is `esi:FILE#TYPE`, relative to the working directory.
pub(super) fn open_described(
    device: &str,
) -> Result<(SegmentClient, Inventory, Vec<String>), Failure> {
    let path = Path::new(device);
    let own = |on: &str| {
        format!("[[device]]\nname = \"offline\"\ntype = {}\non = \"{on}\"\n", toml_string(device))
    };
    let parse = |text: &str| {
        let file = SegmentFile::parse_with(text, &files::NamedFiles::of(Path::new("")));
        file.map_err(|error| Failure::from_error(&error))
    };
    // A terminal needs a coupler before it.
    let coupler = "[[device]]\nname = \"coupler\"\ntype = \"EK1100\"\non = \"maindevice\"\n";
    let alone = parse(&own("maindevice"));
    let file = match alone {
        Ok(file) => file,
        Err(reason) => parse(&format!("{coupler}{}", own("coupler.B"))).map_err(|_| reason)?,
    };
    serve(&file, path)
}

/// A word as a string of TOML.
fn toml_string(word: &str) -> String {
    format!("\"{}\"", word.replace('\\', "\\\\").replace('"', "\\\""))
}

fn serve(
    file: &SegmentFile,
    path: &Path,
) -> Result<(SegmentClient, Inventory, Vec<String>), Failure> {
    let options =
        LabOptions { begin: Begin::Idle, project: false, probes: false, ..LabOptions::default() };
    let lab = Lab::new(file, options).map_err(|error| files::in_file(path, &error))?;
    let mut segment = SegmentClient { lab, path: path.to_owned(), seen: 0, told: 0 };
    let now = segment.lab.now();
    segment.lab.main_mut().scan(now);
    let scanned = segment.until(SCAN_PATIENCE, |event| {
        if let Event::Scanned(inventory) = event {
            Some(Ok((**inventory).clone()))
        } else if let Event::ScanFailed(error) = event {
            Some(Err(line_access::nobody(error)))
        } else {
            None
        }
    })?;
    let inventory = scanned?;
    let now = segment.lab.now();
    segment.lab.main_mut().serve_only(now, service_plan(&inventory));
    let names = names(&segment.lab, &inventory);
    Ok((segment, inventory, names))
}

/// The names of the file in the order of processing, if the line is as the file says: else they would be those of others.
fn names(lab: &Lab, inventory: &Inventory) -> Vec<String> {
    let devices = &lab.project().devices;
    if devices.len() != inventory.devices.len() {
        return Vec::new();
    }
    let found = (0..).map(DeviceId).take(devices.len());
    found.map(|id| devices[lab.of_plan(id).index()].name.clone()).collect()
}

impl SegmentClient {
    /// Lets time pass until an event gives what is looked for.
    fn until<T>(
        &mut self,
        patience: Span,
        pick: impl Fn(&Event) -> Option<T>,
    ) -> Result<T, Failure> {
        let seen = self.seen;
        let ended =
            |lab: &Lab| lab.events().iter().skip(seen).any(|(_, event)| pick(event).is_some());
        let run = self.lab.run_while(patience, STEP, ended);
        run.map_err(|error| files::in_file(&self.path, &error))?;
        let found = self.lab.events().iter().enumerate().skip(seen);
        let found =
            found.filter_map(|(at, (_, event))| pick(event).map(|found| (at, found))).next();
        match found {
            Some((at, found)) => {
                self.seen = at + 1;
                Ok(found)
            }
            None => {
                let path = self.path.display();
                let reason = format!("{path}: not done after {patience} of virtual time");
                let advice = "this is a fault of the program, please report it with the file";
                Err(Failure::new(reason, advice))
            }
        }
    }
}

impl ServiceClient for SegmentClient {
    fn ask(
        &mut self,
        id: DeviceId,
        service: Service,
    ) -> Result<Result<ServiceAnswer, ServiceRefused>, Failure> {
        let now = self.lab.now();
        let wanted = self.lab.main_mut().serve(now, id, service);
        self.until(SERVICE_PATIENCE, |event| {
            if let Event::Served { ticket, result, .. } = event
                && *ticket == wanted
            {
                Some((**result).clone().map_err(|failure| ServiceRefused::from(&failure)))
            } else {
                None
            }
        })
    }

    fn wait(&mut self, span: Span) -> Result<bool, Failure> {
        let run = self.lab.run_while(span, STEP, |_| false);
        run.map_err(|error| files::in_file(&self.path, &error))?;
        Ok(true)
    }

    fn diagnosis(&mut self) -> Option<Diagnosis> {
        self.lab.finish();
        Some(self.lab.diagnosis())
    }

    fn take_emergencies(&mut self) -> Vec<(DeviceId, String)> {
        let new = self.lab.events().iter().skip(self.told);
        let told = new
            .filter_map(|(_, event)| {
                let Event::Emergency { id, emergency } = event else { return None };
                Some((*id, emergency.to_string()))
            })
            .collect();
        self.told = self.lab.events().len();
        told
    }
}
