//! The capture as a whole: recording, MainDevice, network, states, counters, commands, what is not known.

use linesman_capture::network::report::ReferenceClockReport;
use linesman_capture::network::states::{StateEvent, StateEventReport, code_name};
use linesman_diagnosis::report::Number;

use super::{CaptureWriter, numbers};
use crate::output::{Table, wrapped};
use crate::text::main_device;
use crate::text::quantity::{count, date, grouped, time};

impl CaptureWriter<'_> {
    /// The recording and the network in a few lines.
    pub(super) fn head(&self) -> String {
        let (report, recording) = (self.report, &self.report.recording);
        let source = report.source.strip_prefix("capture:").unwrap_or(&report.source);
        let mut text = format!("{}\n", self.paint.bold(source));
        let mut add = |name: &str, words: &str| {
            let head = format!("{}{}", self.paint.faint(name), " ".repeat(11 - name.len()));
            text.push_str(&wrapped(&head, words, self.width));
        };
        let mut recorded = format!(
            "{} in {}",
            count(recording.frames.0, "EtherCAT frame"),
            time(recording.lasts_ns.0)
        );
        if let Some(start) = &report.start {
            recorded.push_str(&format!(", from {}", date(start)));
        }
        add("recorded", &recorded);
        add("ways", &self.ways());
        for words in report.main_device.iter().flat_map(main_device::sentences) {
            add("MainDevice", &words);
        }
        add("network", &self.network());
        if let Some(clock) = &report.network.reference_clock {
            add("clock", &self.clock(clock));
        }
        let timing = &report.timing;
        // Coarse time stamps say nothing of it.
        if let Some(response) = timing.response.filter(|response| response.max_ns.0 > 0) {
            add(
                "response",
                &format!(
                    "{} to {}, half within {}{}",
                    time(response.min_ns.0),
                    time(response.max_ns.0),
                    time(response.median_ns.0),
                    some(timing.late, ", late: ")
                ),
            );
        }
        let load = timing.load_percent.map(|load| format!("{load} % of 100 Mbit/s"));
        let gaps = some(Number(timing.gaps.len() as u64), "pauses without frames: ");
        let load: Vec<String> =
            load.into_iter().chain(Some(gaps)).filter(|it| !it.is_empty()).collect();
        if !load.is_empty() {
            add("load", &load.join(", "));
        }
        text
    }

    fn ways(&self) -> String {
        let recording = &self.report.recording;
        let mut words = match recording.ways.as_deref() {
            Some("both") => format!(
                "{} sent, {} came back",
                grouped(recording.requests.0),
                grouped(recording.returns.0)
            ),
            Some("requests") => {
                format!("{} sent, no return recorded", grouped(recording.requests.0))
            }
            Some(_) => format!("{} came back, no request recorded", grouped(recording.returns.0)),
            None => "nothing that could be paired".to_owned(),
        };
        for (number, name) in [
            (recording.lost, ", lost: "),
            (recording.returns_alone, ", without their request: "),
            (recording.damaged, ", damaged: "),
            (recording.cut, ", not recorded to their end: "),
            (recording.foreign, ", of other kinds: "),
        ] {
            words.push_str(&some(number, name));
        }
        if recording.began_in_run {
            words.push_str("; it began while process data were exchanged");
        }
        words
    }

    fn network(&self) -> String {
        let network = &self.report.network;
        let mut words = count(network.devices.0, "SubDevice");
        if let Some(mailboxes) = &network.mailboxes {
            let how = match mailboxes.by.as_str() {
                "status-bits" => "by the working counter of their status bits",
                "sync-managers" => "by their SyncManagers",
                _ => "by their messages",
            };
            let plural = if mailboxes.count == 1 { "" } else { "es" };
            words.push_str(&format!(", {} mailbox{plural} ({how})", mailboxes.count));
        }
        if let Some(state) = &network.al_state_highest {
            words.push_str(&format!(", highest state {state}"));
        }
        words
    }

    fn clock(&self, clock: &ReferenceClockReport) -> String {
        let whom = match (clock.no, clock.position_no) {
            (Some(no), _) => self.names.device(no),
            (None, _) => self.whom(None, clock.station, clock.position_no),
        };
        let drift = clock.ppm.map_or_else(String::new, |ppm| {
            format!(", {ppm:+} ppm against the clock of the capture")
        });
        if clock.takes_part == 0 {
            return format!(
                "{whom} is asked for the system time ({}) and does not answer",
                clock.command
            );
        }
        format!(
            "{whom} is the reference clock ({}, working counter {}{drift})",
            clock.command, clock.takes_part
        )
    }

    /// States that were asked for and read.
    pub(super) fn states(&self) -> String {
        let states = &self.report.states;
        if states.is_empty() {
            return String::new();
        }
        let (shown, more) = self.shown(states.len(), "state changes");
        let mut table =
            Table::new(&["time", "frame", "SubDevice", "what", "state", "note"], self.paint);
        for one in &states[..shown] {
            table.row([
                time(one.at_ns.0),
                one.frame.0.to_string(),
                self.whom(one.no, one.station, one.position_no),
                word(one.what).to_owned(),
                one.state.clone().unwrap_or_else(|| format!("0x{:04X}", one.value)),
                note(one),
            ]);
        }
        self.section("States", &(table.render() + &more))
    }

    /// Error counters that moved or stand above 0.
    pub(super) fn counters(&self) -> String {
        let all = &self.report.counters;
        if all.is_empty() {
            return String::new();
        }
        let headings = ["SubDevice", "read", "cleared", "counter", "first", "last", "rose"];
        let mut table = Table::new(&headings, self.paint);
        let mut quiet = Vec::new();
        for device in all {
            let told =
                device.counters.iter().filter(|one| one.first.0 + one.last.0 + one.rose.0 > 0);
            let mut is_first = true;
            for one in told {
                let port =
                    one.port.as_ref().map_or_else(String::new, |port| format!(", port {port}"));
                let lead = |text: String| if is_first { text } else { String::new() };
                let row = [
                    lead(self.names.device(device.no)),
                    lead(device.readings.0.to_string()),
                    lead(device.cleared.0.to_string()),
                    format!("{}{port}", one.name),
                    one.first.0.to_string(),
                    one.last.0.to_string(),
                    one.rose.0.to_string(),
                ];
                table.row(row);
                is_first = false;
            }
            if is_first {
                quiet.push(device.no);
            }
        }
        let mut body = if quiet.len() < all.len() { table.render() } else { String::new() };
        if !quiet.is_empty() {
            let read: u64 = all.iter().map(|one| one.readings.0).max().unwrap_or(0);
            let cleared: u64 = all.iter().map(|one| one.cleared.0).max().unwrap_or(0);
            body.push_str(&format!(
                "0 at SubDevice {}: read up to {} and cleared up to {}\n",
                numbers(&quiet),
                count(read, "time"),
                count(cleared, "time")
            ));
        }
        self.section("Error counters", &body)
    }

    /// Datagrams by command.
    pub(super) fn commands(&self) -> String {
        let headings = ["command", "recorded", "came back", "working counter 0", "lost"];
        let mut table = Table::new(&headings, self.paint);
        for one in &self.report.commands {
            let numbers = [one.recorded, one.returned, one.unanswered, one.lost];
            let cells = numbers.map(|number| grouped(number.0));
            table.row(std::iter::once(one.command.clone()).chain(cells));
        }
        self.section("Datagrams", &table.render())
    }

    /// Facts that the frames do not show.
    pub(super) fn unknown(&self) -> String {
        let mut body = String::new();
        for one in &self.report.unknown {
            let whom = match one.devices.as_slice() {
                [] => String::new(),
                devices => format!(" of SubDevice {}", numbers(devices)),
            };
            body.push_str(&wrapped("- ", &format!("{}{whom}: {}", one.what, one.why), self.width));
        }
        self.section("Not known", &body)
    }
}

fn some(number: Number, name: &str) -> String {
    if number.0 == 0 { String::new() } else { format!("{name}{}", grouped(number.0)) }
}

const fn word(what: StateEvent) -> &'static str {
    match what {
        StateEvent::Asked => "asked",
        StateEvent::Read => "read",
        StateEvent::Code => "code",
    }
}

fn note(one: &StateEventReport) -> String {
    match (one.what, one.wkc, one.error) {
        (StateEvent::Asked, None, _) => "did not come back".to_owned(),
        (StateEvent::Asked, Some(0), _) => "nobody has taken it".to_owned(),
        (StateEvent::Asked, Some(_), true) => "acknowledges an error".to_owned(),
        (StateEvent::Read, _, true) => "error".to_owned(),
        (StateEvent::Code, _, _) => code_name(one.value).to_owned(),
        (StateEvent::Asked | StateEvent::Read, _, false) => String::new(),
    }
}
