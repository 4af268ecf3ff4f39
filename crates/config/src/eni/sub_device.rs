//! A SubDevice: element `Slave` (ETG.2100).

use linesman_proto::address::{DeviceId, RegisterAddress, StationAddress, StationAlias};
use linesman_proto::ads::AmsNetIdError;
use linesman_proto::port::Port;
use linesman_proto::register::{FmmuConfig, SmMode};
use linesman_proto::sii::{Direction, Identity, MailboxArea, MailboxPair, Protocols};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use super::state::Meaning;
use super::{OWN, clean, command};
use crate::esi::EsiError;
use crate::esi::device::physics;
use crate::esi::setting;
use crate::esi::xml::Element;
use crate::identity::RevisionRule;
use crate::plan::{
    AddressingChoice, AutomaticActions, ClockSettings, DevicePlan, OnWrongCounter, ProcessAccess,
};
use crate::profile::Mailbox;
use crate::start_up::{StartUpCommand, left_out};

/// Status byte of the SyncManager that serves the mailbox in.
const MAILBOX_IN_STATUS: RegisterAddress = RegisterAddress(0x080D);

/// A SubDevice as the file has it.
pub(super) struct FileDevice {
    pub(super) line: u32,
    pub(super) plan: DevicePlan,
    /// Its position as AutoIncAddr says it.
    pub(super) position: Option<u16>,
    /// Station address and port of whom it hangs on.
    pub(super) previous: Option<(u32, u16, Port)>,
    /// The port by which it is entered.
    pub(super) entry: Port,
    /// Where its outputs and inputs lie in the file's process image.
    pub(super) outputs: Vec<ImageBits>,
    pub(super) inputs: Vec<ImageBits>,
}

/// A run of bits in the file's process image: elements `Send` and `Recv`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct ImageBits {
    pub(super) line: u32,
    pub(super) start: u64,
    pub(super) len: u64,
}

impl FileDevice {
    pub(super) fn image(&self, direction: Direction) -> &[ImageBits] {
        match direction {
            Direction::Outputs => &self.outputs,
            Direction::Inputs => &self.inputs,
        }
    }

    /// What an error about it is told of.
    pub(super) fn error(&self, element: &str, line: u32, reason: impl Into<String>) -> EsiError {
        EsiError::new(line, &format!("Config/Slave {}/{element}", self.plan.name), reason)
    }
}

/// The FMMUs of a plan that serve one direction.
pub(super) fn fmmus_of(
    device: &DevicePlan,
    direction: Direction,
) -> impl Iterator<Item = &FmmuConfig> {
    device.fmmus.iter().map(|(_, fmmu)| fmmu).filter(move |fmmu| match direction {
        Direction::Outputs => fmmu.writes,
        Direction::Inputs => fmmu.reads,
    })
}

/// The SubDevice of an element; `number` counts from 1.
pub(super) fn sub_device(
    element: &Element,
    number: usize,
    notes: &mut Vec<String>,
) -> Result<FileDevice, EsiError> {
    let name = clean(element.at("Info/Name").map_or("", Element::text));
    let within = format!("Slave {name}");
    read(element, name, number, notes).map_err(|error| error.within(&within))
}

