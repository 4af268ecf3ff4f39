//! Start-up commands of protocols beside CoE: elements `InitCmd` of `EoE`, `SoE`, `AoE`, `FoE` and `VoE`, in device descriptions
//! (ETG.2000) and in network configurations (ETG.2100), which name them alike.

use linesman_proto::ads::{AdsCommand, AmsHeader};
use linesman_proto::mailbox::eoe::IpParameters;
use linesman_proto::mailbox::soe::{Idn, VALUE};
use linesman_proto::time::Span;

use super::error::EsiError;
use super::value;
use super::xml::Element;
use crate::project::ethernet::doubt;
use crate::start_up::{StartUpAction, StartUpCommand, Transition};

/// The message that sets addresses, of EoE.
const SET_IP: u8 = 2;
/// The operation that writes, of SoE.
const WRITE: u8 = 3;

/// The request to write, of FoE.
const WRITE_FILE: u8 = 2;
/// The longest time that an answer to a message of VoE is waited for.
const LONGEST_TIMEOUT: Span = Span::s(10);

/// Whether a command is switched on.
pub(crate) fn is_on(command: &Element) -> bool {
    !matches!(command.child_text("Disabled"), "1" | "true")
}

/// A command of EoE, once for each of its transitions; `None` for one that sets no addresses.
pub(crate) fn ethernet(command: &Element) -> Result<Option<Vec<StartUpCommand>>, EsiError> {
    if command.child_number::<u8>("Type")?.unwrap_or(SET_IP) != SET_IP {
        return Ok(None);
    }
    let parameters = data(command)?;
    if parameters.is_empty() {
        return Ok(None);
    }
    let Some(addresses) = IpParameters::parse(&parameters) else {
        return Err(command.error("its Data are no IP parameters: flags, then what they announce"));
    };
    if let Some(why) = doubt(&addresses) {
        return Err(command.error(why));
    }
    at_transitions(command, &StartUpAction::SetAddresses { port: 0, parameters }).map(Some)
}

/// A command of SoE, once for each of its transitions; `None` for one that does not write, or names no
/// number.
pub(crate) fn drive(command: &Element) -> Result<Option<Vec<StartUpCommand>>, EsiError> {
    if command.child_number::<u8>("OpCode")?.unwrap_or(WRITE) != WRITE {
        return Ok(None);
    }
    let text = command.child_text("IDN");
    let idn = match Idn::from_text(text) {
        Some(idn) => idn,
        None => match command.child_number("IDN")? {
            Some(number) => Idn(number),
            None => return Ok(None),
        },
    };
    let channel = match command.child_number::<u8>("DriveNo")? {
        Some(drive) => drive,
        None => command.attribute_number("Chn")?.unwrap_or(0),
    };
    if channel > 7 {
        return Err(command.error(format!("drive {channel}, expected 0 to 7")));
    }
    let elements = command.child_number("Elements")?.unwrap_or(VALUE);
    let data = data(command)?;
    let action = StartUpAction::WriteIdn { drive: channel, idn, elements, data };
    at_transitions(command, &action).map(Some)
}

/// A command of AoE, once for each of its transitions; `None` for one whose data are no request of ADS: AMS header and
/// what follows it.
pub(crate) fn ads(command: &Element) -> Result<Option<Vec<StartUpCommand>>, EsiError> {
    let message = data(command)?;
    let Ok((header, data)) = AmsHeader::parse(&message) else { return Ok(None) };
    let Some(asked) = AdsCommand::from_number(header.command).filter(|_| header.is_request())
    else {
        return Ok(None);
    };
    let (target, source, data) = (header.target, header.source, data.to_vec());
    let action = StartUpAction::Ads { target, source, command: asked, data };
    at_transitions(command, &action).map(Some)
}

/// A command of FoE, once for each of its transitions; `None` for one that does not bring a file, or names none.
pub(crate) fn file(command: &Element) -> Result<Option<Vec<StartUpCommand>>, EsiError> {
    let name = command.child_text("Name");
    if command.child_number::<u8>("OpCode")?.unwrap_or(WRITE_FILE) != WRITE_FILE || name.is_empty()
    {
        return Ok(None);
    }
    let (name, data) = (name.to_owned(), data(command)?);
    let password = command.child_number("Password")?.unwrap_or(0);
    at_transitions(command, &StartUpAction::WriteFile { name, password, data }).map(Some)
}

/// A command of VoE, once for each of its transitions; `None` for one without data. An answer is waited for as long as
/// its `Timeout` says, in ms.
pub(crate) fn vendor(command: &Element) -> Result<Option<Vec<StartUpCommand>>, EsiError> {
    let data = data(command)?;
    if data.is_empty() {
        return Ok(None);
    }
    let timeout = command.child_number::<u32>("Timeout")?.unwrap_or(0);
    let answer_within = Span::ms(u64::from(timeout)).min(LONGEST_TIMEOUT);
    at_transitions(command, &StartUpAction::SendVendorMessage { data, answer_within }).map(Some)
}

fn data(command: &Element) -> Result<Vec<u8>, EsiError> {
    command.child("Data").map_or(Ok(Vec::new()), |data| {
        value::bytes(data.text()).map_err(|reason| data.error(reason))
    })
}

fn at_transitions(
    command: &Element,
    action: &StartUpAction,
) -> Result<Vec<StartUpCommand>, EsiError> {
    let comment = command.child_text("Comment");
    let comment = comment.split_whitespace().collect::<Vec<_>>().join(" ");
    let at = |one: &Element| {
        let transition = Transition::from_letters(one.text()).ok_or_else(|| {
            let wrong = one.text();
            one.error(format!("\"{wrong}\", expected two of the letters I, P, S, O, B"))
        })?;
        Ok(StartUpCommand { transition, action: action.clone(), comment: comment.clone() })
    };
    command.children("Transition").map(at).collect()
}
