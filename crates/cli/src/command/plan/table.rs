//! A plan as text: the tables that engineers know from their tools (FRM-10).

use linesman_config::plan::{Doubt, Plan, Presence, Severity};
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::size::load_percent;
use linesman_proto::sii::Direction;
use linesman_runtime::plan_file::PlanFile;

use super::report::removable;
use super::report::{bits, counter, shares, unit_of};
use crate::output::{Output, Table, wrapped};
use crate::text::quantity::count;

pub(super) fn text(file: &PlanFile, doubts: &[Doubt], verbose: bool, output: &Output) -> String {
    let plan = &file.plan;
    let paint = output.paint();
    let mut text = String::new();
    let title = if file.name.is_empty() { "Plan" } else { &file.name };
    text.push_str(&format!(
        "{}: {}, {} of outputs, {} of inputs\n\n",
        paint.bold(title),
        count(plan.devices.len() as u64, "SubDevice"),
        count(plan.outputs_len as u64, "byte"),
        count(plan.inputs_len as u64, "byte")
    ));
    text.push_str(&frames(plan, output));
    text.push_str(&format!(
        "\nCyclic frames take {:.2} % of the wire's time.\n",
        plan.load_percent()
    ));
    if verbose {
        text.push('\n');
        text.push_str(&devices(plan, output));
    }
    text.push_str(&ebus(plan, output));
    text.push_str(&clocks(plan, output));
    text.push_str(&groups(plan, output));
    text.push_str(&cables(plan, output));
    for doubt in doubts {
        let label = match doubt.severity {
            Severity::Error => paint.bad("error"),
            Severity::Warning => paint.warning("warning"),
            Severity::Info => paint.faint("info"),
        };
        text.push('\n');
        text.push_str(&wrapped(&format!("{label}: "), &doubt.text, output.width()));
        text.push_str(&wrapped("  do: ", &doubt.advice, output.width()));
    }
    for note in &file.notes {
        text.push('\n');
        text.push_str(&wrapped("note: ", note, output.width()));
    }
    text
}

fn frames(plan: &Plan, output: &Output) -> String {
    let headings = [
        "Frame",
        "Cmd",
        "Addr",
        "Len",
        "WC",
        "Sync unit",
        "Cycle (ms)",
        "Utilization (%)",
        "Size / duration (µs)",
    ];
    let mut table = Table::new(&headings, output.paint());
    let present = Presence::full(plan.devices.len());
    let mut number = 0_usize;
    for task in &plan.tasks {
        for frame in &task.frames {
            let last = frame.datagrams.len().saturating_sub(1);
            let copies = u32::from(frame.repeats) + 1;
            for (at, datagram) in frame.datagrams.iter().enumerate() {
                let address = match datagram.address {
                    DatagramAddress::Logical(logical) => format!("0x{:08X}", logical.0),
                    DatagramAddress::Physical(address, register) => {
                        format!("0x{address:04X} 0x{:04X}", register.0)
                    }
                };
                let unit = datagram.sync_unit.and_then(|unit| task.sync_units.get(unit));
                let judged = datagram.role.is_judged();
                let wkc = judged.then(|| counter(datagram, plan, &present).to_string());
                let (mut load, mut size) = (String::new(), String::new());
                if at == last {
                    let share = load_percent(frame.size(), task.cycle) * f64::from(copies);
                    load = format!("{share:.2}");
                    let times = if copies > 1 { format!("{copies} * ") } else { String::new() };
                    let wire = frame.wire_time().as_nanos() as f64 / 1e3;
                    size = format!("{times}{} / {wire:.2}", frame.size());
                    if frame.ahead.as_nanos() > 0 {
                        let ahead = frame.ahead.as_nanos() as f64 / 1e3;
                        size.push_str(&format!(", {ahead:.0} µs ahead"));
                    }
                }
                table.row([
                    number.to_string(),
                    datagram.command.name().to_owned(),
                    address,
                    datagram.len.to_string(),
                    wkc.unwrap_or_default(),
                    unit.map(|unit| unit.name.clone()).unwrap_or_default(),
                    format!("{:.3}", task.cycle.as_nanos() as f64 / 1e6),
                    load,
                    size,
                ]);
            }
            number += 1;
        }
    }
    table.render()
}

