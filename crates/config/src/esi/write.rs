//! Making device descriptions of a plan, so that a virtual line can be built from what a network
//! configuration tells: identity, ports, mailbox, SyncManagers, process data, and the objects that
//! start-up commands write.
//!
//! What a device can do beyond that is not known, and not made up.

use std::collections::BTreeMap;

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::{SmControl, SmDirection};
use linesman_proto::sii::Direction;

use super::device::letters;
use crate::plan::{DevicePlan, Plan};
use crate::start_up::StartUpAction;
use crate::xml_writer::{Xml, hex};

/// Where objects are made up for process data that has none: behind those of profiles.
const MADE_UP: [u16; 2] = [0x3000, 0x3800];
/// Registers are below, process data from here on.
const RAM_START: RegisterAddress = RegisterAddress(0x1000);
/// Bytes of the EEPROM.
const EEPROM_BYTES: u32 = 4096;

/// The name by which the description of a device is found in its file.
#[must_use]
pub fn type_name(device: &DevicePlan) -> String {
    format!("Device-{}", device.id.no())
}

/// The descriptions of the devices of one vendor.
#[must_use]
pub fn write(plan: &Plan, vendor_id: u32) -> String {
    let mut xml = Xml::new();
    xml.element("EtherCATInfo", &[("Version", "1.2")], |xml| {
        xml.element("Vendor", &[], |xml| {
            xml.text("Id", vendor_id);
            xml.text("Name", format!("Vendor {vendor_id}"));
        });
        xml.element("Descriptions", &[], |xml| {
            xml.element("Devices", &[], |xml| {
                let mine = plan.devices.iter().filter(|one| one.identity.vendor_id == vendor_id);
                for device in mine {
                    write_device(xml, device, plan);
                }
            });
        });
    });
    xml.finish()
}

/// A PDO with its entries: object, subindex, bits.
type Entries = Vec<(u16, u8, u16)>;

/// What start-up commands make of the PDOs.
#[derive(Default)]
struct Pdos {
    /// By index of the PDO.
    mapped: BTreeMap<u16, Entries>,
    /// PDOs of a SyncManager.
    assigned: BTreeMap<u8, Vec<u16>>,
    /// Bytes of other objects that are written.
    objects: BTreeMap<u16, BTreeMap<u8, usize>>,
}

impl Pdos {
    fn of(device: &DevicePlan) -> Self {
        let mut pdos = Self::default();
        for command in &device.start_up {
            let StartUpAction::CoeDownload { object, complete_access, data } = &command.action
            else {
                continue;
            };
            let index = object.index.0;
            match index {
                0x1C10..=0x1C2F => {
                    let list = pdos.assigned.entry((index - 0x1C10) as u8).or_default();
                    pdos_list(list, object.subindex, *complete_access, data, 2, |one| {
                        u16::from_le_bytes([one[0], one[1]])
                    });
                }
                0x1600..=0x17FF | 0x1A00..=0x1BFF => {
                    let list = pdos.mapped.entry(index).or_default();
                    pdos_list(list, object.subindex, *complete_access, data, 4, |one| {
                        (u16::from_le_bytes([one[2], one[3]]), one[1], u16::from(one[0]))
                    });
                }
                _ if !complete_access => {
                    let entries = pdos.objects.entry(index).or_default();
                    let known = entries.entry(object.subindex).or_default();
                    *known = data.len().max(*known);
                }
                _ => {}
            }
        }
        pdos
    }
}

/// One command to a list: its count, an entry, or all of it.
fn pdos_list<T>(
    list: &mut Vec<T>,
    subindex: u8,
    whole: bool,
    data: &[u8],
    width: usize,
    read: impl Fn(&[u8]) -> T,
) {
    if whole {
        list.clear();
        list.extend(data.get(2..).unwrap_or(&[]).chunks_exact(width).map(read));
    } else if subindex == 0 {
        list.truncate(usize::from(data.first().copied().unwrap_or(0)));
    } else if let Some(entry) = data.get(..width)
        && usize::from(subindex) == list.len() + 1
    {
        list.push(read(entry));
    }
}

