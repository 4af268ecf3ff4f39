//! One SubDevice with all that is known of it.

use linesman_runtime::online::report::{
    Count, OnlineDevice, OnlineIdentity, OnlineInfo, OnlineReport,
};

use linesman_config::inventory::label;
use linesman_proto::address::DeviceId;

use crate::command::service::{self, DeviceNames};
use crate::failure::Failure;
use crate::output::{Output, Table};
use crate::text::quantity::{count, time};

/// The SubDevice that a word means, as in the commands for one of them.
pub(super) fn find<'a>(report: &'a OnlineReport, word: &str) -> Result<&'a OnlineDevice, Failure> {
    let called = |device: &'a OnlineDevice| {
        Some(DeviceNames {
            id: DeviceId::from_no(device.no)?,
            station: device.station,
            alias: 0,
            name: &device.name,
            type_name: &device.r#type,
        })
    };
    let all: Vec<DeviceNames<'_>> = report.devices.iter().filter_map(called).collect();
    let id = service::find(&all, &report.on, word)?;
    let found = report.devices.iter().find(|device| device.no == id.no());
    found.ok_or_else(|| Failure::new(format!("{}: `{word}` is not there", report.on), ""))
}

/// All that is known of it.
pub(super) fn text(report: &OnlineReport, device: &OnlineDevice, output: &Output) -> String {
    let paint = output.paint();
    let called = label(DeviceId(device.no.saturating_sub(1)), &device.name, &device.r#type);
    let title = format!("{called}, 0x{:04X}", device.station);
    let mut text = format!("{} on {}: {}\n", paint.bold(&title), report.on, device.state.text);
    if let Some(meaning) = &device.al_code_text {
        text.push_str(&format!("  AL status code 0x{:04X}: {meaning}\n", device.al_code));
    }
    if let Some(target) = &device.target {
        text.push_str(&format!("  driven to {target}\n"));
    }
    let who = |what: &str, identity: Option<OnlineIdentity>| {
        identity.map(|one| {
            format!(
                "  {what}: vendor 0x{:08X}, product 0x{:08X}, revision 0x{:08X}, serial {}\n",
                one.vendor_id, one.product_code, one.revision, one.serial
            )
        })
    };
    text.extend(who("planned", device.planned));
    text.extend(who("found", device.found));
    if let Some(wrong) = device.wc_state {
        let is = if wrong { "wrong" } else { "right" };
        let age = device.age_ns.map(|age| format!(", inputs {} old", time(age)));
        text.push_str(&format!("  working counter {is}{}\n", age.unwrap_or_default()));
    }
    text.push_str(&device.info.as_ref().map(info).unwrap_or_default());
    text.push('\n');
    text.push_str(&ports(device, output));
    for (what, counter) in
        [("processing unit errors", device.processing_unit), ("PDI errors", device.pdi)]
    {
        if let Some(counter) = counter {
            text.push_str(&format!("  {what}: {}\n", cell(Some(counter))));
        }
    }
    text.push_str(&format!(
        "  left its state by itself {}; absent {}\n",
        times(device.abnormal_changes),
        times(device.presence_changes.saturating_sub(1))
    ));
    for change in &device.history {
        let code = change.al_code_text.as_ref();
        let code = code.map(|text| format!(", 0x{:04X} {text}", change.al_code));
        let (at, from, to) = (time(change.at_ns), &change.from, &change.to);
        text.push_str(&format!("    {at}: {from} to {to}{}\n", code.unwrap_or_default()));
    }
    if let Some(mailbox) = &device.mailbox {
        let how = if mailbox.mapped { "its bit is read in the cycle" } else { "polled" };
        text.push_str(&format!(
            "  mailbox: {} bytes out, {} bytes in, {how}; {} so far\n",
            mailbox.out_size,
            mailbox.in_size,
            count(mailbox.errors, "error")
        ));
        for trouble in &mailbox.standing {
            text.push_str(&format!("    {}: {}\n", trouble.protocol, trouble.text));
        }
    }
    text
}

/// What programs need of it.
fn info(of: &OnlineInfo) -> String {
    let channels = of.channels.iter().map(u8::to_string).collect::<Vec<_>>();
    let lines = [
        of.ads_address.as_ref().map(|address| format!("ADS address {address}")),
        of.aoe_net_id.as_ref().map(|net_id| format!("NetId for AoE {net_id}")),
        (!channels.is_empty()).then(|| format!("drive channels {}", channels.join(", "))),
        of.output_shift_ns.map(|shift| {
            format!("outputs take effect {} after the cycle begins (SYNC0)", time(shift))
        }),
        of.input_shift_ns.map(|shift| {
            format!("inputs are taken {} before the cycle that fetches them (SYNC0)", time(shift))
        }),
        of.object.map(|object| format!("object 0x{object:04X} of the MainDevice")),
    ];
    lines.into_iter().flatten().map(|line| format!("  {line}\n")).collect()
}

fn times(number: u64) -> String {
    count(number, "time")
}

/// `3 (register 7)`.
fn cell(counter: Option<Count>) -> String {
    counter.map_or_else(
        || "--".to_owned(),
        |counter| format!("{} (register {})", counter.total, counter.register),
    )
}

fn ports(device: &OnlineDevice, output: &Output) -> String {
    let headings =
        ["  port", "link", "to", "invalid frames", "physical layer", "forwarded", "lost links"];
    let mut table = Table::new(&headings, output.paint());
    for port in &device.ports {
        let link = match (port.link, port.communication) {
            (None, _) => "?",
            (Some(_), Some(true)) => "open",
            (Some(true), _) => "signal, closed",
            (Some(false), _) => "none",
        };
        let to = port.to.as_ref();
        table.row([
            format!("  {}", port.port),
            link.to_owned(),
            to.map(|to| format!("{} port {}", to.no, to.port)).unwrap_or_default(),
            cell(port.invalid_frames),
            cell(port.physical_layer),
            cell(port.forwarded),
            cell(port.lost_links),
        ]);
    }
    table.render()
}
