//! A device: element `Device` (ETG.2000).

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::PortMap;
use linesman_proto::sii::{Direction, PortKind, Protocols};

use super::clock::{EsiOpMode, op_modes};
use super::dictionary::{EsiObject, objects};
use super::eeprom::{EsiEeprom, eeprom};
use super::error::EsiError;
use super::mailbox::{EsiMailbox, mailbox};
use super::module::{EsiSlots, slots};
use super::pdo::{EsiPdo, pdo};
use super::sync_manager::{EsiFmmu, EsiSyncManager, fmmu, sync_manager};
use super::xml::Element;
use crate::identity::RevisionRule;

/// A device.
#[derive(Clone, PartialEq, Debug)]
pub struct EsiDevice {
    /// Where it stands in the file.
    pub line: u32,
    /// Its type, such as `EL2004`.
    pub type_name: String,
    /// Its product code.
    pub product_code: u32,
    /// Its revision.
    pub revision: u32,
    /// How its maker wants revisions compared: attribute `CheckRevisionNo`; `None` where nothing is said.
    pub revision_rule: Option<RevisionRule>,
    /// The frames of its sync units may be sent twice in a cycle: `FrameRepeatSupport` of all `Su`.
    pub frame_repeat: bool,
    /// Its names with the number of their language (1033 is English); 0 without one.
    pub names: Vec<(u32, String)>,
    /// The group it belongs to.
    pub group: String,
    /// Revisions that it stands for, too.
    pub hides: Vec<u32>,
    /// Further controllers in its housing: product code and revision.
    pub sub_devices: Vec<(u32, u32)>,
    /// What its ports are.
    pub ports: PortMap<PortKind>,
    /// Current from the E-bus in mA.
    pub ebus_current_ma: Option<i16>,
    /// Its FMMUs.
    pub fmmus: Vec<EsiFmmu>,
    /// Its SyncManagers.
    pub sync_managers: Vec<EsiSyncManager>,
    /// Its process data.
    pub pdos: Vec<EsiPdo>,
    /// Other assignments of PDOs: name, whether it is the default, SyncManager and PDOs.
    pub alternatives: Vec<EsiAlternative>,
    /// Its mailbox.
    pub mailbox: Option<EsiMailbox>,
    /// Its operation modes with distributed clocks.
    pub op_modes: Vec<EsiOpMode>,
    /// What is programmed into its EEPROM; `None` for a thing without controller.
    pub eeprom: Option<EsiEeprom>,
    /// Where its coding switch can be read.
    pub identification_address: Option<RegisterAddress>,
    /// Its identification can be asked for by AL control.
    pub identification_by_al_status: bool,
    /// How long its states take at most.
    pub timeouts: EsiTimeouts,
    /// What its controller has, where that is said.
    pub controller: EsiController,
    /// Registers that a MainDevice is to write: address and value.
    pub registers: Vec<(RegisterAddress, u32)>,
    /// Device profile, such as 402; 0 where nothing is said.
    pub profile: u16,
    /// Its dictionary, as far as it is described here.
    pub objects: Vec<EsiObject>,
    /// Texts of its diagnosis messages (object 0x10F3) by their numbers, in English where they are.
    pub diagnosis_texts: Vec<(u16, String)>,
    /// The file that holds its dictionary, if that is another.
    pub dictionary_file: Option<String>,
    /// Where modules can sit.
    pub slots: Option<EsiSlots>,
    /// What was odd about it.
    pub notes: Vec<EsiError>,
}

/// An assignment of PDOs that can be chosen.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EsiAlternative {
    /// Its name.
    pub name: String,
    /// It is chosen unless another is.
    pub is_default: bool,
    /// SyncManager and PDOs.
    pub assignments: Vec<(u8, Vec<u16>)>,
}