fn write_device(xml: &mut Xml, device: &DevicePlan, plan: &Plan) {
    let physics = device.ports.as_ref().map_or_else(|| "YY".to_owned(), letters);
    let mut pdos = Pdos::of(device);
    let mut runs = Vec::new();
    for (index, manager) in &device.sync_managers {
        let direction = match manager.control.direction() {
            SmDirection::MainDeviceWrites => Direction::Outputs,
            SmDirection::MainDeviceReads | SmDirection::Reserved(_) => Direction::Inputs,
        };
        complete(*index, direction, u32::from(manager.length) * 8, device, plan, &mut pdos);
        runs.push((*index, direction));
    }
    // Process data of registers, such as those of simple terminals, have FMMUs and no SyncManager.
    xml.element("Device", &[("Physics", physics.as_str())], |xml| {
        let product = format!("#x{:08X}", device.identity.product_code);
        let revision = format!("#x{:08X}", device.identity.revision);
        let attributes = [("ProductCode", product.as_str()), ("RevisionNo", revision.as_str())];
        xml.element("Type", &attributes, |xml| xml.raw(&type_name(device)));
        xml.text("Name", &device.name);
        if let Some(current) = device.ebus_current_ma {
            xml.element("Info", &[], |xml| {
                xml.element("Electrical", &[], |xml| xml.text("EBusCurrent", current));
            });
        }
        xml.text("GroupType", "Planned");
        if device.mailbox.is_some() && !pdos.objects.is_empty() {
            dictionary(xml, &pdos.objects);
        }
        for direction in [Direction::Outputs, Direction::Inputs] {
            let name = if direction == Direction::Outputs { "Outputs" } else { "Inputs" };
            let fmmus = device.fmmus.iter().filter(|(_, fmmu)| match direction {
                Direction::Outputs => fmmu.writes,
                Direction::Inputs => fmmu.reads,
            });
            for _ in fmmus {
                xml.text("Fmmu", name);
            }
        }
        if device.mailbox_state.is_some() {
            xml.text("Fmmu", "MBoxState");
        }
        sync_managers(xml, device);
        write_pdos(xml, &pdos, &runs);
        if let Some(mailbox) = &device.mailbox {
            xml.element("Mailbox", &[("DataLinkLayer", "1")], |xml| {
                for name in mailbox.protocols.names() {
                    let coe = [("PdoAssign", "1"), ("PdoConfig", "1"), ("CompleteAccess", "1")];
                    let attributes = if name == "CoE" { &coe[..] } else { &[] };
                    xml.element(name, attributes, |_| {});
                }
            });
        }
        if let Some(clock) = &device.settings.clock {
            xml.element("Dc", &[], |xml| {
                xml.element("OpMode", &[], |xml| {
                    xml.text("Name", "DC");
                    xml.text("AssignActivate", format!("#x{:04X}", clock.assign_activate));
                    xml.text("CycleTimeSync0", clock.sync0_cycle.as_nanos());
                    xml.text("ShiftTimeSync0", clock.sync0_shift_ns);
                });
            });
        }
        xml.element("Eeprom", &[], |xml| {
            xml.text("ByteSize", EEPROM_BYTES);
            // PDI of a processor, or none but the pins of the controller, whose AL status mirrors AL
            // control: what stands below the RAM, at 0x0F00, are its digital outputs.
            let pins = device.mailbox.is_none()
                && device.sync_managers.iter().any(|(_, manager)| manager.start < RAM_START);
            let pdi = if pins { 0x04 } else { 0x05 };
            let emulated = if device.device_emulation || pins { 0x01 } else { 0x00 };
            xml.text("ConfigData", hex(&[pdi, emulated, 0, 0, 0, 0, 0, 0]));
        });
    });
}

