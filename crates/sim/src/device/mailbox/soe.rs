//! SoE server of a drive: elements of its IDNs read and written, procedure commands executed.
//!
//! Reference: ETG.1000.6, SoE (header, fragments and error codes: the first digit of a code is the number of the element);
//! IEC 61800-7-204 for IDNs and procedure commands. The device has one drive, the first.

pub(in crate::device) mod parameter;
#[cfg(test)]
mod tests;

use linesman_proto::mailbox::soe::{
    ATTRIBUTE, CommandProgress, CommandState, DATA_STATE, ELEMENTS, Idn, LIST_HEADER_LEN, MAXIMUM,
    MINIMUM, Message, NAME, Operation, SOE_HEADER_LEN, UNIT, VALUE, ValueLength, VariableData,
};
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use self::parameter::{DriveParameter, ValueSource, WriteRule, of_variable_length};
use super::{Answers, Served};
use crate::device::dictionary::Dictionary;

/// There is no such IDN.
const NO_IDN: u16 = 0x1001;
/// An element that is not there at all, or several where one is meant.
const NO_ELEMENT: u16 = 0x1009;
/// It has no unit, no minimum, no maximum.
const NO_UNIT: u16 = 0x4001;
const NO_MINIMUM: u16 = 0x5001;
const NO_MAXIMUM: u16 = 0x6001;
/// Codes of the value.
const TOO_SHORT: u16 = 0x7002;
const TOO_LONG: u16 = 0x7003;
const FIXED: u16 = 0x7004;
const PROTECTED: u16 = 0x7005;
const BELOW_MINIMUM: u16 = 0x7006;
const ABOVE_MAXIMUM: u16 = 0x7007;
const NOT_SUPPORTED: u16 = 0x7008;
const CYCLIC: u16 = 0x700A;
const COMMAND_ACTIVE: u16 = 0x7010;
const NOT_INTERRUPTED: u16 = 0x7011;

/// The longest value, with the bytes in front of it; nothing is collected beyond.
const LONGEST_WRITE: usize = LIST_HEADER_LEN + 0xFFFF;
/// Bits of the status word S-0-0135 that tell how far the axis is, and the value "in operation".
const STATUS_AT: u32 = 14;
const IN_OPERATION: u64 = 3;
/// S-0-0135.
const STATUS: Idn = Idn(135);
/// P-0-0160: fails unless the axis is enabled.
const CALIBRATE: Idn = Idn(0x8000 | 160);

/// The server.
#[derive(Debug, Default)]
pub(super) struct SoeServer {
    /// Fragments of a write that is not complete.
    write: Option<PartialWrite>,
    /// Procedure commands that were set.
    commands: Vec<SetCommand>,
}

#[derive(Debug)]
struct PartialWrite {
    drive: u8,
    elements: u8,
    data: Vec<u8>,
}

#[derive(Debug)]
struct SetCommand {
    idn: Idn,
    /// The value written.
    word: u16,
    since: Instant,
    /// It cannot be executed.
    failed: bool,
    /// The MainDevice was notified of its end.
    notified: bool,
}

impl SoeServer {
    /// The messages that answer a request, each with at most `room` bytes; none to what asks for none.
    pub(super) fn answer(
        &mut self,
        request: &[u8],
        now: Instant,
        served: &mut Served<'_>,
        room: usize,
    ) -> Answers {
        let Some(message) = Message::parse(request) else { return Vec::new() };
        let earlier = self.write.take();
        let (operation, result) = match message.operation {
            Operation::WriteRequest => {
                let write = PartialWrite::after(earlier, &message);
                // Of a write in several messages the last is answered.
                if message.incomplete {
                    self.write = Some(write);
                    return Vec::new();
                }
                let written = self.write(&message, &write.data, now, served);
                (Operation::WriteResponse, written.map(|()| Vec::new()))
            }
            Operation::ReadRequest => {
                (Operation::ReadResponse, self.read(&message, now, served.dictionary))
            }
            Operation::ReadResponse
            | Operation::WriteResponse
            | Operation::Notification
            | Operation::Emergency
            | Operation::Reserved(_) => return Vec::new(),
        };
        let begin = Message { operation, incomplete: false, data: &[], ..message };
        match result {
            Err(code) => vec![write(&Message { error: true, data: &code.to_le_bytes(), ..begin })],
            Ok(data) if data.is_empty() => vec![write(&begin)],
            Ok(data) => fragments(&begin, &data, room),
        }
    }