/// How long state changes and mailbox take at most, in ms; 0 where nothing is said.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct EsiTimeouts {
    /// INIT to PREOP.
    pub preop_ms: u32,
    /// PREOP to SAFEOP, SAFEOP to OP.
    pub safeop_op_ms: u32,
    /// Anything to INIT.
    pub back_to_init_ms: u32,
    /// OP to SAFEOP.
    pub back_to_safeop_ms: u32,
    /// Until a mailbox message is taken.
    pub mailbox_request_ms: u32,
    /// Until it is answered.
    pub mailbox_response_ms: u32,
}

/// What a controller has; 0 where nothing is said.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct EsiController {
    /// Memory for process data in bytes, registers not counted.
    pub ram_bytes: u32,
    /// SyncManagers.
    pub sync_managers: u8,
    /// FMMUs.
    pub fmmus: u8,
}

impl EsiDevice {
    /// Its name in English, or whatever there is.
    #[must_use]
    pub fn name(&self) -> &str {
        let english = self.names.iter().find(|(language, _)| *language == 1033);
        english.or_else(|| self.names.first()).map_or("", |(_, name)| name)
    }

    /// Whether it is a device with a controller: one with an EEPROM, or at least with SyncManagers.
    #[must_use]
    pub fn has_controller(&self) -> bool {
        self.eeprom.is_some() || !self.sync_managers.is_empty()
    }

    /// Whether its mailbox speaks CoE.
    #[must_use]
    pub fn has_coe(&self) -> bool {
        self.mailbox.as_ref().is_some_and(|mailbox| mailbox.protocols.has(Protocols::COE))
    }
}

/// The device of an element `Device`.
pub(super) fn device(element: &Element) -> Result<EsiDevice, EsiError> {
    let kind = element.child("Type").ok_or_else(|| element.error("it has no Type"))?;
    let type_name = kind.text().to_owned();
    read(element, kind, &type_name).map_err(|error| error.within(&format!("Device {type_name}")))
}

fn read(element: &Element, kind: &Element, type_name: &str) -> Result<EsiDevice, EsiError> {
    let mut notes = Vec::new();
    let mut device = EsiDevice {
        line: element.line,
        type_name: type_name.to_owned(),
        product_code: kind.attribute_number("ProductCode")?.unwrap_or(0),
        revision: kind.attribute_number("RevisionNo")?.unwrap_or(0),
        revision_rule: revision_rule(kind, &mut notes),
        frame_repeat: frame_repeat(element)?,
        names: names(element)?,
        group: element.child_text("GroupType").to_owned(),
        hides: Vec::new(),
        sub_devices: Vec::new(),
        ports: ports(element)?,
        ebus_current_ma: None,
        fmmus: Vec::new(),
        sync_managers: Vec::new(),
        pdos: Vec::new(),
        alternatives: Vec::new(),
        mailbox: element.child("Mailbox").map(mailbox).transpose()?,
        op_modes: element.child("Dc").map_or(Ok(Vec::new()), op_modes)?,
        eeprom: element.child("Eeprom").map(eeprom).transpose()?,
        identification_address: None,
        identification_by_al_status: false,
        timeouts: EsiTimeouts::default(),
        controller: EsiController::default(),
        registers: Vec::new(),
        profile: 0,
        objects: Vec::new(),
        diagnosis_texts: Vec::new(),
        dictionary_file: None,
        slots: element.child("Slots").map(slots).transpose()?,
        notes: Vec::new(),
    };
    for child in &element.children {
        match child.name.as_str() {
            "HideType" => {
                device.hides.extend(child.attribute_number::<u32>("RevisionNo")?);
            }
            "SubDevice" => device.sub_devices.push((
                child.attribute_number("ProductCode")?.unwrap_or(0),
                child.attribute_number("RevisionNo")?.unwrap_or(0),
            )),
            "Fmmu" => device.fmmus.push(fmmu(child)?),
            "Sm" => device.sync_managers.push(sync_manager(child)?),
            "RxPdo" => device.pdos.push(pdo(child, Direction::Outputs)?),
            "TxPdo" => device.pdos.push(pdo(child, Direction::Inputs)?),
            "ESC" => device.registers = registers(child)?,
            _ => {}
        }
    }
    if let Some(info) = element.child("Info") {
        about(info, &mut device).map_err(|error| error.within("Info"))?;
    }
    for profile in element.children("Profile") {
        device.profile = profile.child_number("ProfileNo")?.unwrap_or(device.profile);
        if let Some(dictionary) = profile.child("Dictionary") {
            device.objects.extend(objects(dictionary, &mut notes));
        }
        device.diagnosis_texts.extend(diagnosis_texts(profile, &mut notes));
        let file = profile.child_text("DictionaryFile");
        if !file.is_empty() {
            device.dictionary_file = Some(file.to_owned());
        }
    }
    device.notes = notes;
    Ok(device)
}

