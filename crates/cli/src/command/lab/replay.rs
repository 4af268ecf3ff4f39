//! `linesman lab replay`: the requests of a recording, played against a segment, and its answers
//! beside the recorded ones.

use std::path::{Path, PathBuf};

use linesman_config::esi::Esi;
use linesman_lab::replay::report::Verdict;
use linesman_lab::replay::{Model, Recorder, Recording, Report, learn, model, on_segment, play};
use linesman_link::capture::CaptureError;
use linesman_link::input::Input;
use linesman_runtime::capture::Capture;
use linesman_sim::device::DescribedType;
use serde::Serialize;

use crate::command::bundle::frames;
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::quantity::count;
use crate::version;

/// Longest image that is read, in bytes.
const MAX_IMAGE: u64 = 1024 * 1024;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// The recording: pcap or pcapng, plain or gzipped; or a bundle
    #[arg(value_name = "CAPTURE.pcapng|BUNDLE.zip")]
    capture: PathBuf,
    /// Play against this segment; without it, one is built of what the recording shows
    #[arg(long, value_name = "SEGMENT.toml")]
    segment: Option<PathBuf>,
    /// SII images: words that the recording does not show come from the one of the same product
    #[arg(long, value_name = "FILE.bin", num_args = 1..)]
    sii: Vec<PathBuf>,
    /// Device descriptions of their makers, for the same purpose
    #[arg(long, value_name = "FILE.xml", num_args = 1..)]
    esi: Vec<PathBuf>,
    /// JSON, schema linesman.replay/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// The answer as JSON.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReplayReport {
    /// `linesman.replay/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// The recording.
    capture: String,
    /// `agrees`, `agrees but for exceptions`, `differs` or `nothing judged`.
    verdict: String,
    /// What it showed.
    #[serde(flatten)]
    report: Report,
}

/// Plays it.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let recording = record(&arguments.capture, output)?;
    let mut images = images(&arguments.sii)?;
    for path in &arguments.esi {
        images.extend(described(path)?);
    }
    let learned = learn(&recording);
    let mut made: Option<Model> = match &arguments.segment {
        Some(path) => {
            let plant = files::Plant::open(path)?;
            Some(on_segment(plant.segment, &learned))
        }
        None if learned.devices.is_empty() => None,
        None => Some(model(&learned, &images).map_err(|error| {
            Failure::new(
                format!("{}: {error}", arguments.capture.display()),
                "name the segment with --segment",
            )
        })?),
    };
    let report = match &mut made {
        Some(model) => play(&recording, model),
        None => Report::without_devices(&recording),
    };
    let (verdict, status) = match report.verdict() {
        Verdict::Agrees => ("agrees", Status::Good),
        Verdict::AgreesButForExceptions => ("agrees but for exceptions", Status::Good),
        Verdict::Differs => ("differs", Status::Findings),
        Verdict::NothingJudged => ("nothing judged", Status::NotJudged),
    };
    if arguments.json {
        output.json(&ReplayReport {
            schema: "linesman.replay/1".to_owned(),
            tool: version::tool(),
            capture: arguments.capture.display().to_string(),
            verdict: verdict.to_owned(),
            report,
        });
    } else {
        output.text(&report.to_string());
        output.line(&conclusion(&report));
    }
    Ok(status)
}

fn conclusion(report: &Report) -> String {
    let share = || format!("{} of {} differ", count(report.different, "datagram"), report.compared);
    match report.verdict() {
        Verdict::Agrees => {
            format!("All answers agree: {}.", count(report.compared, "datagram"))
        }
        Verdict::AgreesButForExceptions => {
            format!("The answers agree but for exceptions: {}, each for a reason.", share())
        }
        Verdict::Differs if report.process_data > 0 => {
            format!("{}, {} of them in process data.", share(), report.process_data)
        }
        Verdict::Differs if report.unexplained > 0 => {
            format!("{}, {} of them for no reason that the recording shows.", share(), report.unexplained)
        }
        Verdict::Differs => format!("{}: more than one in a hundred.", share()),
        Verdict::NothingJudged => match (report.requests, report.returns_alone) {
            (0, _) => "Nothing could be judged: the recording shows only frames that came back, and \
                       without their requests nothing can be played. Record both directions on the \
                       card of the MainDevice."
                .to_owned(),
            (_, 0) => "Nothing could be judged: no request of the recording was answered. Either no \
                       device was there, or only one direction was recorded: then record on the card \
                       of the MainDevice."
                .to_owned(),
            (_, _) => "Nothing could be judged: no request of the recording was answered.".to_owned(),
        },
    }
}

fn record(path: &Path, output: &mut Output) -> Result<Recording, Failure> {
    let input = Input::open(path).map_err(CaptureError::from)?;
    let mut capture = Capture::of(frames(input)?)?;
    let mut recorder = Recorder::default();
    while let Some(frame) = capture.next_frame() {
        recorder.take(&frame);
    }
    if let Some(end) = capture.end().filter(|end| !end.complete()) {
        output.warn(&format!("{}: {end}", path.display()));
    }
    let recording = recorder.finish();
    if recording.turns.is_empty() && recording.alone == 0 {
        let reason = format!("{}: no EtherCAT request in it", path.display());
        let advice = "record on the card that the line is plugged into, while a MainDevice works: \
                      `tcpdump -i eth0 -w trace.pcap`";
        return Err(Failure::new(reason, advice));
    }
    Ok(recording)
}

/// The images of all devices of a file of descriptions that can be made.
fn described(path: &Path) -> Result<Vec<Vec<u8>>, Failure> {
    let bytes = files::description(path)?;
    let esi = Esi::parse(&bytes).map_err(|error| files::in_file(path, &error))?;
    let made = esi.usable().filter_map(|device| DescribedType::from_esi(&esi, device, None).ok());
    let images: Vec<Vec<u8>> = made.filter_map(|made| made.image.build().ok()).collect();
    if images.is_empty() {
        let reason = format!("{}: no device in it that can be made", path.display());
        return Err(Failure::new(reason, "name the description of a device of the recording"));
    }
    Ok(images)
}

fn images(paths: &[PathBuf]) -> Result<Vec<Vec<u8>>, Failure> {
    paths.iter().map(|path| files::bytes(path, "an SII image", MAX_IMAGE)).collect()
}
