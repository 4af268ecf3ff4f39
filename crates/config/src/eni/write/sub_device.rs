//! Elements `Slave`.

use linesman_proto::address::RegisterAddress;
use linesman_proto::ads::AmsHeader;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::register::{
    FMMU, FmmuConfig, SYNC_MANAGER, SmControl, SmDirection, SyncManagerConfig,
};
use linesman_proto::sii::Direction;
use linesman_proto::topology::End;

use super::cyclic::Image;
use super::transition::{Init, Target, command};
use crate::eni::OWN;
use crate::esi::device::letters;
use crate::identity::RevisionRule;
use crate::plan::{AddressingChoice, DevicePlan, Plan};
use crate::profile::Mailbox;
use crate::start_up::StartUpAction;
use crate::xml_writer::{Xml, hex};

/// Longest wait for a state, in ms.
const PATIENCE_MS: u32 = 10_000;
/// Longest wait for the SII, in ms.
const SII_PATIENCE_MS: u32 = 100;

pub(super) fn write(xml: &mut Xml, device: &DevicePlan, plan: &Plan, image: &Image) {
    let position = 0_u16.wrapping_sub(device.id.index() as u16);
    xml.element("Slave", &[], |xml| {
        xml.element("Info", &[], |xml| {
            xml.text("Name", &device.name);
            xml.text("PhysAddr", device.station.0);
            xml.text("AutoIncAddr", position);
            if let Some(ports) = &device.ports {
                xml.text("Physics", letters(ports));
            }
            xml.text("VendorId", device.identity.vendor_id);
            xml.text("ProductCode", device.identity.product_code);
            xml.text("RevisionNo", device.identity.revision);
            xml.text("SerialNo", device.identity.serial_number);
        });
        process_data(xml, device, image);
        if let Some(mailbox) = &device.mailbox {
            write_mailbox(xml, device, mailbox);
        }
        xml.element("InitCmds", &[], |xml| init_commands(xml, device, position));
        if let Some(End::Controller(node, port)) = plan.tree.upstream(device.id.index())
            && let Some(before) = plan.devices.get(node)
        {
            xml.element("PreviousPort", &[("Selected", "1")], |xml| {
                xml.text("Port", port.letter());
                xml.text("PhysAddr", before.station.0);
            });
        }
        if let Some(clock) = &device.settings.clock {
            xml.element("DC", &[], |xml| {
                xml.text("ReferenceClock", u8::from(clock.reference));
                xml.text("CycleTime0", clock.sync0_cycle.as_nanos());
                xml.text("CycleTime1", clock.sync1_cycle.as_nanos());
                xml.text("ShiftTime", clock.sync0_shift_ns);
            });
        }
        ours(xml, device, plan);
    });
}

fn process_data(xml: &mut Xml, device: &DevicePlan, image: &Image) {
    xml.element("ProcessData", &[], |xml| {
        for (name, direction) in [("Send", Direction::Outputs), ("Recv", Direction::Inputs)] {
            for run in image.runs(device, direction) {
                xml.element(name, &[], |xml| {
                    xml.text("BitStart", run.start);
                    xml.text("BitLength", run.len());
                });
            }
        }
        for (index, manager) in &device.sync_managers {
            let outputs = manager.control.direction() == SmDirection::MainDeviceWrites;
            xml.element(&format!("Sm{index}"), &[], |xml| {
                xml.text("Type", if outputs { "Outputs" } else { "Inputs" });
                xml.text("DefaultSize", manager.length);
                xml.text("StartAddress", manager.start.0);
                xml.text("ControlByte", manager.control.0);
                xml.text("Enable", manager.activate.0 & 1);
            });
        }
    });
}