/// Texts of diagnosis messages: element `DiagMessages` (ETG.2000). One whose number cannot be read is
/// left out, with the reason in `notes`.
fn diagnosis_texts(profile: &Element, notes: &mut Vec<EsiError>) -> Vec<(u16, String)> {
    let all = profile.children("DiagMessages").flat_map(|all| all.children("DiagMessage"));
    let mut texts = Vec::new();
    for message in all {
        match message.child_number("TextId") {
            Ok(Some(id)) => {
                texts.push((id, message.in_language("MessageText", super::ENGLISH).to_owned()));
            }
            Ok(None) => {}
            Err(error) => notes.push(error.within("DiagMessages")),
        }
    }
    texts
}

/// Attribute `CheckRevisionNo` of element `Type`. A word that ETG.2000 does not know is passed over, which
/// is told in `notes`.
fn revision_rule(kind: &Element, notes: &mut Vec<EsiError>) -> Option<RevisionRule> {
    let word = kind.attribute("CheckRevisionNo").filter(|word| !word.is_empty())?;
    let rule = RevisionRule::from_esi(word);
    if rule.is_none() {
        let reason = format!(
            "CheckRevisionNo \"{word}\", expected EQ, EQ_OR_G, LW_EQ, LW_EQ_HW_EQ_OR_G, HW_EQ or HW_EQ_OR_G"
        );
        notes.push(kind.error(reason));
    }
    rule
}

/// Whether all its sync units (elements `Su`) allow frames that are sent twice; no where it has none.
fn frame_repeat(element: &Element) -> Result<bool, EsiError> {
    let mut all = None;
    for unit in element.children("Su") {
        all = Some(all.unwrap_or(true) & unit.flag("FrameRepeatSupport")?);
    }
    Ok(all.unwrap_or(false))
}

fn names(element: &Element) -> Result<Vec<(u32, String)>, EsiError> {
    let name = |child: &Element| {
        Ok((child.attribute_number("LcId")?.unwrap_or(0), child.text().to_owned()))
    };
    element.children("Name").map(name).collect()
}

/// What its ports are: attribute `Physics`, a letter for each from A on, a blank for one that is not
/// there; else `Info/Port`. `Y` is for cables, `K` the E-bus; `H` is a fast hot connect port.
fn ports(element: &Element) -> Result<PortMap<PortKind>, EsiError> {
    // White space at the ends of an attribute stands for ports, too.
    if let Some(letters) = element.raw("Physics").filter(|text| !text.trim().is_empty()) {
        return physics(letters).map_err(|reason| element.error(reason));
    }
    let mut ports = PortMap::default();
    let mut put = |place: usize, kind| match ports.0.get_mut(place) {
        Some(port) => {
            *port = kind;
            Ok(())
        }
        None => Err(element.error("more than four ports")),
    };
    let listed = element.child("Info").into_iter().flat_map(|info| info.children("Port"));
    for (place, port) in listed.enumerate() {
        let kind = match port.child_text("Type") {
            "MII" | "RMII" | "RGMII" => PortKind::Mii,
            "EBUS" => PortKind::EBus,
            _ => PortKind::None,
        };
        put(place, kind)?;
    }
    Ok(ports)
}