fn read(
    element: &Element,
    name: String,
    number: usize,
    notes: &mut Vec<String>,
) -> Result<FileDevice, EsiError> {
    let info = element.child("Info").ok_or_else(|| element.error("it has no Info"))?;
    let id = u32::try_from(number - 1).map_err(|_| element.error("too many SubDevices"))?;
    let mut device = DevicePlan { name, ..DevicePlan::bare(DeviceId(id)) };
    if let Some(station) = info.child_number("PhysAddr")? {
        device.station = StationAddress(station);
    }
    let identity = |name: &str| info.child_number::<u32>(name).map(|number| number.unwrap_or(0));
    device.identity = Identity {
        vendor_id: identity("VendorId")?,
        product_code: identity("ProductCode")?,
        revision: identity("RevisionNo")?,
        serial_number: identity("SerialNo")?,
    };
    device.revision_rule = RevisionRule::Any;
    if let Some(letters) = info.child("Physics") {
        device.ports = Some(physics(letters.text()).map_err(|reason| letters.error(reason))?);
    }
    if let Some(mailbox) = element.child("Mailbox") {
        device.mailbox = self::mailbox(mailbox, &mut device)?;
        settings(mailbox, &mut device, notes)?;
    }
    if let Some(group) = element.child("HotConnect") {
        let called = clean(group.child_text("GroupName"));
        let called = if called.is_empty() { String::new() } else { format!(" \"{called}\"") };
        notes.push(format!(
            "{}: it begins the hot connect group{called}, which is treated as always there: its \
             identification is not read, and while it is off its SubDevices count as missing",
            device.name
        ));
    }
    let mut meaning = Meaning::default();
    for command in element.at("InitCmds").into_iter().flat_map(|list| list.children("InitCmd")) {
        match command::register(command).map_err(|error| error.within("InitCmds"))? {
            Some(command) => meaning.read(&command, &mut device)?,
            None => notes
                .push(format!("{}: an InitCmd with a logical address is left out", device.name)),
        }
    }
    if !meaning.checks_serial {
        device.identity.serial_number = 0;
    }
    meaning.finish(&mut device, clock(element)?);
    take_over(meaning, &mut device);
    let process = element.child("ProcessData");
    let image = |name: &str| process.map_or(Ok(Vec::new()), |process| bits(process, name));
    let position: Option<u16> = info.child_number("AutoIncAddr")?;
    let mut file = FileDevice {
        line: element.line,
        position: position.map(|address| 0_u16.wrapping_sub(address)),
        previous: previous(element)?,
        entry: Port::A,
        outputs: image("Send")?,
        inputs: image("Recv")?,
        plan: device,
    };
    if file.plan.sync_managers.is_empty()
        && let Some(process) = process
    {
        file.plan.sync_managers = sync_managers(process)?;
    }
    if let Some(own) = element.child(OWN) {
        ours(own, &mut file)?;
    }
    Ok(file)
}

/// SyncManagers and FMMUs, those of the mailbox apart.
fn take_over(meaning: Meaning, device: &mut DevicePlan) {
    let mailbox = device.mailbox.is_some();
    for (index, manager) in meaning.sync_managers {
        if !(mailbox && index < 2 && manager.control.mode() == SmMode::Mailbox) {
            device.sync_managers.push((index, manager));
        }
    }
    for (index, fmmu) in meaning.fmmus {
        if fmmu.reads && !fmmu.writes && fmmu.physical_start == MAILBOX_IN_STATUS {
            device.mailbox_state = Some((index, fmmu));
        } else {
            device.fmmus.push((index, fmmu));
        }
    }
}

fn mailbox(element: &Element, device: &mut DevicePlan) -> Result<Option<Mailbox>, EsiError> {
    let areas = areas(element)?;
    let bootstrap = element.child("BootStrap").map(self::areas).transpose()?;
    let mut protocols = 0;
    for protocol in element.children("Protocol") {
        protocols |= Protocols::bit_of(protocol.text()).unwrap_or(0);
    }
    let mut complete_access = false;
    let commands = element.at("CoE/InitCmds");
    for command in commands.into_iter().flat_map(|list| list.children("InitCmd")) {
        complete_access |= command.flag("CompleteAccess")?;
        let read = command::coe(command).map_err(|error| error.within("CoE/InitCmds"))?;
        device.start_up.extend(read);
    }
    if !areas.is_present() {
        return Ok(None);
    }
    let bootstrap = bootstrap.filter(|pair| pair.is_present());
    Ok(Some(Mailbox { areas, bootstrap, protocols: Protocols(protocols), complete_access }))
}