fn write_mailbox(xml: &mut Xml, device: &DevicePlan, mailbox: &Mailbox) {
    xml.element("Mailbox", &[], |xml| {
        for (name, area) in [("Send", mailbox.areas.receive), ("Recv", mailbox.areas.send)] {
            xml.element(name, &[], |xml| {
                xml.text("Start", area.offset.0);
                xml.text("Length", area.size);
                if name == "Recv" {
                    match &device.mailbox_state {
                        Some((_, fmmu)) => {
                            let first = crate::plan::layout::MAILBOX_STATES.0;
                            let byte = fmmu.logical_start.0.saturating_sub(first);
                            let bit = byte * 8 + u32::from(fmmu.logical_start_bit);
                            xml.text("StatusBitAddr", bit);
                        }
                        None => xml.text("PollTime", 10),
                    }
                }
            });
        }
        if let Some(bootstrap) = &mailbox.bootstrap {
            xml.element("BootStrap", &[], |xml| {
                for (name, area) in [("Send", bootstrap.receive), ("Recv", bootstrap.send)] {
                    xml.element(name, &[], |xml| {
                        xml.text("Start", area.offset.0);
                        xml.text("Length", area.size);
                    });
                }
            });
        }
        for name in mailbox.protocols.names() {
            xml.text("Protocol", name);
        }
        xml.element("CoE", &[], |xml| {
            xml.element("InitCmds", &[], |xml| {
                for start_up in &device.start_up {
                    let StartUpAction::CoeDownload { object, complete_access, data } =
                        &start_up.action
                    else {
                        continue;
                    };
                    let ObjectAddress { index, subindex } = *object;
                    let whole = [("CompleteAccess", "1")];
                    let attributes = if *complete_access { &whole[..] } else { &[] };
                    xml.element("InitCmd", attributes, |xml| {
                        xml.text("Transition", start_up.transition.letters());
                        xml.text("Comment", &start_up.comment);
                        xml.text("Timeout", 0);
                        xml.text("Ccs", 1);
                        xml.text("Index", index.0);
                        xml.text("SubIndex", subindex);
                        xml.text("Data", hex(data));
                    });
                }
            });
        });
        settings(xml, device);
    });
}

/// Start-up commands by other protocols than CoE.
fn settings(xml: &mut Xml, device: &DevicePlan) {
    type Is = fn(&StartUpAction) -> bool;
    let kinds: [(&str, Is); 5] = [
        ("EoE", |action| matches!(action, StartUpAction::SetAddresses { .. })),
        ("SoE", |action| matches!(action, StartUpAction::WriteIdn { .. })),
        ("AoE", |action| matches!(action, StartUpAction::Ads { .. })),
        ("FoE", |action| matches!(action, StartUpAction::WriteFile { .. })),
        ("VoE", |action| matches!(action, StartUpAction::SendVendorMessage { .. })),
    ];
    for (protocol, is_one) in kinds {
        let mut commands = device.start_up.iter().filter(|one| is_one(&one.action)).peekable();
        let net_id = device.net_id().filter(|_| protocol == "AoE");
        if commands.peek().is_none() && net_id.is_none() {
            continue;
        }
        xml.element(protocol, &[], |xml| {
            if let Some(net_id) = net_id {
                xml.text("NetId", net_id);
            }
            xml.element("InitCmds", &[], |xml| {
                for command in commands {
                    xml.element("InitCmd", &[], |xml| {
                        xml.text("Transition", command.transition.letters());
                        xml.text("Comment", &command.comment);
                        let timeout = match &command.action {
                            StartUpAction::SendVendorMessage { answer_within, .. } => {
                                answer_within.as_nanos() / 1_000_000
                            }
                            StartUpAction::CoeDownload { .. }
                            | StartUpAction::SetAddresses { .. }
                            | StartUpAction::WriteIdn { .. }
                            | StartUpAction::Ads { .. }
                            | StartUpAction::WriteFile { .. }
                            | StartUpAction::RegisterWrite { .. } => 0,
                        };
                        xml.text("Timeout", timeout);
                        match &command.action {
                            StartUpAction::SetAddresses { parameters, .. } => {
                                xml.text("Type", 2);
                                xml.text("Data", hex(parameters));
                            }
                            StartUpAction::WriteIdn { drive, idn, elements, data } => {
                                xml.text("OpCode", 3);
                                xml.text("DriveNo", drive);
                                xml.text("IDN", idn.0);
                                xml.text("Elements", elements);
                                xml.text("Attribute", 0);
                                xml.text("Data", hex(data));
                            }
                            StartUpAction::Ads { target, source, command, data } => {
                                let number = command.number();
                                let header = AmsHeader::request(*target, *source, number, 0);
                                xml.text("Data", hex(&header.message(data)));
                            }
                            StartUpAction::WriteFile { name, password, data } => {
                                xml.text("OpCode", 2);
                                xml.text("Name", name);
                                xml.text("Password", password);
                                xml.text("Data", hex(data));
                            }
                            StartUpAction::SendVendorMessage { data, .. } => {
                                xml.text("Data", hex(data));
                            }
                            StartUpAction::CoeDownload { .. }
                            | StartUpAction::RegisterWrite { .. } => {}
                        }
                    });
                }
            });
        });
    }
}

/// Commands that a MainDevice sends to one SubDevice on its transitions.
struct InitCommands<'a> {
    xml: &'a mut Xml,
    device: &'a DevicePlan,
    /// How it is reached before it has its station address.
    first: Target,
    /// How it is reached from then on.
    by_station: Target,
}

