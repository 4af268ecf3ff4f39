//! Start-up commands of protocols beside CoE: elements `InitCmd` of `EoE` and `SoE`, in device descriptions
//! (ETG.2000) and in network configurations (ETG.2100), which name them alike.

use linesman_proto::mailbox::eoe::IpParameters;
use linesman_proto::mailbox::soe::{Idn, VALUE};

use super::error::EsiError;
use super::value;
use super::xml::Element;
use crate::project::ethernet::doubt;
use crate::start_up::{StartUpAction, StartUpCommand, Transition};

/// The message that sets addresses, of EoE.
const SET_IP: u8 = 2;
/// The operation that writes, of SoE.
const WRITE: u8 = 3;

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
