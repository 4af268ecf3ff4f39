//! SubDevices: identity, wiring, SyncManagers, FMMUs, clocks, SII.

use linesman_capture::network::devices::{ClockSetUpReport, SurveyedDevice};
use linesman_lab::drawing::{Label, draw};
use linesman_proto::topology::Tree;

use super::CaptureWriter;
use crate::output::{Table, wrapped};
use crate::text::devices::{number, state, station, vendor};
use crate::text::quantity::{count, time};

impl CaptureWriter<'_> {
    /// A row for each SubDevice.
    pub(super) fn devices(&self) -> String {
        let headings = [
            "no", "type", "station", "alias", "vendor", "product", "revision", "serial", "chip",
            "state",
        ];
        let mut table = Table::new(&headings, self.paint);
        for device in &self.report.devices {
            let about = &device.about;
            table.row([
                about.no.to_string(),
                kind(device),
                station(about),
                about.alias.map_or_else(String::new, |alias| alias.to_string()),
                vendor(about),
                number(about.product_code),
                number(about.revision),
                about.serial.map_or_else(|| "?".to_owned(), |serial| serial.to_string()),
                about.chip.clone().unwrap_or_else(|| "?".to_owned()),
                state(about),
            ]);
        }
        match self.report.devices.is_empty() {
            true => String::new(),
            false => self.section("SubDevices", &table.render()),
        }
    }

    /// The tree, as far as it is known.
    pub(super) fn wiring(&self, tree: Option<&Tree>) -> String {
        let Some(tree) = tree else { return String::new() };
        let label = |device: &SurveyedDevice| Label {
            name: device.about.name.clone().unwrap_or_default(),
            type_name: kind(device),
        };
        let labels: Vec<Label> = self.report.devices.iter().map(label).collect();
        let rows = draw(tree, &labels);
        let body: String = rows.iter().map(|row| format!("{}\n", row.text)).collect();
        self.section("Wiring", &body)
    }

    /// SyncManagers and FMMUs.
    pub(super) fn set_up(&self) -> String {
        let headings = ["SubDevice", "", "way", "address", "bytes", "mapped to"];
        let mut table = Table::new(&headings, self.paint);
        let mut is_any = false;
        for device in &self.report.devices {
            let name = self.names.device(device.about.no);
            for one in device.sync_managers.iter().filter(|one| one.active) {
                is_any = true;
                table.row([
                    name.clone(),
                    format!("SyncManager {}", one.sync_manager),
                    format!("{} {}", one.mode, one.direction),
                    format!("0x{:04X}", one.start),
                    one.length.to_string(),
                    String::new(),
                ]);
            }
            for one in device.fmmus.iter().filter(|one| one.active) {
                is_any = true;
                table.row([
                    name.clone(),
                    format!("FMMU {}", one.fmmu),
                    one.direction.clone(),
                    format!("0x{:04X}.{}", one.physical_start, one.physical_bit),
                    one.length.to_string(),
                    format!(
                        "0x{:08X}.{} to bit {}",
                        one.logical_start, one.start_bit, one.stop_bit
                    ),
                ]);
            }
        }
        if is_any { self.section("SyncManagers and FMMUs", &table.render()) } else { String::new() }
    }

    /// Distributed clocks.
    pub(super) fn clocks(&self) -> String {
        let headings = ["SubDevice", "offset", "delay", "SYNC0", "SYNC1", "signals", "ahead"];
        let mut table = Table::new(&headings, self.paint);
        let mut is_any = false;
        for device in &self.report.devices {
            let Some(clock) = &device.clock else { continue };
            is_any = true;
            table.row(std::iter::once(self.names.device(device.about.no)).chain(cells(clock)));
        }
        if is_any { self.section("Distributed clocks", &table.render()) } else { String::new() }
    }

    /// Words of the SII that were read.
    pub(super) fn sii(&self) -> String {
        let mut body = String::new();
        for device in &self.report.devices {
            let words: usize = device.sii.iter().map(|stretch| stretch.words.len()).sum();
            if words == 0 {
                continue;
            }
            let name = self.names.device(device.about.no);
            let read = count(words as u64, "word");
            if !self.is_whole {
                let at = device.sii.iter().map(|stretch| {
                    let last = stretch.word as usize + stretch.words.len() - 1;
                    format!("0x{:02X}-0x{last:02X}", stretch.word)
                });
                let at = at.collect::<Vec<_>>().join(", ");
                body.push_str(&wrapped("", &format!("{name}: {read} read: {at}"), self.width));
                continue;
            }
            body.push_str(&format!("{name}: {read}\n"));
            for stretch in &device.sii {
                for (row, words) in stretch.words.chunks(8).enumerate() {
                    let words: Vec<String> =
                        words.iter().map(|word| format!("{word:04X}")).collect();
                    let at = stretch.word as usize + 8 * row;
                    body.push_str(&format!("  0x{at:04X}  {}\n", words.join(" ")));
                }
            }
        }
        self.section("SII", &body)
    }
}

/// The type: as read, else by its description.
fn kind(device: &SurveyedDevice) -> String {
    match (&device.about.type_name, &device.described_as) {
        (Some(read), Some(described)) if read != described => format!("{read} ({described})"),
        (Some(one), _) | (None, Some(one)) => one.clone(),
        (None, None) => "?".to_owned(),
    }
}

fn cells(clock: &ClockSetUpReport) -> [String; 6] {
    let or_unknown = |text: Option<String>| text.unwrap_or_else(|| "?".to_owned());
    let short = |ns: u32| time(ns.into());
    [
        or_unknown(clock.offset_ns.as_ref().map(|ns| format!("{ns} ns"))),
        or_unknown(clock.delay_ns.map(|ns| format!("{ns} ns"))),
        or_unknown(clock.sync0_ns.map(short)),
        or_unknown(clock.sync1_ns.map(short)),
        or_unknown(clock.activation.map(|bits| format!("0x{bits:02X}"))),
        or_unknown(clock.ahead_ns.map(|ns| format!("{ns} ns"))),
    ]
}