/// Sees to it that the PDOs of a SyncManager have as many bits as the plan maps: what start-up commands
/// do not say is taken from the variables.
fn complete(
    index: u8,
    direction: Direction,
    bits: u32,
    device: &DevicePlan,
    plan: &Plan,
    pdos: &mut Pdos,
) {
    let first = if direction == Direction::Outputs { 0x1600 } else { 0x1A00 };
    let list = pdos.assigned.entry(index).or_default();
    if list.is_empty() {
        list.push(first + u16::from(index) * 0x10);
    }
    let assigned = list.clone();
    let mapped = |pdos: &Pdos| -> u32 {
        let entries = assigned.iter().filter_map(|pdo| pdos.mapped.get(pdo)).flatten();
        entries.map(|(_, _, bits)| u32::from(*bits)).sum()
    };
    let missing = bits.saturating_sub(mapped(pdos));
    // All that is missing goes into the first PDO whose entries nobody says.
    let Some(target) = assigned.iter().find(|pdo| !pdos.mapped.contains_key(pdo)) else { return };
    let mut entries: Entries = Vec::new();
    let mut left = missing;
    let object = MADE_UP[usize::from(direction == Direction::Inputs)] + u16::from(index);
    let variables = plan.variables.iter();
    let mine = variables.filter(|one| one.device == device.id && one.direction == direction);
    for variable in mine {
        let bits = u32::try_from(variable.bits).unwrap_or(u32::MAX);
        let Ok(subindex) = u8::try_from(entries.len() + 1) else { break };
        if bits == 0 || bits > left || bits > 64 {
            break;
        }
        entries.push((object, subindex, bits as u16));
        left -= bits;
    }
    while left > 0 {
        let bits = left.min(8);
        entries.push((0, 0, bits as u16));
        left -= bits;
    }
    pdos.mapped.insert(*target, entries);
}

fn sync_managers(xml: &mut Xml, device: &DevicePlan) {
    let mut managers: BTreeMap<u8, (&str, u16, u16, u8)> = BTreeMap::new();
    if let Some(mailbox) = &device.mailbox {
        let (receive, send) = (mailbox.areas.receive, mailbox.areas.send);
        managers.insert(0, ("MBoxOut", receive.offset.0, receive.size, SmControl::MAILBOX_OUT.0));
        managers.insert(1, ("MBoxIn", send.offset.0, send.size, SmControl::MAILBOX_IN.0));
    }
    for (index, manager) in &device.sync_managers {
        let outputs = manager.control.direction() == SmDirection::MainDeviceWrites;
        let name = if outputs { "Outputs" } else { "Inputs" };
        managers.insert(*index, (name, manager.start.0, manager.length, manager.control.0));
    }
    let last = managers.keys().max().copied().map_or(0, |last| last + 1);
    for index in 0..last {
        let (name, start, size, control) = managers.get(&index).copied().unwrap_or_default();
        let [start, size, control] =
            [start, size, u16::from(control)].map(|number| format!("#x{number:04X}"));
        let on = if name.is_empty() { "0" } else { "1" };
        let attributes = [
            ("DefaultSize", size.as_str()),
            ("StartAddress", start.as_str()),
            ("ControlByte", control.as_str()),
            ("Enable", on),
        ];
        xml.element("Sm", &attributes, |xml| xml.raw(name));
    }
}

