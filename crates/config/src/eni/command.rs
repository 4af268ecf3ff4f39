//! Commands at transitions: elements `InitCmd` (ETG.2100).

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::Command;
use linesman_proto::mailbox::coe::ObjectAddress;

use super::clean;
use crate::esi::EsiError;
use crate::esi::value;
use crate::esi::xml::Element;
use crate::start_up::{StartUpAction, StartUpCommand, Transition};

/// A register access.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct RegisterCommand {
    pub(super) line: u32,
    pub(super) transitions: Vec<Transition>,
    pub(super) command: Command,
    /// Whom it means: position, station address or alias, as its command has it.
    pub(super) adp: u16,
    pub(super) address: RegisterAddress,
    pub(super) data: Vec<u8>,
    /// What must come back, and which bits of it count; empty: all.
    pub(super) validate: Option<(Vec<u8>, Vec<u8>)>,
    pub(super) comment: String,
}

impl RegisterCommand {
    pub(super) fn writes(&self) -> bool {
        matches!(self.command, Command::Apwr | Command::Fpwr | Command::Bwr)
    }

    pub(super) fn at(&self, transition: Transition) -> bool {
        self.transitions.contains(&transition)
    }
}

fn transitions(element: &Element) -> Result<Vec<Transition>, EsiError> {
    let letters = element.children("Transition");
    letters
        .map(|one| {
            Transition::from_letters(one.text()).ok_or_else(|| {
                let wrong = one.text();
                one.error(format!("\"{wrong}\", expected two of the letters I, P, S, O, B"))
            })
        })
        .collect()
}

/// Bytes of a child; none when it is not there.
fn bytes(element: &Element, name: &str) -> Result<Vec<u8>, EsiError> {
    match element.child(name) {
        None => Ok(Vec::new()),
        Some(child) => value::bytes(child.text()).map_err(|reason| child.error(reason)),
    }
}

/// The register accesses of a list of commands; `None` for one with a logical address.
pub(super) fn register(element: &Element) -> Result<Option<RegisterCommand>, EsiError> {
    let code: u8 = element.child_number("Cmd")?.ok_or_else(|| element.error("it has no Cmd"))?;
    let command = Command::from_code(code)
        .ok_or_else(|| element.error(format!("Cmd {code}, expected a command, 0 to 14")))?;
    let Some(address) = element.child_number("Ado")? else { return Ok(None) };
    let mut data = bytes(element, "Data")?;
    if data.is_empty()
        && let Some(len) = element.child_number::<u16>("DataLength")?
    {
        data = vec![0; usize::from(len)];
    }
    let validate = match element.child("Validate") {
        None => None,
        Some(validate) => Some((bytes(validate, "Data")?, bytes(validate, "DataMask")?)),
    };
    Ok(Some(RegisterCommand {
        line: element.line,
        transitions: transitions(element)?,
        command,
        adp: element.child_number("Adp")?.unwrap_or(0),
        address: RegisterAddress(address),
        data,
        validate,
        comment: clean(element.child_text("Comment")),
    }))
}

/// A CoE download, once for each of its transitions. Nothing for one that is switched off, and for one
/// that only reads.
pub(super) fn coe(element: &Element) -> Result<Vec<StartUpCommand>, EsiError> {
    if matches!(element.child_text("Disabled"), "1" | "true") {
        return Ok(Vec::new());
    }
    let index = element.child_number("Index")?.ok_or_else(|| element.error("it has no Index"))?;
    let subindex = element.child_number("SubIndex")?.unwrap_or(0);
    let data = bytes(element, "Data")?;
    if data.is_empty() {
        return Ok(Vec::new());
    }
    let complete_access = element.flag("CompleteAccess")?;
    let comment = clean(element.child_text("Comment"));
    let at = |transition| StartUpCommand {
        transition,
        action: StartUpAction::CoeDownload {
            object: ObjectAddress::new(index, subindex),
            complete_access,
            data: data.clone(),
        },
        comment: comment.clone(),
    };
    Ok(transitions(element)?.into_iter().map(at).collect())
}
