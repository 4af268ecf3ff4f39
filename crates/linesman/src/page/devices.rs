//! What every SubDevice showed.

use linesman_diagnosis::line::{Device, Line};
use linesman_proto::port::Port;
use linesman_proto::register::ErrorCounter;
use maud::{Markup, html};

use super::scene::state;

/// A row for each SubDevice.
pub(super) fn section(line: &Line) -> Markup {
    html! {
        @if !line.devices.is_empty() {
            section {
                h2 { "SubDevices" }
                table class="devices" {
                    thead {
                        tr {
                            th { "no" } th { "name" } th { "type" } th { "station" } th { "state" }
                            th { "ports with a link" } th { "lost links" }
                            th { "errors counted meanwhile" } th { "counters as last read" }
                        }
                    }
                    tbody { @for device in &line.devices { (row(device)) } }
                }
            }
        }
    }
}

fn row(device: &Device) -> Markup {
    let state = state(device);
    let error = state.as_ref().is_some_and(|state| state.error);
    let rose = Port::ALL.into_iter().any(|port| device.counters.port_rose(port));
    html! {
        tr class=[(error || rose).then_some("marked")] {
            td class="number" { (device.id.no()) }
            td { (device.name.as_deref().unwrap_or("")) }
            td { (device.type_name.as_deref().unwrap_or("")) }
            td class="number" {
                @if let Some(station) = device.station { (format!("0x{:04X}", station.value())) }
            }
            td { @if let Some(state) = &state { (state.text) } }
            td { (links(device)) }
            td class="number" { (lost(device)) }
            td { (told(device, |counter| device.counters.rise(counter))) }
            td class="faint" {
                (told(device, |counter| device.counters.latest(counter).unwrap_or(0)))
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