    /// The next notification that a procedure command has ended.
    pub(super) fn poll_notification(&mut self, now: Instant) -> Option<Vec<u8>> {
        let ended = self.commands.iter_mut().filter(|command| !command.notified);
        let (command, progress) = ended
            .map(|command| {
                let progress = command.progress(command.takes(), now);
                (command, progress)
            })
            .find(|(_, progress)| progress.has_ended())?;
        command.notified = true;
        let state = CommandState::of(progress).0.to_le_bytes();
        Some(write(&Message {
            operation: Operation::Notification,
            incomplete: false,
            error: false,
            drive: 0,
            elements: DATA_STATE,
            number: command.idn.0,
            data: &state,
        }))
    }

    /// Time at which a procedure command ends next.
    pub(super) fn next_end(&self) -> Option<Instant> {
        let running = self
            .commands
            .iter()
            .filter(|command| !command.notified && command.word == CommandState::SET_AND_ENABLE);
        running.map(|command| command.since + command.takes()).min()
    }

    /// Data of the elements that are asked for, in the order of their bits.
    fn read(
        &self,
        message: &Message<'_>,
        now: Instant,
        dictionary: &Dictionary,
    ) -> Result<Vec<u8>, u16> {
        let parameter = asked(message)?;
        let wanted = ELEMENTS.iter().filter(|(bit, _)| message.elements & bit != 0);
        let mut data = Vec::new();
        for (element, _) in wanted {
            data.extend(self.element(parameter, *element, now, dictionary)?);
        }
        if message.elements == 0 { Err(NO_ELEMENT) } else { Ok(data) }
    }

    fn element(
        &self,
        parameter: &DriveParameter,
        element: u8,
        now: Instant,
        dictionary: &Dictionary,
    ) -> Result<Vec<u8>, u16> {
        let text = |text: &str| of_variable_length(text.as_bytes(), text.len() as u16);
        match element {
            DATA_STATE => Ok(self.state(parameter, now).0.to_le_bytes().to_vec()),
            NAME => Ok(text(parameter.name)),
            ATTRIBUTE => Ok(parameter.attribute.0.to_le_bytes().to_vec()),
            UNIT if parameter.unit.is_empty() => Err(NO_UNIT),
            UNIT => Ok(text(parameter.unit)),
            MINIMUM => parameter.limits.map(|(least, _)| parameter.limit(least)).ok_or(NO_MINIMUM),
            MAXIMUM => parameter.limits.map(|(_, most)| parameter.limit(most)).ok_or(NO_MAXIMUM),
            VALUE if parameter.attribute.is_command() => {
                Ok(self.command(parameter.idn).map_or(0, |one| one.word).to_le_bytes().to_vec())
            }
            VALUE => Ok(parameter.carried(&parameter.value(dictionary))),
            _ => Err(NO_ELEMENT),
        }
    }

    fn command(&self, idn: Idn) -> Option<&SetCommand> {
        self.commands.iter().find(|command| command.idn == idn)
    }

    /// Data state: that of a procedure command, else "valid".
    fn state(&self, parameter: &DriveParameter, now: Instant) -> CommandState {
        let ValueSource::Command(takes) = parameter.source else { return CommandState(0) };
        let command = self.command(parameter.idn);
        CommandState::of(command.map_or(CommandProgress::NotSet, |one| one.progress(takes, now)))
    }

    fn write(
        &mut self,
        message: &Message<'_>,
        data: &[u8],
        now: Instant,
        served: &mut Served<'_>,
    ) -> Result<(), u16> {
        let parameter = asked(message)?;
        match message.elements {
            NAME => return Err(0x2004),
            ATTRIBUTE => return Err(0x3004),
            UNIT => return Err(0x4004),
            MINIMUM => return Err(0x5004),
            MAXIMUM => return Err(0x6004),
            VALUE => {}
            // The data state is read only, there are no defaults, and one element is written at a time.
            _ => return Err(NO_ELEMENT),
        }
        match parameter.rule {
            WriteRule::Never => return Err(FIXED),
            WriteRule::Cyclic => return Err(CYCLIC),
            WriteRule::AsItIs | WriteRule::Taken => {}
        }
        if parameter.attribute.is_protected_in(served.state) {
            return Err(PROTECTED);
        }
        let value = checked(parameter, data)?;
        if let ValueSource::Command(takes) = parameter.source {
            return self.execute(parameter, takes, value, now, served);
        }
        if parameter.rule == WriteRule::AsItIs {
            let same = parameter.value(served.dictionary) == value;
            return if same { Ok(()) } else { Err(NOT_SUPPORTED) };
        }
        served.dictionary.set_bytes(parameter.entry(), value.to_vec());
        Ok(())
    }

