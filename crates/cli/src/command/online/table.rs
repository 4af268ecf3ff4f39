//! All SubDevices and frames as a table.

use linesman_proto::state::NetworkState;
use linesman_runtime::online::report::{
    Count, FrameCounts, OnlineDevice, OnlineGroup, OnlinePort, OnlineReport,
};

use crate::command::run::{ads, ethernet, gateway};
use crate::output::{Output, Paint, Table};
use crate::text::group::group_time;
use crate::text::quantity::{count, grouped, time};

/// The table; with an earlier report it tells what has changed since.
pub(super) fn text(report: &OnlineReport, last: Option<&OnlineReport>, output: &Output) -> String {
    let paint = output.paint();
    let planned = count(u64::from(report.planned), "SubDevice");
    let state = match (report.driven, report.state.word) {
        (false, _) => "nobody drives it".to_owned(),
        (true, 0) => paint.good(&report.state.text),
        (true, _) => paint.bad(&report.state.text),
    };
    let mut text = format!(
        "{} at {}: {state}; {} of {planned} there\n\n",
        paint.bold(&report.on),
        time(report.time_ns),
        report.present
    );
    text.push_str(&devices(report, last, paint));
    text.push('\n');
    text.push_str(&groups(report));
    text.push_str(&frames(report));
    if let Some(frames) = &report.ethernet {
        text.push_str(&ethernet::summary(frames));
    }
    if let Some(messages) = &report.gateway {
        text.push_str(&gateway::summary(messages));
    }
    if let Some(messages) = &report.ads {
        text.push_str(&ads::summary(messages));
    }
    text.push_str(&log(report));
    text
}

/// How many of the latest changes are shown.
const LATEST: usize = 8;

/// Who left a state by itself and when, the latest last.
fn log(report: &OnlineReport) -> String {
    let mut all: Vec<_> = (report.devices.iter())
        .flat_map(|device| device.history.iter().map(move |change| (change, device)))
        .collect();
    all.sort_by_key(|(change, device)| (change.at_ns, device.no));
    let mut text = if all.is_empty() { String::new() } else { "\nLatest:\n".to_owned() };
    for (change, device) in all.split_off(all.len().saturating_sub(LATEST)) {
        let code = change.al_code_text.as_ref();
        let code = code.map(|text| format!(", 0x{:04X} {text}", change.al_code));
        let (at, no, name) = (time(change.at_ns), device.no, &device.name);
        let (from, to) = (&change.from, &change.to);
        text.push_str(&format!(
            "  {at}: {no} {name}, {from} to {to}{}\n",
            code.unwrap_or_default()
        ));
    }
    text
}

fn devices(report: &OnlineReport, last: Option<&OnlineReport>, paint: Paint) -> String {
    let mut headings = vec!["no", "name", "type", "station", "state"];
    if report.driven {
        headings.push("WC");
    }
    // A column that nobody needs is left out.
    let clocked = report.devices.iter().any(|device| device.clock_difference_ns.is_some());
    if clocked {
        headings.push("clock off");
    }
    headings.extend(["errors A/B/C/D", "forwarded", "lost links", "changes"]);
    if report.driven {
        headings.push("mailbox");
    }
    let mut table = Table::new(&headings, paint);
    for device in &report.devices {
        let old = last.and_then(|last| last.devices.iter().find(|old| old.no == device.no));
        let mut row = vec![
            device.no.to_string(),
            device.name.clone(),
            device.r#type.clone(),
            format!("0x{:04X}", device.station),
            state(device, paint),
        ];
        if report.driven {
            row.push(match device.wc_state {
                None => "-".to_owned(),
                Some(false) => "ok".to_owned(),
                Some(true) => paint.bad("wrong"),
            });
        }
        if clocked {
            row.push(clock(device, report, paint));
        }
        row.push(errors(device, old, paint));
        row.push(ports(device, |port| port.forwarded));
        row.push(ports(device, |port| port.lost_links));
        row.push(format!("{},{}", device.abnormal_changes, device.presence_changes));
        if report.driven {
            row.push(mailbox(device));
        }
        table.row(row);
    }
    table.render()
}

/// `35 ns`; of the reference clock, to whom the others are compared, `reference`.
fn clock(device: &OnlineDevice, report: &OnlineReport, paint: Paint) -> String {
    match device.clock_difference_ns.map(time) {
        Some(text) if device.clock_apart => paint.bad(&text),
        Some(text) => text,
        None if report.clock.is_some_and(|clock| clock.reference == device.no) => {
            "reference".to_owned()
        }
        None => "-".to_owned(),
    }
}

/// `OP`, `ERR SAFEOP (0x001B sync manager watchdog)`.
fn state(device: &OnlineDevice, paint: Paint) -> String {
    let mut text = device.state.text.clone();
    if let Some(meaning) = &device.al_code_text {
        text.push_str(&format!(" (0x{:04X} {meaning})", device.al_code));
    }
    // Anything but a state is trouble.
    if device.state.word & 0xFFF0 != 0 { paint.bad(&text) } else { text }
}

/// Frame and symbol errors at a port since the start.
fn at_port(port: &OnlinePort) -> Option<u64> {
    Some(port.invalid_frames?.total + port.physical_layer.map_or(0, |count| count.total))
}

