//! A virtual segment made of a plan: a segment file, and device descriptions beside it, one file for
//! each vendor.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use linesman_config::attachment::Attachment;
use linesman_config::esi::write as descriptions;
use linesman_config::plan::Plan;
use linesman_proto::address::Path as Card;
use linesman_proto::topology::End;
use linesman_runtime::plan_file::PlanFile;

use crate::failure::Failure;
use crate::files;

/// Writes the files.
pub(super) fn write(path: &Path, file: &PlanFile) -> Result<(), Failure> {
    let vendors: BTreeSet<u32> =
        file.plan.devices.iter().map(|device| device.identity.vendor_id).collect();
    for vendor in &vendors {
        files::refuse_to_overwrite(&beside(path, *vendor))?;
    }
    let mut written = Vec::new();
    let all = || {
        // What the segment names is there before it.
        for vendor in vendors {
            let (path, text) = (beside(path, vendor), descriptions::write(&file.plan, vendor));
            files::write_new(&path, "the device descriptions", &text)?;
            written.push(path);
        }
        files::write_new(path, "the segment", &text(path, file))
    };
    let result = all();
    if result.is_err() {
        written.iter().for_each(|path| drop(fs::remove_file(path)));
    }
    result
}

/// The file of a vendor's descriptions.
fn beside(path: &Path, vendor: u32) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{vendor:08X}.xml"))
}

fn text(path: &Path, file: &PlanFile) -> String {
    let quoted = |text: &str| toml::Value::from(text).to_string();
    let plan = &file.plan;
    let mut text = format!("name = {}\n", quoted(&file.name));
    for device in &plan.devices {
        let node = device.id.index();
        let described = beside(path, device.identity.vendor_id);
        let described = described.file_name().unwrap_or_default().to_string_lossy();
        let kind = format!(
            "esi:{described}#{}@0x{:08X}",
            descriptions::type_name(device),
            device.identity.revision
        );
        let entry = plan.tree.entry(node).letter();
        let _ = writeln!(text, "\n[[device]]\nname = {}", quoted(&device.name));
        let _ = writeln!(text, "type = {}\non = {}", quoted(&kind), quoted(&on(plan, node)));
        if entry != 'A' {
            let _ = writeln!(text, "entry = \"{entry}\"");
        }
        if device.identity.serial_number != 0 {
            let _ = writeln!(text, "serial = {}", device.identity.serial_number);
        }
    }
    text
}

fn on(plan: &Plan, node: usize) -> String {
    let name = |node: usize| plan.devices[node].name.clone();
    match plan.tree.upstream(node) {
        Some(End::Controller(before, port)) => Attachment::Device { name: name(before), port },
        Some(End::MainDevice(card)) => Attachment::MainDevice(card),
        None => Attachment::MainDevice(Card::A),
    }
    .to_string()
}
