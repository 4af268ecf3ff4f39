//! Frames with process data: datagrams, working counters, cycles; the process image and who owns its bytes.

use linesman_capture::network::cyclic::{CyclicDatagramReport, CyclicFrameReport};
use linesman_capture::network::image::ImagePartReport;
use linesman_capture::network::pdos::PdoSource;
use linesman_capture::timing::durations::BarReport;
use linesman_proto::mailbox::coe::ObjectAddress;

use super::{CaptureWriter, numbers};
use crate::output::Table;
use crate::text::quantity::{grouped, time};

/// Most kinds of frames that are listed: those that came oftenest.
const MOST_FRAMES: usize = 12;
/// Longest bar of a histogram.
const BAR: u64 = 40;

impl CaptureWriter<'_> {
    /// A row for each datagram of a frame that carries process data or the system time.
    pub(super) fn frames(&self) -> String {
        let mut frames: Vec<&CyclicFrameReport> = self.report.cyclic.iter().collect();
        if frames.is_empty() {
            return String::new();
        }
        let left = if self.is_whole { 0 } else { frames.len().saturating_sub(MOST_FRAMES) };
        if left > 0 {
            frames.sort_by_key(|frame| std::cmp::Reverse(frame.count));
            frames.truncate(MOST_FRAMES);
            frames.sort_by_key(|frame| frame.frame);
        }
        let headings = [
            "frame", "task", "cycle", "count", "bytes", "load", "command", "address", "len", "WKC",
            "misses", "owners",
        ];
        let mut table = Table::new(&headings, self.paint);
        for frame in frames {
            for (index, datagram) in frame.datagrams.iter().enumerate() {
                let lead = if index == 0 { lead(frame) } else { Default::default() };
                table.row(lead.into_iter().chain(self.datagram(datagram)));
            }
        }
        let mut body = table.render();
        for task in &self.report.tasks {
            body.push_str(&format!(
                "task {}: cycle {}, load {} %\n",
                task.task,
                time(task.cycle_ns.0),
                task.load_percent
            ));
        }
        if left > 0 {
            let more = format!("and {left} more kinds of frames that came less often: --all");
            body.push_str(&(self.paint.faint(&more) + "\n"));
        }
        self.section("Frames with process data", &body)
    }

    fn datagram(&self, datagram: &CyclicDatagramReport) -> [String; 6] {
        let misses: u64 = datagram.misses.iter().map(|miss| miss.count.0).sum();
        [
            datagram.command.clone(),
            self.address(datagram),
            datagram.len.to_string(),
            datagram.expected.map_or_else(|| "?".to_owned(), |wkc| wkc.to_string()),
            if misses > 0 { self.paint.bad(&grouped(misses)) } else { String::new() },
            numbers(&datagram.owners),
        ]
    }

    fn address(&self, datagram: &CyclicDatagramReport) -> String {
        match (datagram.logical, datagram.address) {
            (Some(logical), _) => format!("0x{logical:08X}"),
            (None, Some(address)) => {
                let whom = match (datagram.station, datagram.position_no) {
                    (Some(station), _) => format!("0x{station:04X}:"),
                    (None, Some(position)) => format!("position {position}:"),
                    (None, None) => String::new(),
                };
                format!("{whom}0x{address:04X}")
            }
            (None, None) => String::new(),
        }
    }

    /// Deviations from the cycle, frame by frame.
    pub(super) fn jitter(&self) -> String {
        let mut body = String::new();
        for frame in self.report.cyclic.iter().filter(|frame| frame.task.is_some()) {
            let (Some(cycle), Some(intervals)) = (frame.cycle_ns, frame.intervals) else {
                continue;
            };
            if frame.jitter.is_empty() || intervals.count.0 < 16 {
                continue;
            }
            let response = frame.response.map_or_else(String::new, |response| {
                format!("; back after {} to {}", time(response.min_ns.0), time(response.max_ns.0))
            });
            body.push_str(&format!(
                "frame {}: {} ± {} to {}, off: {}, missing: {}, lost: {}{response}\n",
                frame.frame,
                time(cycle.0),
                time(cycle.0.saturating_sub(intervals.min_ns.0)),
                time(intervals.max_ns.0.saturating_sub(cycle.0)),
                grouped(frame.off.0),
                grouped(frame.missing.0),
                grouped(frame.lost.0),
            ));
            body.push_str(&histogram(&frame.jitter));
        }
        self.section("Cycle: deviation of intervals", &body)
    }

    /// Owners of the bytes.
    pub(super) fn image(&self) -> String {
        let headings = ["datagram", "byte.bit", "bits", "way", "SubDevice", "memory"];
        let mut table = Table::new(&headings, self.paint);
        let mut is_any = false;
        for datagram in &self.report.image {
            for part in &datagram.parts {
                is_any = true;
                table.row([
                    format!("{} 0x{:08X}", datagram.command, datagram.start),
                    format!("{}.{}", part.byte, part.bit),
                    part.bits.to_string(),
                    part.direction.clone(),
                    self.names.device(part.no),
                    memory(part),
                ]);
            }
        }
        if is_any { self.section("Process image", &table.render()) } else { String::new() }
    }

    /// Entries of PDOs in the process image.
    pub(super) fn entries(&self) -> String {
        let headings =
            ["datagram", "byte.bit", "bits", "SubDevice", "PDO", "entry", "name", "known by"];
        let mut table = Table::new(&headings, self.paint);
        let parts = self
            .report
            .image
            .iter()
            .flat_map(|datagram| datagram.parts.iter().map(move |part| (datagram, part)));
        let all: Vec<_> = parts
            .flat_map(|(datagram, part)| {
                part.entries.iter().map(move |entry| (datagram, part, entry))
            })
            .collect();
        let (shown, more) = self.shown(all.len(), "entries");
        for (datagram, part, entry) in all.iter().take(shown) {
            let pdo_name = entry.pdo_name.as_deref().unwrap_or_default();
            table.row([
                format!("{} 0x{:08X}", datagram.command, datagram.start),
                format!("{}.{}", entry.byte, entry.bit),
                entry.bits.to_string(),
                self.names.device(part.no),
                format!("0x{:04X} {pdo_name}", entry.pdo).trim_end().to_owned(),
                ObjectAddress::new(entry.index, entry.subindex).to_string(),
                entry.name.clone().unwrap_or_default(),
                part.entries_by.map_or("", source).to_owned(),
            ]);
        }
        match all.is_empty() {
            true => String::new(),
            false => self.section("Process data", &(table.render() + &more)),
        }
    }
}