fn init_commands(xml: &mut Xml, device: &DevicePlan, position: u16) {
    let first = match (device.settings.addressing, device.settings.alias) {
        (AddressingChoice::Alias, Some(alias)) => Target::Station(alias.0),
        (AddressingChoice::Alias | AddressingChoice::Auto | AddressingChoice::Position, _) => {
            Target::Position(position)
        }
    };
    let by_station = match device.settings.addressing {
        AddressingChoice::Position => first,
        AddressingChoice::Auto | AddressingChoice::Alias => Target::Station(device.station.0),
    };
    let mut commands = InitCommands { xml, device, first, by_station };
    commands.state("INIT", &["IP", "PI", "SI", "OI"], first, 1);
    identity(commands.xml, device, first);
    commands.station_address();
    commands.watchdogs();
    commands.mailbox();
    commands.process_data();
    commands.clock();
    for start_up in &device.start_up {
        if let StartUpAction::RegisterWrite { address, data } = &start_up.action {
            commands.set(&start_up.comment, &start_up.transition.letters(), *address, data);
        }
    }
    commands.state("PREOP", &["IP", "SP", "OP"], by_station, 2);
    commands.state("SAFEOP", &["PS", "OS"], by_station, 4);
    commands.state("OP", &["SO"], by_station, 8);
}

impl InitCommands<'_> {
    /// Orders a state, and waits for it.
    fn state(&mut self, name: &str, transitions: &[&str], target: Target, value: u8) {
        // A device that only mirrors AL control must not see the acknowledge bit.
        let acknowledge = if self.device.device_emulation || value > 2 { 0x00 } else { 0x10 };
        let (write, read) = target.commands();
        let ask = format!("set device state to {name}");
        let ask = Init { counted: true, ..Init::new(&ask, transitions, target, 0x0120) };
        command(self.xml, &ask, write, &[value | acknowledge, 0]);
        let check = format!("check device state for {name}");
        let check = Init {
            validate: Some((vec![value, 0], vec![0x1F, 0], PATIENCE_MS)),
            ..Init::new(&check, transitions, target, 0x0130)
        };
        command(self.xml, &check, read, &[0; 2]);
    }

    /// Writes a register by the station address.
    fn set(&mut self, comment: &str, transition: &str, register: RegisterAddress, data: &[u8]) {
        let (write, _) = self.by_station.commands();
        let transitions = [transition];
        let init = Init::new(comment, &transitions, self.by_station, register.0);
        command(self.xml, &Init { counted: true, ..init }, write, data);
    }

    fn station_address(&mut self) {
        if self.device.settings.addressing == AddressingChoice::Position {
            return;
        }
        let station = Init::new("set station address", &["IP"], self.first, 0x0010);
        let (write, _) = self.first.commands();
        command(self.xml, &station, write, &self.device.station.0.to_le_bytes());
    }

    fn watchdogs(&mut self) {
        let watchdog = self.device.settings.watchdog;
        for (comment, register, value) in [
            ("set watchdog divider", 0x0400, watchdog.divider),
            ("set PDI watchdog", 0x0410, watchdog.pdi),
            ("set process data watchdog", 0x0420, watchdog.process_data),
        ] {
            if let Some(value) = value {
                self.set(comment, "IP", RegisterAddress(register), &value.to_le_bytes());
            }
        }
    }

    fn mailbox(&mut self) {
        let Some(mailbox) = &self.device.mailbox else { return };
        let areas = [mailbox.areas.receive, mailbox.areas.send];
        let controls = [SmControl::MAILBOX_OUT, SmControl::MAILBOX_IN];
        for ((area, control), index) in areas.into_iter().zip(controls).zip(0..) {
            if let Some(at) = SYNC_MANAGER.at(index) {
                let manager = SyncManagerConfig::enabled(area.offset, area.size, control);
                self.set(&format!("set SM {index} (mailbox)"), "IP", at, &manager.to_bytes());
            }
        }
    }

    fn process_data(&mut self) {
        let device = self.device;
        if let Some((index, state)) = &device.mailbox_state {
            self.fmmu(*index, state, "IP");
        }
        for (index, config) in &device.fmmus {
            self.fmmu(*index, config, "PS");
        }
        for (index, manager) in &device.sync_managers {
            if let Some(at) = SYNC_MANAGER.at(u16::from(*index)) {
                self.set(&format!("set SM {index}"), "PS", at, &manager.to_bytes());
            }
        }
    }

    fn fmmu(&mut self, index: u8, fmmu: &FmmuConfig, transition: &str) {
        if let Some(at) = FMMU.at(u16::from(index)) {
            self.set(&format!("set FMMU {index}"), transition, at, &fmmu.to_bytes());
        }
    }

    fn clock(&mut self) {
        let Some(clock) = &self.device.settings.clock else { return };
        let cycle = |span: linesman_proto::time::Span| {
            u32::try_from(span.as_nanos()).unwrap_or(u32::MAX).to_le_bytes()
        };
        let cycles = [cycle(clock.sync0_cycle), cycle(clock.sync1_cycle)].concat();
        self.set("set DC cycle time", "PS", RegisterAddress(0x09A0), &cycles);
        let activation = clock.assign_activate.to_le_bytes();
        self.set("set DC activation", "PS", RegisterAddress(0x0980), &activation);
    }
}

