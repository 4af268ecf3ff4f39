//! `linesman lab excerpts`: verdicts on recordings that were cut at random, held against the truth.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use linesman_config::fault::FaultName;
use linesman_diagnosis::report::Verdict;
use linesman_lab::score::excerpt::{
    ExcerptOptions, ExcerptReport, Fairness, excerpt_frames, run_excerpt,
};
use linesman_link::capture::{
    CaptureInterfaceId, FrameDirection, FrameToWrite, LinkType, PcapWriter,
};
use linesman_link::unix_time::UnixTime;
use linesman_proto::time::Instant;

use super::{on_all_processors, seeds};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::{Output, Progress, Table};
use crate::text::quantity::count;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// From the first seed up to, not including, the second
    #[arg(long, value_name = "A..B", value_parser = seeds)]
    seeds: Range<u64>,
    /// Nothing is wrong in any case: whatever is said is a false alarm
    #[arg(long, conflicts_with = "fault")]
    healthy: bool,
    /// Only this fault
    #[arg(long, value_name = "NAME")]
    fault: Option<FaultName>,
    /// Write the excerpt of the first seed to a capture file, to be judged by itself
    #[arg(long, value_name = "FILE.pcap")]
    record: Option<PathBuf>,
    /// With --record: the whole recording, of which the excerpt is a part
    #[arg(long, requires = "record")]
    whole: bool,
    /// Also each excerpt that was called healthy though a fault acted in it, and each false alarm
    #[arg(long)]
    list: bool,
}

/// Verdicts on the excerpts of one kind of fault.
#[derive(Clone, Copy, Default)]
struct Row {
    acted: u64,
    faulty: u64,
    inconclusive: u64,
    no_trace: u64,
    not_judged: u64,
    wrong: u64,
}

impl Row {
    fn add(&mut self, report: &ExcerptReport) {
        self.acted += 1;
        match (report.verdict, report.fairness()) {
            (Verdict::Faulty, _) => self.faulty += 1,
            (Verdict::Inconclusive, _) => self.inconclusive += 1,
            (Verdict::Healthy, Fairness::NoTrace | Fairness::Right) => self.no_trace += 1,
            (Verdict::Healthy, Fairness::NotJudged) => self.not_judged += 1,
            (Verdict::Healthy, Fairness::Wrong) => self.wrong += 1,
        }
    }

    fn cells(&self) -> [String; 6] {
        let all = [
            self.acted,
            self.faulty,
            self.inconclusive,
            self.no_trace,
            self.not_judged,
            self.wrong,
        ];
        all.map(|number| number.to_string())
    }
}

/// Plays, cuts and judges on all processors; the sum is the same for any number of them.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let options = ExcerptOptions { healthy: arguments.healthy, fault: arguments.fault };
    if let Some(path) = &arguments.record {
        record(path, arguments.seeds.start, &options, arguments.whole)?;
        return Ok(Status::Good);
    }
    let mut rows: BTreeMap<FaultName, Row> = BTreeMap::new();
    let mut all = Row::default();
    let (mut quiet, mut quiet_faulty, mut quiet_healthy) = (0_u64, 0_u64, 0_u64);
    let mut progress = Progress::new();
    let total = arguments.seeds.end - arguments.seeds.start;
    let mut done = 0;
    on_all_processors(
        arguments.seeds.clone(),
        |seed| run_excerpt(seed, &options),
        |report| {
            done += 1;
            progress.show(|| format!("{done} of {}", count(total, "seed")));
            let Some(report) = report else { return };
            if report.has_acted() {
                all.add(&report);
                for fault in report.faults.iter().filter(|fault| fault.acted) {
                    rows.entry(fault.name).or_default().add(&report);
                }
            } else {
                quiet += 1;
                quiet_faulty += u64::from(report.verdict == Verdict::Faulty);
                quiet_healthy += u64::from(report.verdict == Verdict::Healthy);
            }
            if arguments.list {
                list(&report, output);
            }
        },
    );
    progress.clear();
    let (from, to) = (arguments.seeds.start, arguments.seeds.end);
    output.line(&format!("Seeds {from}..{to}."));
    if all.acted > 0 {
        let headings =
            ["fault in the excerpt", "of", "faulty", "open", "no trace", "not judged", "wrong"];
        let mut table = Table::new(&headings, output.paint());
        for (name, row) in &rows {
            table.row([name.name().to_owned()].into_iter().chain(row.cells()));
        }
        table.row(["all excerpts".to_owned()].into_iter().chain(all.cells()));
        output.text(&format!("\n{}", table.render()));
        output.line(
            "\nopen: inconclusive. no trace, not judged, wrong: called healthy; the frames hold no trace of the \
             fault and its kind was judged, or was not, as the coverage says; or the frames hold a trace.",
        );
    }
    if quiet > 0 {
        output.line(&format!(
            "\nNothing acted: {}, {quiet_healthy} healthy, {} inconclusive, {quiet_faulty} faulty.",
            count(quiet, "excerpt"),
            quiet - quiet_healthy - quiet_faulty
        ));
    }
    let alarms = if arguments.healthy { quiet_faulty } else { 0 };
    Ok(if all.wrong + alarms == 0 { Status::Good } else { Status::Findings })
}

/// Writes the excerpt of a seed to a file.
fn record(path: &Path, seed: u64, options: &ExcerptOptions, whole: bool) -> Result<(), Failure> {
    let frames = excerpt_frames(seed, options, whole);
    let mut writer = PcapWriter::new(Vec::new(), LinkType::Ethernet, false)
        .map_err(|error| files::in_file(path, &error))?;
    for (at, bytes, len) in &frames {
        let time = UnixTime::EPOCH + at.since(Instant::ZERO);
        let whole = u32::try_from(*len).ok();
        let frame = FrameToWrite {
            original_len: whole,
            ..FrameToWrite::new(CaptureInterfaceId(0), time, FrameDirection::Unknown, bytes)
        };
        writer.write_frame(&frame).map_err(|error| files::in_file(path, &error))?;
    }
    let bytes = writer.finish().map_err(|error| files::in_file(path, &error))?;
    files::write_new_bytes(path, "the excerpt", &bytes)
}

fn list(report: &ExcerptReport, output: &mut Output) {
    let is_alarm = !report.has_acted() && report.verdict == Verdict::Faulty;
    let is_healthy = report.has_acted() && report.verdict == Verdict::Healthy;
    if !is_alarm && !is_healthy {
        return;
    }
    let faults: Vec<String> = report
        .faults
        .iter()
        .map(|fault| {
            let acted = if fault.acted { "acted" } else { "did not act" };
            format!("{} {acted}, {:?}", fault.name, fault.extent)
        })
        .collect();
    output.line(&format!(
        "{} {:?} {:?}: {} of {}; {}; traces {:?}; said {:?}",
        report.seed,
        report.verdict,
        report.fairness(),
        report.cut,
        count(report.frames, "frame"),
        faults.join("; "),
        report.traces,
        report.findings
    ));
}
