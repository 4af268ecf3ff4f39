//! Start-up commands of a SubDevice between states, beside what every SubDevice is told: values of
//! its objects and registers.
//!
//! Such commands stand in project files, in device descriptions (`InitCmd`, ETG.2000) and in ENI files
//! (ETG.2100); the MainDevice executes them at their transition, in the order of the plan.

use std::fmt;

use linesman_proto::address::RegisterAddress;
use linesman_proto::ads::{AdsCommand, AdsRequest, AmsAddress, AmsNetId, index};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::mailbox::eoe::IpParameters;
use linesman_proto::mailbox::soe::Idn;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

/// One command.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct StartUpCommand {
    /// When it is executed.
    pub transition: Transition,
    /// What is done.
    pub action: StartUpAction,
    /// What it is for, in the words of whoever wrote it; may be empty.
    pub comment: String,
}

/// What a start-up command does.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum StartUpAction {
    /// Brings a value to an object by CoE. It needs an open mailbox, so that a command of INIT to PREOP
    /// is executed as soon as PREOP is reached, all others before the new state is asked for.
    CoeDownload {
        /// Which object; with complete access its first subindex, 0 or 1.
        object: ObjectAddress,
        /// The whole object in one transfer.
        complete_access: bool,
        /// The value as it is transferred, little-endian.
        data: Vec<u8>,
    },
    /// Sets the addresses of an Ethernet port by EoE; when, as for CoE.
    SetAddresses {
        /// Which port of the device.
        port: u8,
        /// The addresses as the message carries them: which there are, and those.
        parameters: Vec<u8>,
    },
    /// Writes an identification number of a drive by SoE; when, as for CoE.
    WriteIdn {
        /// Which drive of the device.
        drive: u8,
        /// Which number.
        idn: Idn,
        /// Which of its elements; 0x40 is its value.
        elements: u8,
        /// What is written.
        data: Vec<u8>,
    },
    /// Asks by ADS (AoE), such as for the NetId that the device is to have; when, as for CoE.
    Ads {
        /// Receiver.
        target: AmsAddress,
        /// Sender.
        source: AmsAddress,
        /// Command of ADS.
        command: AdsCommand,
        /// Bytes behind the AMS header.
        data: Vec<u8>,
    },
    /// Brings a file by FoE; when, as for CoE.
    WriteFile {
        /// As the device is to know it.
        name: String,
        /// 0 for none.
        password: u32,
        /// The file.
        data: Vec<u8>,
    },
    /// Sends a message of the vendor's own protocol (VoE); when, as for CoE.
    SendVendorMessage {
        /// Bytes behind the mailbox header.
        data: Vec<u8>,
        /// Time in which an answer is waited for, which need not come.
        answer_within: Span,
    },
    /// Writes registers of the controller, before the new state is asked for.
    RegisterWrite {
        /// The first one.
        address: RegisterAddress,
        /// What is written.
        data: Vec<u8>,
    },
}

impl StartUpAction {
    /// The command that gives a SubDevice its NetId, for AoE. The MainDevice that sends it is that of this computer.
    #[must_use]
    pub fn set_net_id(net_id: AmsNetId) -> Self {
        let main_device = AmsNetId::of_main_device([127, 0, 0, 1]);
        let address = |net_id| AmsAddress { net_id, port: AmsAddress::MAIN_DEVICE_PORT };
        let (group, offset) = (index::OWN_NET_ID, index::OWN_NET_ID_OFFSET);
        let (_, data) = AdsRequest::Write { group, offset, data: &net_id.0 }.to_bytes();
        let (target, source) = (address(net_id), address(main_device));
        Self::Ads { target, source, command: AdsCommand::Write, data }
    }

    /// The NetId that the command gives; `None` for any other command.
    #[must_use]
    pub fn net_id(&self) -> Option<AmsNetId> {
        let Self::Ads { command, data, .. } = self else { return None };
        match AdsRequest::parse(command.number(), data) {
            Ok(AdsRequest::Write {
                group: index::OWN_NET_ID,
                offset: index::OWN_NET_ID_OFFSET,
                data,
            }) => data.try_into().ok().map(AmsNetId),
            _ => None,
        }
    }
}

/// What is told of start-up commands that are not carried out: whose, how many, which (where they have
/// names), and what follows.
#[must_use]
pub fn left_out(device: &str, protocol: &str, count: usize, names: &[String]) -> String {
    let what = match count {
        1 => "1 start-up command".to_owned(),
        count => format!("{count} start-up commands"),
    };
    let which = if names.is_empty() { String::new() } else { format!(" ({})", names.join(", ")) };
    format!(
        "{device}: {what} by {protocol}{which} not carried out: no message that can be sent at start-up, and the \
         SubDevice keeps the settings it has; make them with the maker's tool, or by CoE where it has objects \
         for them"
    )
}

/// A step between states, as ENI and ESI name it by two letters.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Transition {
    /// The state that is left.
    pub from: AlState,
    /// The state that is asked for.
    pub to: AlState,
}