/// Reads the identity from the SII and compares it.
fn identity(xml: &mut Xml, device: &DevicePlan, target: Target) {
    let (write, read) = target.commands();
    command(xml, &Init::new("assign SII to the MainDevice", &["IP"], target, 0x0500), write, &[0]);
    let identity = &device.identity;
    let revision_mask = match device.revision_rule {
        RevisionRule::Any => None,
        RevisionRule::LowWordEqual | RevisionRule::LowWordEqualHighWordEqualOrGreater => {
            Some(0x0000_FFFF_u32)
        }
        RevisionRule::HighWordEqual => Some(0xFFFF_0000),
        // "Or greater" cannot be said by bytes that must be equal: this file's own element says it.
        RevisionRule::EqualOrGreater | RevisionRule::HighWordEqualOrGreater => None,
        RevisionRule::Equal => Some(u32::MAX),
    };
    let serial_mask = (identity.serial_number != 0).then_some(u32::MAX);
    for (comment, word, value, mask) in [
        ("check vendor id", 0x08_u32, identity.vendor_id, Some(u32::MAX)),
        ("check product code", 0x0A, identity.product_code, Some(u32::MAX)),
        ("check revision", 0x0C, identity.revision, revision_mask),
        ("check serial number", 0x0E, identity.serial_number, serial_mask),
    ] {
        let Some(mask) = mask else { continue };
        let ask = Init::new(comment, &["IP"], target, 0x0502);
        let [a, b, c, d] = word.to_le_bytes();
        command(xml, &ask, write, &[0x00, 0x01, a, b, c, d]);
        let mask_bytes = if mask == u32::MAX { Vec::new() } else { mask.to_le_bytes().to_vec() };
        let check = Init {
            validate: Some(((value & mask).to_le_bytes().to_vec(), mask_bytes, SII_PATIENCE_MS)),
            ..Init::new(comment, &["IP"], target, 0x0508)
        };
        command(xml, &check, read, &[0; 4]);
    }
    command(xml, &Init::new("assign SII to the SubDevice", &["IP"], target, 0x0500), write, &[1]);
}

/// What ENI has no word for.
fn ours(xml: &mut Xml, device: &DevicePlan, plan: &Plan) {
    let settings = &device.settings;
    let mut attributes = vec![
        ("type", device.type_name.clone()),
        ("emulation", u8::from(device.device_emulation).to_string()),
        ("target", device.target.to_string()),
        ("frame-repeat", u8::from(settings.frame_repeat).to_string()),
        ("revision-rule", ChoiceWord(&device.revision_rule).to_string()),
        ("access", ChoiceWord(&settings.access).to_string()),
        ("addressing", ChoiceWord(&settings.addressing).to_string()),
        ("on-wrong-counter", ChoiceWord(&settings.on_wrong_counter).to_string()),
        ("restore-state", u8::from(settings.keeping.restore_state).to_string()),
        ("reinitialise", u8::from(settings.keeping.reinitialise).to_string()),
        ("clear-counters", u8::from(settings.keeping.clear_counters).to_string()),
        ("forward-ethernet", u8::from(settings.keeping.forward_ethernet).to_string()),
        ("entry", plan.tree.entry(device.id.index()).to_string()),
    ];
    if let Some(mailbox) = &device.mailbox {
        attributes.push(("complete-access", u8::from(mailbox.complete_access).to_string()));
    }
    if let Some(current) = device.ebus_current_ma {
        attributes.push(("ebus-ma", current.to_string()));
    }
    if let Some(alias) = settings.alias {
        attributes.push(("alias", alias.0.to_string()));
    }
    if let Some(task) = &settings.task {
        attributes.push(("task", task.clone()));
    }
    if let Some(unit) = &settings.sync_unit {
        attributes.push(("sync-unit", unit.clone()));
    }
    let attributes: Vec<(&str, &str)> =
        attributes.iter().map(|(key, value)| (*key, value.as_str())).collect();
    xml.element(OWN, &attributes, |xml| {
        for module in &settings.modules {
            xml.text("Module", module);
        }
    });
}

/// The word that stands for a choice in files.
struct ChoiceWord<'a, T>(&'a T);

impl<T: serde::Serialize> std::fmt::Display for ChoiceWord<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.serialize(f)
    }
}