fn devices(plan: &Plan, output: &Output) -> String {
    let headings = ["No", "Addr", "Name", "Type", "Out", "In", "Task", "Sync unit", "adds to WC"];
    let mut table = Table::new(&headings, output.paint());
    // As the tools write it: whole bytes, and bits behind a point.
    let size = |bits: u32| match (bits / 8, bits % 8) {
        (0, 0) => String::new(),
        (bytes, bits) => format!("{bytes}.{bits}"),
    };
    for device in &plan.devices {
        let unit = unit_of(device.id, plan);
        let shares = shares(device.id, plan).into_iter();
        let shares = shares.map(|(frame, at, adds)| format!("{frame}/{at}: {adds}"));
        table.row([
            device.id.no().to_string(),
            device.station.0.to_string(),
            device.name.clone(),
            device.type_name.clone(),
            size(bits(device, Direction::Outputs)),
            size(bits(device, Direction::Inputs)),
            unit.map(|(task, _)| task.name.clone()).unwrap_or_default(),
            unit.map(|(_, name)| name.to_owned()).unwrap_or_default(),
            shares.collect::<Vec<_>>().join(", "),
        ]);
    }
    table.render()
}

fn ebus(plan: &Plan, output: &Output) -> String {
    let paint = output.paint();
    let mut text = String::new();
    for group in plan.ebus_groups() {
        let headings = ["Number", "Name", "Address", "Type", "E-bus (mA)", "left"];
        let mut table = Table::new(&headings, paint);
        let feeder = std::iter::once((group.feeder, -group.supply_ma, group.supply_ma));
        let members =
            group.members.iter().map(|one| (one.device, one.current_ma, one.remaining_ma));
        for (id, current, left) in feeder.chain(members) {
            let Some(device) = plan.device(id) else { continue };
            table.row([
                id.no().to_string(),
                device.name.clone(),
                format!("0x{:04X}", device.station.0),
                device.type_name.clone(),
                current.to_string(),
                if left < 0 { paint.bad(&format!("{left} !")) } else { left.to_string() },
            ]);
        }
        text.push('\n');
        text.push_str(&table.render());
    }
    text
}

fn clocks(plan: &Plan, output: &Output) -> String {
    let Some(reference) = plan.reference_clock().and_then(|id| plan.device(id)) else {
        return String::new();
    };
    let headings =
        ["No", "Clock of", "Activation", "SYNC0 (ms)", "after frames (µs)", "SYNC1 (ms)"];
    let mut table = Table::new(&headings, output.paint());
    for device in &plan.devices {
        let Some(clock) = &device.settings.clock else { continue };
        let ms = |ns: u64| format!("{:.3}", ns as f64 / 1e6);
        table.row([
            device.id.no().to_string(),
            device.name.clone(),
            format!("0x{:04X}", clock.assign_activate),
            ms(clock.sync0_cycle.as_nanos()),
            format!("{:.1}", plan.sync0_shift_ns(device) as f64 / 1e3),
            if clock.sync1() { ms(clock.sync1_cycle.as_nanos()) } else { String::new() },
        ]);
    }
    format!(
        "\nReference clock: {} ({}). The line delays outputs by {:.1} µs at least.\n{}",
        reference.id.no(),
        reference.name,
        plan.least_delay().as_nanos() as f64 / 1e3,
        table.render()
    )
}

fn groups(plan: &Plan, output: &Output) -> String {
    if plan.groups.is_empty() {
        return String::new();
    }
    let headings = [
        "Hot connect group",
        "First",
        "SubDevices",
        "Known by",
        "Number",
        "Places",
        "May be absent",
    ];
    let mut table = Table::new(&headings, output.paint());
    for group in &plan.groups {
        let first = plan.device(group.first());
        let check = first.and_then(|device| device.settings.identification);
        let places = group.places.iter().map(|place| removable::written(plan, *place));
        let places: Vec<String> = places.collect();
        table.row([
            group.name.clone(),
            first.map(|device| device.name.clone()).unwrap_or_default(),
            group.members.len().to_string(),
            check.map(|check| check.source.to_string()).unwrap_or_default(),
            check.map(|check| check.value.to_string()).unwrap_or_default(),
            if places.is_empty() { "any free port".to_owned() } else { places.join(", ") },
            if group.optional { "yes".to_owned() } else { "no".to_owned() },
        ]);
    }
    format!("\n{}", table.render())
}

/// The cables of a ring: those that may break, and those whose break costs SubDevices (RED-08, RED-09).
fn cables(plan: &Plan, output: &Output) -> String {
    if plan.tree.closes_at().is_none() {
        return String::new();
    }
    let paint = output.paint();
    let mut table = Table::new(&["Cable", "", "may break", "lost with it"], paint);
    for cable in plan.cables() {
        let names = cable.lost.iter().filter_map(|id| plan.device(*id));
        let lost: Vec<&str> = names.map(|device| device.name.as_str()).collect();
        table.row([
            removable::written(plan, cable.link.upstream),
            removable::written(plan, cable.link.downstream),
            if cable.may_break { paint.good("yes") } else { paint.bad("no") },
            lost.join(", "),
        ]);
    }
    format!("\n{}", table.render())
}
