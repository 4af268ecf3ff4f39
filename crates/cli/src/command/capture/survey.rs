//! A capture, read from its first frame to its last: diagnosis and survey.

use std::path::{Path, PathBuf};

use linesman_capture::network::unknown::UnknownReport;
use linesman_capture::{CaptureReport, Survey};
use linesman_diagnosis::report::DeviceReport;
use linesman_diagnosis::{Engine, Setup};
use linesman_link::capture::CaptureError;
use linesman_link::input::{Content, Input};
use linesman_proto::address::Network;
use linesman_runtime::capture::Capture;
use linesman_runtime::plan_file::library::Library;
use linesman_runtime::selector::Selector;
use linesman_runtime::stop::Stop;

use super::source::FileTimes;
use crate::command::bundle::frames;
use crate::command::diagnose::capture::{nothing_seen, read};
use crate::command::diagnose::tap::{TapArguments, TapLinks};
use crate::command::diagnose::{names, ring};
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::names::Names;
use crate::text::quantity::count;
use crate::version;

/// A capture that was read.
pub(super) struct Surveyed {
    /// Report of the network.
    pub(super) report: CaptureReport,
    /// The diagnosis with all it has learnt.
    pub(super) engine: Engine,
    /// Names of the SubDevices.
    pub(super) names: Names,
}

/// Reads a capture; several files are one recording, one after the other unless `times` says otherwise. `tap` is where it was taken inside the
/// line, `esi` where device descriptions are that name types.
pub(super) fn survey(
    places: &[String],
    times: FileTimes,
    tap: &TapArguments,
    esi: Option<&Path>,
    stop: &Stop,
    output: &mut Output,
) -> Result<Surveyed, Failure> {
    let mut library = esi.map(library).transpose()?;
    let (path, mut capture) = match places {
        [place] => {
            let input = open(place, stop)?;
            (input.name().to_owned(), Capture::of(input)?)
        }
        several => (PathBuf::from(several.join(" + ")), open_several(several, times)?),
    };
    let tap = tap.links(None)?;
    if let Some(tap) = &tap {
        capture = capture.by_tap(tap.tap());
    }
    let setup = Setup {
        source: format!("capture:{}", path.display()),
        clock: "capture".to_owned(),
        tap_places: tap.as_ref().map(TapLinks::before).unwrap_or_default(),
        ..Setup::default()
    };
    let (mut engine, mut survey) = (Engine::new(setup), Survey::default());
    let whole = read(&path, &mut capture, stop, output, |item, _| {
        survey.handle_frame(&mut engine, &item.seen);
    });
    let at = capture.latest();
    engine.handle_missed(Network::default(), capture.missed(), at);
    survey.finish(&mut engine, at, whole.is_complete);
    if engine.diagnosis().network.frames.0 == 0 {
        return Err(nothing_seen(&path, &capture, whole.frames));
    }
    if let Some(tap) = &tap {
        tap.check_all(&engine, &capture, &path.display().to_string(), output)?;
    }
    if let Some(library) = &mut library {
        describe_pdos(&mut survey, &engine, library, output);
    }
    let mut report =
        survey.report(&engine).ok_or_else(|| nothing_seen(&path, &capture, whole.frames))?;
    report.tool = version::tool();
    report.start = capture.start().and_then(|start| start.rfc3339());
    let interfaces = (0..).zip(capture.interfaces());
    let name = |(no, one): (u32, &linesman_link::capture::CaptureInterface)| {
        one.name.clone().or_else(|| one.description.clone()).unwrap_or_else(|| no.to_string())
    };
    report.recording.interfaces = interfaces.map(name).collect();
    if !capture.has_end_mark() {
        report.unknown.push(no_end_mark());
    }
    if let Some(library) = &library {
        describe(&mut report, library);
    }
    let names = match library {
        Some(_) => described_names(&report),
        None => names(&engine),
    };
    Ok(Surveyed { report, engine, names })
}