/// Commands by other protocols than CoE; those that cannot be carried out are left out, and that is said.
fn settings(
    mailbox: &Element,
    device: &mut DevicePlan,
    notes: &mut Vec<String>,
) -> Result<(), EsiError> {
    type Read = fn(&Element) -> Result<Option<Vec<StartUpCommand>>, EsiError>;
    let protocols: [(&str, Read); 5] = [
        ("EoE", setting::ethernet),
        ("SoE", setting::drive),
        ("AoE", setting::ads),
        ("FoE", setting::file),
        ("VoE", setting::vendor),
    ];
    if let Some(net_id) = mailbox.at("AoE/NetId") {
        let read = net_id.text().parse();
        device.settings.net_id =
            Some(read.map_err(|error: AmsNetIdError| net_id.error(error.to_string()))?);
    }
    for (protocol, read) in protocols {
        let Some(commands) = mailbox.child(protocol).and_then(|one| one.child("InitCmds")) else {
            continue;
        };
        let mut names = Vec::new();
        let mut count = 0;
        for command in commands.children("InitCmd").filter(|one| setting::is_on(one)) {
            match read(command).map_err(|error| error.within(&format!("{protocol}/InitCmds")))? {
                Some(read) => device.start_up.extend(read),
                None => {
                    count += 1;
                    let comment = clean(command.child_text("Comment"));
                    names.extend(Some(comment).filter(|comment| !comment.is_empty()));
                }
            }
        }
        if count > 0 {
            notes.push(left_out(&device.name, protocol, count, &names));
        }
    }
    Ok(())
}

/// What the MainDevice sends, the SubDevice receives.
fn areas(element: &Element) -> Result<MailboxPair, EsiError> {
    let area = |names: [&str; 2]| {
        let found = names.iter().find_map(|name| element.child(name));
        let Some(area) = found else { return Ok(MailboxArea::default()) };
        Ok(MailboxArea {
            offset: RegisterAddress(area.child_number("Start")?.unwrap_or(0)),
            size: area.child_number("Length")?.unwrap_or(0),
        })
    };
    Ok(MailboxPair { receive: area(["Send", "send"])?, send: area(["Recv", "Receive"])? })
}

fn clock(element: &Element) -> Result<Option<ClockSettings>, EsiError> {
    let Some(clock) = element.child("DC") else { return Ok(None) };
    let span =
        |name: &str| clock.child_number::<u32>(name).map(|ns| Span::ns(u64::from(ns.unwrap_or(0))));
    Ok(Some(ClockSettings {
        assign_activate: 0,
        sync0_cycle: span("CycleTime0")?,
        sync0_shift_ns: clock.child_number("ShiftTime")?.unwrap_or(0),
        input_reference: Some(false),
        sync1_cycle: span("CycleTime1")?,
        reference: matches!(clock.child_text("ReferenceClock"), "1" | "true"),
    }))
}

fn previous(element: &Element) -> Result<Option<(u32, u16, Port)>, EsiError> {
    let selected = |one: &&Element| one.flag("Selected").unwrap_or(false);
    let all = || element.children("PreviousPort");
    let Some(found) = all().find(selected).or_else(|| all().next()) else { return Ok(None) };
    let letter = found.child_text("Port");
    let mut letters = letter.chars();
    let port = letters.next().and_then(Port::from_letter).filter(|_| letters.next().is_none());
    let port =
        port.ok_or_else(|| found.error(format!("Port \"{letter}\", expected A, B, C or D")))?;
    let station = found.child_number("PhysAddr")?;
    let station = station.ok_or_else(|| found.error("it has no PhysAddr"))?;
    Ok(Some((found.line, station, port)))
}

fn bits(process: &Element, name: &str) -> Result<Vec<ImageBits>, EsiError> {
    let all = process.children(name).map(|run| {
        Ok(ImageBits {
            line: run.line,
            start: run.child_number("BitStart")?.unwrap_or(0),
            len: run.child_number("BitLength")?.unwrap_or(0),
        })
    });
    let all: Vec<ImageBits> = all.collect::<Result<_, EsiError>>()?;
    Ok(all.into_iter().filter(|run| run.len > 0).collect())
}