impl Transition {
    /// INIT to PREOP.
    pub const INIT_TO_PRE_OP: Self = Self { from: AlState::Init, to: AlState::PreOp };
    /// PREOP to SAFEOP.
    pub const PRE_OP_TO_SAFE_OP: Self = Self { from: AlState::PreOp, to: AlState::SafeOp };
    /// SAFEOP to OP.
    pub const SAFE_OP_TO_OP: Self = Self { from: AlState::SafeOp, to: AlState::Op };

    /// The transition that two letters mean: "IP", "PS", "SO", "IB". `None` for any other text.
    #[must_use]
    pub fn from_letters(letters: &str) -> Option<Self> {
        let state = |letter: char| match letter {
            'I' => Some(AlState::Init),
            'P' => Some(AlState::PreOp),
            'S' => Some(AlState::SafeOp),
            'O' => Some(AlState::Op),
            'B' => Some(AlState::Boot),
            _ => None,
        };
        let mut letters = letters.chars();
        let (from, to) = (state(letters.next()?)?, state(letters.next()?)?);
        letters.next().is_none().then_some(Self { from, to })
    }

    /// Its two letters.
    #[must_use]
    pub fn letters(self) -> String {
        let letter = |state: AlState| match state {
            AlState::Init => 'I',
            AlState::PreOp => 'P',
            AlState::SafeOp => 'S',
            AlState::Op => 'O',
            AlState::Boot => 'B',
        };
        [letter(self.from), letter(self.to)].iter().collect()
    }

    /// Whether CoE commands of this step wait for the new state: there is no mailbox before it.
    #[must_use]
    pub fn opens_mailbox(self) -> bool {
        !self.from.has_mailbox() && self.to.has_mailbox()
    }
}

impl fmt::Display for Transition {
    /// "INIT to PREOP".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.from, self.to)
    }
}

impl fmt::Display for StartUpCommand {
    /// What it does, and its comment: `0x1C12:00 = 02 00, complete access (PDO assignment)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (data, complete) = match &self.action {
            StartUpAction::CoeDownload { object, complete_access, data } => {
                write!(f, "{object} =")?;
                (data, *complete_access)
            }
            StartUpAction::SetAddresses { port, parameters } => {
                write!(f, "addresses of Ethernet port {port} by EoE")?;
                if let Some([a, b, c, d]) = IpParameters::parse(parameters).and_then(|all| all.ip) {
                    write!(f, ", IP {a}.{b}.{c}.{d}")?;
                }
                f.write_str(":")?;
                (parameters, false)
            }
            StartUpAction::WriteIdn { drive, idn, data, .. } => {
                write!(f, "{idn} of drive {drive} by SoE =")?;
                (data, false)
            }
            StartUpAction::Ads { target, command, data, .. } => {
                match self.action.net_id() {
                    Some(net_id) => write!(f, "NetId {net_id} by AoE:")?,
                    None => write!(f, "ADS {command} to {target} by AoE:")?,
                }
                (data, false)
            }
            StartUpAction::WriteFile { name, data, .. } => {
                write!(f, "file `{name}` by FoE =")?;
                (data, false)
            }
            StartUpAction::SendVendorMessage { data, .. } => {
                f.write_str("message of the vendor by VoE:")?;
                (data, false)
            }
            StartUpAction::RegisterWrite { address, data } => {
                write!(f, "register {address} =")?;
                (data, false)
            }
        };
        // A long value is told by its beginning.
        const SHOWN: usize = 16;
        for byte in data.iter().take(SHOWN) {
            write!(f, " {byte:02X}")?;
        }
        if data.len() > SHOWN {
            write!(f, " ... ({} bytes)", data.len())?;
        }
        if complete {
            f.write_str(", complete access")?;
        }
        if !self.comment.is_empty() {
            write!(f, " ({})", self.comment)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_name_transitions() {
        assert_eq!(Transition::from_letters("PS"), Some(Transition::PRE_OP_TO_SAFE_OP));
        assert_eq!(Transition::from_letters("IP").map(Transition::letters), Some("IP".to_owned()));
        for wrong in ["", "P", "PX", "PSO", "ps"] {
            assert_eq!(Transition::from_letters(wrong), None, "{wrong}");
        }
        assert!(Transition::INIT_TO_PRE_OP.opens_mailbox());
        assert!(!Transition::PRE_OP_TO_SAFE_OP.opens_mailbox());
        assert_eq!(Transition::SAFE_OP_TO_OP.to_string(), "SAFEOP to OP");
    }

    #[test]
    fn a_command_says_what_it_does() {
        let command = StartUpCommand {
            transition: Transition::PRE_OP_TO_SAFE_OP,
            action: StartUpAction::CoeDownload {
                object: ObjectAddress::new(0x1C12, 0),
                complete_access: true,
                data: vec![1, 0, 0, 0x16],
            },
            comment: "PDO assignment".to_owned(),
        };
        let text = command.to_string();
        assert!(text.ends_with("= 01 00 00 16, complete access (PDO assignment)"), "{text}");
        let command = StartUpCommand {
            action: StartUpAction::RegisterWrite {
                address: RegisterAddress(0x0420),
                data: vec![0; 20],
            },
            comment: String::new(),
            ..command
        };
        let text = command.to_string();
        assert!(
            text.starts_with("register 0x0420 = 00 00") && text.ends_with("(20 bytes)"),
            "{text}"
        );
    }
}