    /// Takes what is written to a procedure command.
    fn execute(
        &mut self,
        parameter: &DriveParameter,
        takes: Span,
        value: &[u8],
        now: Instant,
        served: &Served<'_>,
    ) -> Result<(), u16> {
        let idn = parameter.idn;
        let word = parameter.number(value) as u16;
        let progress = self.command(idn).map(|one| one.progress(takes, now));
        match (word, progress) {
            (CommandState::CANCEL, _) => {
                self.commands.retain(|command| command.idn != idn);
                return Ok(());
            }
            // Set and not enabled: it would be interrupted, which none of them can.
            (1, Some(CommandProgress::Running)) => return Err(NOT_INTERRUPTED),
            (1, _) | (CommandState::SET_AND_ENABLE, None | Some(CommandProgress::Set)) => {}
            (CommandState::SET_AND_ENABLE, Some(_)) => return Err(COMMAND_ACTIVE),
            (_, _) => return Err(NOT_SUPPORTED),
        }
        let failed = idn == CALIBRATE && !is_enabled(served);
        self.commands.retain(|command| command.idn != idn);
        self.commands.push(SetCommand { idn, word, since: now, failed, notified: false });
        Ok(())
    }
}

impl SetCommand {
    /// Time that it takes.
    fn takes(&self) -> Span {
        match DriveParameter::find(self.idn).map(|parameter| &parameter.source) {
            Some(ValueSource::Command(takes)) => *takes,
            _ => Span::ZERO,
        }
    }

    fn progress(&self, takes: Span, now: Instant) -> CommandProgress {
        match self.word {
            CommandState::SET_AND_ENABLE if self.failed => CommandProgress::Failed,
            CommandState::SET_AND_ENABLE if now < self.since + takes => CommandProgress::Running,
            CommandState::SET_AND_ENABLE => CommandProgress::Done,
            _ => CommandProgress::Set,
        }
    }
}

impl PartialWrite {
    /// The data of a write request, behind those of earlier ones that belong to it.
    fn after(earlier: Option<Self>, message: &Message<'_>) -> Self {
        let (drive, elements) = (message.drive, message.elements);
        let belongs = |one: &Self| (one.drive, one.elements) == (drive, elements);
        let fresh = Self { drive, elements, data: Vec::new() };
        let mut write = earlier.filter(belongs).unwrap_or(fresh);
        if write.data.len() <= LONGEST_WRITE {
            write.data.extend_from_slice(message.data);
        }
        write
    }
}

/// The parameter that a complete message is about.
fn asked(message: &Message<'_>) -> Result<&'static DriveParameter, u16> {
    let parameter = DriveParameter::find(Idn(message.number));
    parameter.filter(|_| message.drive == 0).ok_or(NO_IDN)
}

/// The value in the data of a write, without the bytes in front of a list; else why it is not taken.
fn checked<'a>(parameter: &DriveParameter, data: &'a [u8]) -> Result<&'a [u8], u16> {
    let most = usize::from(parameter.most());
    let element = match parameter.attribute.length() {
        ValueLength::Fixed(_) | ValueLength::Reserved => {
            let (least, greatest) = parameter.limits.unwrap_or((i64::MIN, i64::MAX));
            let number = parameter.number(data);
            return match data.len() {
                len if len < most => Err(TOO_SHORT),
                len if len > most => Err(TOO_LONG),
                _ if number < least => Err(BELOW_MINIMUM),
                _ if number > greatest => Err(ABOVE_MAXIMUM),
                _ => Ok(data),
            };
        }
        ValueLength::List(bytes) => usize::from(bytes),
    };
    let list = VariableData::parse(data).ok_or(TOO_SHORT)?.bytes;
    if list.len() > most || data.len() > LIST_HEADER_LEN + list.len() {
        return Err(TOO_LONG);
    }
    if list.len().is_multiple_of(element) { Ok(list) } else { Err(TOO_SHORT) }
}

/// True if the axis is in operation.
fn is_enabled(served: &Served<'_>) -> bool {
    let status = DriveParameter::find(STATUS).map(DriveParameter::entry);
    let word = status.map_or(0, |entry| served.dictionary.number_at(entry));
    served.state == AlState::Op && word >> STATUS_AT == IN_OPERATION
}

/// Answers with these data, in as many messages as it takes.
fn fragments(begin: &Message<'_>, data: &[u8], room: usize) -> Answers {
    let room = room.saturating_sub(SOE_HEADER_LEN).max(1);
    let pieces: Vec<_> = data.chunks(room).collect();
    let left = |at: usize| pieces.len() - at - 1;
    let piece = |(at, data): (usize, &&[u8])| match u16::try_from(left(at)) {
        Ok(left @ 1..) => write(&Message { incomplete: true, number: left, data, ..*begin }),
        Ok(0) | Err(_) => write(&Message { data, ..*begin }),
    };
    pieces.iter().enumerate().map(piece).collect()
}

fn write(message: &Message<'_>) -> Vec<u8> {
    let mut buffer = vec![0; SOE_HEADER_LEN + message.data.len()];
    let len = message.write(&mut buffer).unwrap_or(0);
    buffer.truncate(len);
    buffer
}
