//! The mailbox and its protocols: element `Mailbox` (ETG.2000).

use linesman_proto::sii::{CoeDetails, Protocols};

use super::error::EsiError;
use super::xml::Element;
use super::{setting, value};
use crate::start_up::StartUpCommand;

/// What a mailbox speaks.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct EsiMailbox {
    /// Its protocols.
    pub protocols: Protocols,
    /// What its CoE can do.
    pub coe: CoeDetails,
    /// It repeats lost messages.
    pub data_link_layer: bool,
    /// Number of SoE channels.
    pub soe_channels: u8,
    /// Number of CiA 402 channels; 0 where nothing is said.
    pub ds402_channels: u8,
    /// What a MainDevice is to write when it starts the device.
    pub commands: Vec<InitCommand>,
    /// The same by other protocols.
    pub settings: Vec<StartUpCommand>,
    /// Commands that cannot be carried out: protocol, and how many.
    pub left_out: Vec<(&'static str, usize)>,
}

/// A CoE download at start-up.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct InitCommand {
    /// Transitions at which it is due, such as `PS`.
    pub transitions: Vec<String>,
    /// Index of the object.
    pub index: u16,
    /// Its subindex.
    pub subindex: u8,
    /// Complete access.
    pub complete_access: bool,
    /// What is written.
    pub data: Vec<u8>,
}

/// The mailbox of an element `Mailbox`.
pub(super) fn mailbox(element: &Element) -> Result<EsiMailbox, EsiError> {
    let mut mailbox =
        EsiMailbox { data_link_layer: element.flag("DataLinkLayer")?, ..EsiMailbox::default() };
    for (name, bit) in [
        ("AoE", Protocols::AOE),
        ("EoE", Protocols::EOE),
        ("CoE", Protocols::COE),
        ("FoE", Protocols::FOE),
        ("SoE", Protocols::SOE),
        ("VoE", Protocols::VOE),
    ] {
        if element.child(name).is_some() {
            mailbox.protocols.0 |= bit;
        }
    }
    if let Some(soe) = element.child("SoE") {
        mailbox.soe_channels = soe.attribute_number("ChannelCount")?.unwrap_or(1);
    }
    if let Some(coe) = element.child("CoE") {
        mailbox.coe = details(coe)?;
        mailbox.ds402_channels = coe.attribute_number("DS402Channels")?.unwrap_or(0);
        for command in coe.children("InitCmd") {
            mailbox.commands.push(init_command(command).map_err(|error| error.within("CoE"))?);
        }
    }
    for (protocol, read) in [
        ("EoE", setting::ethernet as fn(&Element) -> _),
        ("SoE", setting::drive),
        ("AoE", setting::ads),
        ("FoE", setting::file),
        ("VoE", setting::vendor),
    ] {
        let Some(commands) = element.child(protocol) else { continue };
        let mut left_out = 0;
        for command in commands.children("InitCmd").filter(|one| setting::is_on(one)) {
            match read(command).map_err(|error| error.within(protocol))? {
                Some(commands) => mailbox.settings.extend(commands),
                None => left_out += 1,
            }
        }
        if left_out > 0 {
            mailbox.left_out.push((protocol, left_out));
        }
    }
    Ok(mailbox)
}

/// Category General, byte 5. Every device with CoE takes SDOs.
fn details(coe: &Element) -> Result<CoeDetails, EsiError> {
    let mut details = 0x01;
    for (attribute, bit) in [
        ("SdoInfo", 0x02),
        ("PdoAssign", 0x04),
        ("PdoConfig", 0x08),
        ("PdoUpload", 0x10),
        ("CompleteAccess", 0x20),
    ] {
        if coe.flag(attribute)? {
            details |= bit;
        }
    }
    Ok(CoeDetails(details))
}

pub(super) fn init_command(element: &Element) -> Result<InitCommand, EsiError> {
    let data = element.child("Data").map_or(Ok(Vec::new()), |data| {
        value::bytes(data.text()).map_err(|reason| data.error(reason).within("InitCmd"))
    })?;
    let index = element.child_number("Index")?.ok_or_else(|| element.error("it has no Index"))?;
    Ok(InitCommand {
        transitions: element.children("Transition").map(|one| one.text().to_owned()).collect(),
        index,
        subindex: element.child_number("SubIndex")?.unwrap_or(0),
        complete_access: element.flag("CompleteAccess")?,
        data,
    })
}