/// Question that a recording without a note of its end leaves open.
fn no_end_mark() -> UnknownReport {
    UnknownReport {
        what: "whether anything came after the last frame".to_owned(),
        why: "the recorder did not note when it ended (`tcpdump -w` never does): a last request without an answer is not \
              counted as lost; dumpcap, `capture record` and --record note it"
            .to_owned(),
        devices: Vec::new(),
    }
}

/// The files of one recording.
fn open_several(places: &[String], times: FileTimes) -> Result<Capture, Failure> {
    let paths: Vec<PathBuf> = places.iter().map(PathBuf::from).collect();
    if times.together {
        files::refuse_what_is_no_file(&paths)?;
        return Ok(Capture::side_by_side(&paths)?);
    }
    if !ring::is_ring(places) {
        let files = count(places.len() as u64, "file");
        let reason = format!("{files} whose names are not those of one ring of files");
        let advice = "name one; or add --together where they were recorded at the same time";
        return Err(Failure::new(reason, advice));
    }
    Ok(Capture::of_files(&paths)?)
}

fn open(place: &str, stop: &Stop) -> Result<Input, Failure> {
    let path = match Selector::resolve(place)? {
        Selector::File(path) => path,
        selector @ (Selector::Cards(_) | Selector::Listen(_) | Selector::Segment(_)) => {
            return Err(Failure::new(
                format!("`{selector}`: this is no file, expected a capture"),
                format!("record it first: `linesman diagnose {selector} --record trace.pcapng`"),
            ));
        }
    };
    let wish = stop.clone();
    let input = Input::open_until(&path, move || wish.is_set()).map_err(CaptureError::from)?;
    match input.content() {
        Content::Capture => Ok(input),
        Content::Archive => frames(input),
        Content::Text => Err(Failure::new(
            format!("{}: a text, expected a capture (pcap or pcapng)", path.display()),
            format!("if it is what another tool has printed: `linesman diagnose {place}`"),
        )),
    }
}

/// Device descriptions of a folder or file.
fn library(place: &Path) -> Result<Library, Failure> {
    let mut library = Library::default();
    let refuse = |reason: String| {
        Failure::new(reason, "name a folder of device descriptions (XML), or one of them")
    };
    library.add(place).map_err(|error| {
        refuse(format!("{}: reading device descriptions: {error}", place.display()))
    })?;
    if library.is_empty() {
        return Err(refuse(format!("{}: no device description is in it", place.display())));
    }
    Ok(library)
}

/// Tells the survey what the process data of SubDevices are by their descriptions.
fn describe_pdos(survey: &mut Survey, engine: &Engine, library: &mut Library, output: &Output) {
    let Some(model) = engine.model(Network::default()) else { return };
    let mut refused = Vec::new();
    for device in &model.devices {
        let about = DeviceReport::of(device);
        let (Some(vendor), Some(product)) = (about.vendor_id, about.product_code) else { continue };
        if library.type_of(vendor, product, about.revision).is_none() {
            continue;
        }
        match library.pdos_of(vendor, product, about.revision) {
            Ok(pdos) => survey.describe(device.id, pdos),
            Err(reason) if refused.contains(&reason) => {}
            Err(reason) => {
                output.warn(&format!(
                    "{reason}; the process data of such SubDevices get no names of it"
                ));
                refused.push(reason);
            }
        }
    }
}

/// Names the types of SubDevices by their descriptions.
fn describe(report: &mut CaptureReport, library: &Library) {
    for device in &mut report.devices {
        let about = &device.about;
        if let (Some(vendor), Some(product)) = (about.vendor_id, about.product_code) {
            let found = library.type_of(vendor, product, about.revision);
            device.described_as = found.map(str::to_owned);
        }
    }
}

fn described_names(report: &CaptureReport) -> Names {
    let known = |text: &Option<String>| text.clone().unwrap_or_default();
    Names::new(report.devices.iter().map(|device| {
        let kind = device.about.type_name.as_ref().or(device.described_as.as_ref());
        (known(&device.about.name), kind.cloned().unwrap_or_default())
    }))
}