fn write_pdos(xml: &mut Xml, pdos: &Pdos, runs: &[(u8, Direction)]) {
    let manager_of = |pdo: u16| {
        let found = runs.iter().find(|(index, _)| {
            pdos.assigned.get(index).is_some_and(|assigned| assigned.contains(&pdo))
        });
        found.map(|(index, _)| *index)
    };
    // Assigned ones in the order of their assignment, the others behind them.
    let assigned = runs.iter().filter_map(|(index, _)| pdos.assigned.get(index)).flatten();
    let spare = pdos.mapped.keys().filter(|pdo| manager_of(**pdo).is_none());
    for index in assigned.chain(spare) {
        let name = if *index < 0x1A00 { "RxPdo" } else { "TxPdo" };
        let manager = manager_of(*index).map(|manager| manager.to_string());
        let attributes: Vec<(&str, &str)> =
            manager.iter().map(|manager| ("Sm", manager.as_str())).collect();
        xml.element(name, &attributes, |xml| {
            xml.text("Index", format!("#x{index:04X}"));
            xml.text("Name", format!("PDO {index:04X}"));
            for (object, subindex, bits) in pdos.mapped.get(index).into_iter().flatten() {
                xml.element("Entry", &[], |xml| {
                    xml.text("Index", format!("#x{object:04X}"));
                    if *object != 0 {
                        xml.text("SubIndex", subindex);
                    }
                    xml.text("BitLen", bits);
                    if *object != 0 {
                        xml.text("Name", format!("Value {object:04X}:{subindex:02X}"));
                        xml.text("DataType", data_type(usize::from(*bits)));
                    }
                });
            }
        });
    }
}

/// An unsigned type of so many bits.
fn data_type(bits: usize) -> String {
    match bits {
        1 => "BOOL".to_owned(),
        2..=7 => format!("BIT{bits}"),
        8 => "USINT".to_owned(),
        16 => "UINT".to_owned(),
        32 => "UDINT".to_owned(),
        64 => "ULINT".to_owned(),
        bits => format!("ARRAY [0..{}] OF BYTE", bits.div_ceil(8).saturating_sub(1)),
    }
}

/// The objects that start-up commands write.
fn dictionary(xml: &mut Xml, objects: &BTreeMap<u16, BTreeMap<u8, usize>>) {
    let flags = |xml: &mut Xml| {
        xml.element("Flags", &[], |xml| xml.text("Access", "rw"));
    };
    let is_record = |entries: &BTreeMap<u8, usize>| entries.keys().any(|subindex| *subindex > 0);
    let bit_size = |entries: &BTreeMap<u8, usize>| -> usize {
        if is_record(entries) {
            16 + entries.iter().filter(|(sub, _)| **sub > 0).map(|(_, len)| len * 8).sum::<usize>()
        } else {
            entries.values().sum::<usize>() * 8
        }
    };
    xml.element("Profile", &[], |xml| {
        xml.element("Dictionary", &[], |xml| {
            xml.element("DataTypes", &[], |xml| {
                for (index, entries) in objects.iter().filter(|(_, entries)| is_record(entries)) {
                    xml.element("DataType", &[], |xml| {
                        xml.text("Name", format!("DT{index:04X}"));
                        xml.text("BitSize", bit_size(entries));
                        let count = std::iter::once((0, 1));
                        let others = entries.iter().filter(|(sub, _)| **sub > 0);
                        let all = count.chain(others.map(|(sub, len)| (*sub, *len)));
                        let mut at = 0;
                        for (subindex, len) in all {
                            xml.element("SubItem", &[], |xml| {
                                xml.text("SubIdx", subindex);
                                xml.text("Name", format!("SubIndex {subindex:03}"));
                                xml.text("Type", data_type(len * 8));
                                xml.text("BitSize", len * 8);
                                xml.text("BitOffs", at);
                                flags(xml);
                            });
                            at += if subindex == 0 { 16 } else { len * 8 };
                        }
                    });
                }
            });
            xml.element("Objects", &[], |xml| {
                for (index, entries) in objects {
                    xml.element("Object", &[], |xml| {
                        xml.text("Index", format!("#x{index:04X}"));
                        xml.text("Name", format!("Object {index:04X}"));
                        let size = bit_size(entries);
                        if is_record(entries) {
                            xml.text("Type", format!("DT{index:04X}"));
                        } else {
                            xml.text("Type", data_type(size));
                        }
                        xml.text("BitSize", size);
                        flags(xml);
                    });
                }
            });
        });
    });
}
