//! Elements `InitCmd`: register accesses at transitions.

use linesman_proto::command::Command;

use crate::xml_writer::{Xml, hex};

/// Whom a command is for.
#[derive(Clone, Copy)]
pub(super) enum Target {
    All,
    Position(u16),
    Station(u16),
}

impl Target {
    /// The command that writes to it, and the one that reads from it.
    pub(super) fn commands(self) -> (Command, Command) {
        match self {
            Self::All => (Command::Bwr, Command::Brd),
            Self::Position(_) => (Command::Apwr, Command::Aprd),
            Self::Station(_) => (Command::Fpwr, Command::Fprd),
        }
    }
}

/// A command.
pub(super) struct Init<'a> {
    pub(super) comment: &'a str,
    pub(super) transitions: &'a [&'a str],
    pub(super) target: Target,
    pub(super) register: u16,
    /// Sent before those of the SubDevices.
    pub(super) before: bool,
    /// It must be executed.
    pub(super) counted: bool,
    /// What must come back, which bits of it count, and how long that may take, in ms.
    pub(super) validate: Option<(Vec<u8>, Vec<u8>, u32)>,
}

impl<'a> Init<'a> {
    pub(super) fn new(
        comment: &'a str,
        transitions: &'a [&'a str],
        target: Target,
        register: u16,
    ) -> Self {
        let (before, counted, validate) = (false, false, None);
        Self { comment, transitions, target, register, before, counted, validate }
    }
}

/// Longer data of zeros are written as their length.
const SHORT: usize = 32;

pub(super) fn command(xml: &mut Xml, init: &Init<'_>, command: Command, data: &[u8]) {
    xml.element("InitCmd", &[], |xml| {
        for transition in init.transitions {
            xml.text("Transition", transition);
        }
        if init.before {
            xml.text("BeforeSlave", 1);
        }
        xml.text("Comment", init.comment);
        xml.text("Requires", "cycle");
        xml.text("Cmd", command.code());
        xml.text(
            "Adp",
            match init.target {
                Target::All => 0,
                Target::Position(address) | Target::Station(address) => address,
            },
        );
        xml.text("Ado", init.register);
        if data.len() > SHORT && data.iter().all(|byte| *byte == 0) {
            xml.text("DataLength", data.len());
        } else {
            xml.text("Data", hex(data));
        }
        if init.counted {
            xml.text("Cnt", 1);
        }
        xml.text("Retries", 3);
        if let Some((data, mask, timeout)) = &init.validate {
            xml.element("Validate", &[], |xml| {
                xml.text("Data", hex(data));
                if !mask.is_empty() {
                    xml.text("DataMask", hex(mask));
                }
                xml.text("Timeout", timeout);
            });
        }
    });
}
