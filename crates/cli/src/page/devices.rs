//! Table of the SubDevices: identities, states, counters.

use linesman_diagnosis::model::{Device, NetworkModel};
use linesman_diagnosis::report::DeviceReport;
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use maud::{Markup, html};

use crate::text::devices::{number, state, station, vendor};

/// A row for each SubDevice: who it is, and what it showed.
pub(super) fn section(devices: &[DeviceReport], line: Option<&NetworkModel>) -> Markup {
    html! {
        @if !devices.is_empty() {
            section {
                h2 { "SubDevices" }
                div class="wide" {
                    table class="devices" {
                        thead {
                            tr {
                                th { "no" } th { "name" } th { "type" } th { "station" }
                                th { "vendor" } th { "product" } th { "revision" } th { "serial" }
                                th { "chip" } th { "state" } th { "links" } th { "lost links" }
                                th { "errors counted meanwhile" } th { "counters as last read" }
                            }
                        }
                        tbody { @for device in devices { (row(device, line)) } }
                    }
                }
            }
        }
    }
}

fn row(device: &DeviceReport, line: Option<&NetworkModel>) -> Markup {
    let seen = line.and_then(|line| line.devices.iter().find(|seen| seen.id.no() == device.no));
    let has_risen = |seen: &Device| Port::ALL.into_iter().any(|port| seen.counters.port_rose(port));
    let has_error = device.answers == Some(false) || device.al_status_code.is_some();
    let is_marked = has_error || seen.is_some_and(has_risen);
    // A serial number of 0 is none.
    let serial = device.serial.filter(|serial| *serial != 0);
    html! {
        tr class=[is_marked.then_some("marked")] {
            td class="number" { (device.no) }
            td { (device.name.as_deref().unwrap_or("")) }
            td { (device.type_name.as_deref().unwrap_or("")) }
            td class="number" { (station(device)) }
            td class="number" { (vendor(device)) }
            td class="number" { (number(device.product_code)) }
            td class="number" { (number(device.revision)) }
            td class="number" { (serial.map(|serial| serial.to_string()).unwrap_or_default()) }
            td { (device.chip.as_deref().unwrap_or("")) }
            td { (state(device)) }
            @if let Some(seen) = seen {
                td { (links(seen)) }
                td class="number" { (lost(seen)) }
                td { (told(seen, |counter| seen.counters.rise(counter))) }
                td class="faint" { (told(seen, |counter| seen.counters.latest(counter).unwrap_or(0))) }
            }
        }
    }
}

fn links(device: &Device) -> String {
    Port::ALL
        .into_iter()
        .filter(|port| device.dl.is_active(*port) == Some(true))
        .map(Port::letter)
        .collect()
}

fn lost(device: &Device) -> String {
    let lost: u64 =
        Port::ALL.into_iter().map(|port| device.counters.rise(ErrorCounter::LostLink(port))).sum();
    if lost == 0 { String::new() } else { lost.to_string() }
}

/// `A frames 3, symbols 12`: counters above 0, without lost links.
fn told(device: &Device, value: impl Fn(ErrorCounter) -> u64) -> String {
    let counters = device.counters.tracks().map(|(counter, _)| counter);
    let texts = counters
        .filter(|counter| !matches!(counter, ErrorCounter::LostLink(_)))
        .map(|counter| (counter, value(counter)))
        .filter(|(_, value)| *value > 0)
        .map(|(counter, value)| match counter.port() {
            Some(port) => format!("{port}: {} {value}", counter.name()),
            None => format!("{} {value}", counter.name()),
        });
    texts.collect::<Vec<_>>().join(", ")
}