/// `0/3 (+2)/0/0`; the sign behind says that more may have happened.
fn errors(device: &OnlineDevice, old: Option<&OnlineDevice>, paint: Paint) -> String {
    let one = |(place, port): (usize, &OnlinePort)| {
        let Some(now) = at_port(port) else { return "--".to_owned() };
        let before = old.and_then(|old| at_port(old.ports.get(place)?));
        match now.saturating_sub(before.unwrap_or(now)) {
            0 => grouped(now),
            rise => format!("{} (+{rise})", grouped(now)),
        }
    };
    let cells: Vec<String> = device.ports.iter().enumerate().map(one).collect();
    let mut text = cells.join("/");
    if device.errors_lower_bound {
        text.push_str(" or more");
    }
    if device.errors > 0 { paint.warning(&text) } else { text }
}

/// A counter of all ports; `--` where the SubDevice does not have it.
fn ports(device: &OnlineDevice, counter: impl Fn(&OnlinePort) -> Option<Count>) -> String {
    let one = |port| counter(port).map_or_else(|| "--".to_owned(), |count| grouped(count.total));
    device.ports.iter().map(one).collect::<Vec<_>>().join("/")
}

fn mailbox(device: &OnlineDevice) -> String {
    let Some(mailbox) = &device.mailbox else { return "-".to_owned() };
    let standing: Vec<&str> = mailbox.standing.iter().map(|one| one.protocol.as_str()).collect();
    match (mailbox.errors, standing.is_empty()) {
        (0, _) => "ok".to_owned(),
        (errors, true) => format!("ok, {} before", count(errors, "error")),
        (errors, false) => format!("{} failed, {}", standing.join(" and "), count(errors, "error")),
    }
}

/// `Hot connect group tool: joined at port 3.D; 2 of 2 SubDevices there.`
fn groups(report: &OnlineReport) -> String {
    let line = |group: &OnlineGroup| {
        let place = group.place.as_ref().map(|place| format!(" at port {place}"));
        let state = match (group.joined, group.present) {
            (true, _) => "joined",
            (false, 0) => "absent",
            (false, _) => "on its way",
        };
        let planned = count(group.devices.len() as u64, "SubDevice");
        let (name, present) = (&group.name, group.present);
        let place = place.unwrap_or_default();
        format!("Hot connect group {name}: {state}{place}; {present} of {planned} there.\n")
    };
    report.groups.iter().map(line).collect()
}

/// `Ring: 0 SubDevices counted in what card A receives, 9 in that of card B: it is whole.`
fn by_card(report: &OnlineReport, [of_a, of_b]: [u16; 2]) -> String {
    let is_open = report.state.word & NetworkState::REDUNDANCY_FRAME_MISSING != 0;
    let state = if is_open { "open" } else { "whole" };
    format!(
        "Ring: {} counted in what card A receives, {of_b} in that of card B: it is {state}.\n",
        count(of_a.into(), "SubDevice")
    )
}

fn frames(report: &OnlineReport) -> String {
    let sent = |name: &str, counts: &FrameCounts| {
        let rate = counts.per_second.map(|rate| format!(" ({rate:.0} a second)"));
        let (sent, lost) = (count(counts.sent, "frame"), grouped(counts.lost));
        format!("{name}: {sent} sent{}, {lost} lost.", rate.unwrap_or_default())
    };
    let mut parts = Vec::new();
    if report.driven {
        parts.push(sent("Cyclic", &report.cyclic));
    }
    parts.push(sent("Queued", &report.queued));
    let mut text = parts.join(" ");
    let odd = report.odd;
    let odd = [
        (odd.late, "late"),
        (odd.duplicate, "doubled"),
        (odd.truncated, "truncated"),
        (odd.stray, "stray"),
        (odd.foreign, "from others"),
    ];
    let told: Vec<String> = (odd.iter())
        .filter(|(number, _)| *number > 0)
        .map(|(number, what)| format!("{} {what}", grouped(*number)))
        .collect();
    if !told.is_empty() {
        text.push_str(&format!(" Of those that came back: {}.", told.join(", ")));
    }
    text.push('\n');
    if let Some(clock) = report.clock {
        let (off, reference) = (time(clock.ahead_ns.unsigned_abs()), clock.reference);
        let how = if clock.ahead_ns < 0 { "behind" } else { "ahead of" };
        text.push_str(&format!(
            "The network's time, that of {reference}, is {off} {how} the host's.\n"
        ));
    }
    if let Some(group) = &report.group {
        text.push_str(&format!("{}\n", group_time(group)));
    }
    if let Some(counts) = report.responding_by_card {
        text.push_str(&by_card(report, counts));
    }
    for card in &report.cards {
        let link = match card.carrier {
            Some(false) => "no link",
            Some(true) => "link",
            None => continue,
        };
        let (rx, tx) = (grouped(card.rx_errors), grouped(card.tx_errors));
        let path = &card.path;
        text.push_str(&format!("Card {path}: {link}, receive errors {rx}, send errors {tx}.\n"));
    }
    for frame in report.frames.iter().filter(|frame| frame.wc_state != 0 || frame.state != 0) {
        text.push_str(&format!(
            "Task {}, frame {}: not sent 0x{:04X}, wrong working counters 0x{:04X}.\n",
            frame.task, frame.frame, frame.state, frame.wc_state
        ));
    }
    let wrong: Vec<&str> = (report.sync_units.iter())
        .filter(|unit| unit.wc_state)
        .map(|unit| unit.name.as_str())
        .collect();
    let units = count(report.sync_units.len() as u64, "sync unit");
    match (report.sync_units.len(), wrong.is_empty()) {
        (0, _) => {}
        (_, true) => text.push_str(&format!("{units}, all working counters right.\n")),
        (_, false) => {
            text.push_str(&format!("{units}; wrong working counters in: {}.\n", wrong.join(", ")));
        }
    }
    text
}