/// Source of names, in the words of the set-up.
const fn source(by: PdoSource) -> &'static str {
    match by {
        PdoSource::Coe => "CoE",
        PdoSource::Sii => "SII",
        PdoSource::Esi => "ESI",
    }
}

fn lead(frame: &CyclicFrameReport) -> [String; 6] {
    [
        frame.frame.to_string(),
        frame.task.map_or_else(String::new, |task| task.to_string()),
        frame.cycle_ns.map_or_else(String::new, |cycle| time(cycle.0)),
        grouped(frame.count.0),
        frame.bytes.to_string(),
        frame.load_percent.map_or_else(String::new, |load| format!("{load} %")),
    ]
}

fn memory(part: &ImagePartReport) -> String {
    let manager =
        part.sync_manager.map_or_else(String::new, |manager| format!(", SyncManager {manager}"));
    format!("0x{:04X}{manager}", part.physical)
}

/// A line for each bar.
fn histogram(bars: &[BarReport]) -> String {
    let most = bars.iter().map(|bar| bar.count.0).max().unwrap_or(1).max(1);
    let line = |bar: &BarReport| {
        let to = bar.to_ns.map_or_else(|| "and more".to_owned(), |to| format!("to {}", time(to.0)));
        let len = (bar.count.0 * BAR).div_ceil(most) as usize;
        let from = time(bar.from_ns.0);
        format!("  {from:>10} {to:<14} {:>9} {}\n", grouped(bar.count.0), "█".repeat(len))
    };
    bars.iter().map(line).collect()
}