/// The ports that the letters of `Physics` stand for.
pub(crate) fn physics(letters: &str) -> Result<PortMap<PortKind>, String> {
    let mut ports = PortMap::default();
    for (place, letter) in letters.chars().enumerate() {
        let kind = match letter {
            'Y' | 'y' | 'L' => PortKind::Mii,
            'K' | 'k' => PortKind::EBus,
            'H' | 'h' => PortKind::FastHotConnect,
            ' ' | '-' => PortKind::None,
            other => {
                return Err(format!("Physics \"{letters}\": '{other}', expected Y, K or H"));
            }
        };
        *ports.0.get_mut(place).ok_or("more than four ports")? = kind;
    }
    Ok(ports)
}

/// The letters that stand for ports: `Y` for one of whatever kind with a cable, `-` for none.
pub(crate) fn letters(ports: &PortMap<PortKind>) -> String {
    let letter = |kind: &PortKind| match kind {
        PortKind::None => '-',
        PortKind::Mii | PortKind::Other(_) => 'Y',
        PortKind::EBus => 'K',
        PortKind::FastHotConnect => 'H',
    };
    ports.0.iter().map(letter).collect()
}

fn about(info: &Element, device: &mut EsiDevice) -> Result<(), EsiError> {
    if let Some(electrical) = info.child("Electrical") {
        device.ebus_current_ma = electrical.child_number("EBusCurrent")?;
    }
    device.identification_address = info.child_number("IdentificationAdo")?.map(RegisterAddress);
    let by_al_status = info.child_text("IdentificationReg134");
    device.identification_by_al_status = matches!(by_al_status, "1" | "true");
    let timeout = |path: &str, name: &str| match info.at(path) {
        Some(timeout) => timeout.child_number(name).map(|value| value.unwrap_or(0)),
        None => Ok(0),
    };
    device.timeouts = EsiTimeouts {
        preop_ms: timeout("StateMachine/Timeout", "PreopTimeout")?,
        safeop_op_ms: timeout("StateMachine/Timeout", "SafeopOpTimeout")?,
        back_to_init_ms: timeout("StateMachine/Timeout", "BackToInitTimeout")?,
        back_to_safeop_ms: timeout("StateMachine/Timeout", "BackToSafeopTimeout")?,
        mailbox_request_ms: timeout("Mailbox/Timeout", "RequestTimeout")?,
        mailbox_response_ms: timeout("Mailbox/Timeout", "ResponseTimeout")?,
    };
    if let Some(controller) = info.child("EtherCATController") {
        device.controller = EsiController {
            ram_bytes: controller.child_number("DpramSize")?.unwrap_or(0),
            sync_managers: controller.child_number("SmCount")?.unwrap_or(0),
            fmmus: controller.child_number("FmmuCount")?.unwrap_or(0),
        };
    }
    for mapping in info
        .at("VendorSpecific/TwinCAT")
        .into_iter()
        .flat_map(|element| element.children("AlternativeSmMapping"))
    {
        device.alternatives.push(EsiAlternative {
            name: mapping.child_text("Name").to_owned(),
            is_default: mapping.flag("Default")?,
            assignments: mapping.children("Sm").map(assignment).collect::<Result<_, _>>()?,
        });
    }
    Ok(())
}

/// Registers to write: elements such as `Reg0420`, named by their address.
fn registers(element: &Element) -> Result<Vec<(RegisterAddress, u32)>, EsiError> {
    let mut registers = Vec::new();
    for child in &element.children {
        let address =
            child.name.strip_prefix("Reg").and_then(|hex| u16::from_str_radix(hex, 16).ok());
        if let Some(address) = address {
            registers.push((RegisterAddress(address), child.number()?));
        }
    }
    Ok(registers)
}

/// A SyncManager and the PDOs that are assigned to it.
fn assignment(element: &Element) -> Result<(u8, Vec<u16>), EsiError> {
    let number = element.attribute_number("No")?.unwrap_or(0);
    let pdos = element.children("Pdo").map(Element::number).collect::<Result<_, _>>()?;
    Ok((number, pdos))
}