/// SyncManagers of a file without commands that set them: elements `Sm0`, `Sm1` and so on.
fn sync_managers(
    process: &Element,
) -> Result<Vec<(u8, linesman_proto::register::SyncManagerConfig)>, EsiError> {
    use linesman_proto::register::{SmControl, SyncManagerConfig};
    let mut managers = Vec::new();
    for index in 0..8_u8 {
        let Some(element) = process.child(&format!("Sm{index}")) else { continue };
        if !matches!(element.child_text("Type"), "Outputs" | "Inputs") {
            continue;
        }
        let start = element.child_number("StartAddress")?.unwrap_or(0);
        let control: u8 = element.child_number("ControlByte")?.unwrap_or(0);
        let mut bits = 0_u32;
        for assigned in element.children("Pdo") {
            let wanted: u16 = assigned.number()?;
            for pdo in process.children.iter().filter(|one| one.name.ends_with("xPdo")) {
                if pdo.child_number::<u16>("Index")? == Some(wanted) {
                    for entry in pdo.children("Entry") {
                        bits += u32::from(entry.child_number::<u16>("BitLen")?.unwrap_or(0));
                    }
                }
            }
        }
        let size: u16 = element.child_number("DefaultSize")?.unwrap_or(0);
        let len = if bits > 0 { u16::try_from(bits.div_ceil(8)).unwrap_or(size) } else { size };
        if len > 0 {
            let start = RegisterAddress(start);
            managers.push((index, SyncManagerConfig::enabled(start, len, SmControl(control))));
        }
    }
    Ok(managers)
}

/// What a file of Linesman says beyond ENI.
fn ours(own: &Element, file: &mut FileDevice) -> Result<(), EsiError> {
    let device = &mut file.plan;
    let text = |name: &str| own.attribute(name).unwrap_or_default();
    let choice =
        |name: &str| serde::de::value::StrDeserializer::new(own.attribute(name).unwrap_or(""));
    device.type_name = text("type").to_owned();
    device.device_emulation = own.flag("emulation")?;
    device.settings.frame_repeat = own.flag("frame-repeat")?;
    device.ebus_current_ma = own.attribute_number("ebus-ma")?;
    if let Some(port) = text("entry").chars().next().and_then(Port::from_letter) {
        file.entry = port;
    }
    device.revision_rule =
        known::<RevisionRule>(choice("revision-rule")).unwrap_or(device.revision_rule);
    device.settings.access = known::<ProcessAccess>(choice("access")).unwrap_or_default();
    device.settings.addressing =
        known::<AddressingChoice>(choice("addressing")).unwrap_or(device.settings.addressing);
    let alias: Option<u16> = own.attribute_number("alias")?;
    device.settings.alias = alias.map(StationAlias).or(device.settings.alias);
    device.settings.on_wrong_counter =
        known::<OnWrongCounter>(choice("on-wrong-counter")).unwrap_or_default();
    // Files of earlier versions say nothing of it.
    let unless_said = |name: &str| match own.attribute(name) {
        Some(_) => own.flag(name),
        None => Ok(true),
    };
    device.settings.keeping = AutomaticActions {
        restore_state: unless_said("restore-state")?,
        reinitialise: unless_said("reinitialise")?,
        clear_counters: unless_said("clear-counters")?,
        forward_ethernet: unless_said("forward-ethernet")?,
    };
    device.settings.task = own.attribute("task").map(str::to_owned);
    device.settings.sync_unit = own.attribute("sync-unit").map(str::to_owned);
    device.settings.modules =
        own.children("Module").map(Element::number).collect::<Result<_, _>>()?;
    device.target = match text("target") {
        "INIT" => AlState::Init,
        "PREOP" => AlState::PreOp,
        "SAFEOP" => AlState::SafeOp,
        "BOOT" => AlState::Boot,
        _ => AlState::Op,
    };
    if let Some(mailbox) = &mut device.mailbox {
        mailbox.complete_access = own.flag("complete-access")?;
    }
    Ok(())
}

fn known<'de, T: serde::Deserialize<'de>>(
    text: serde::de::value::StrDeserializer<'de, serde::de::value::Error>,
) -> Option<T> {
    T::deserialize(text).ok()
}
