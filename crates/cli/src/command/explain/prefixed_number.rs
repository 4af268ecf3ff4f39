//! Numbers with a word in front that says what they are: `AL 0x001B`, `abort 06010000`, `DL 0x5617`.

use linesman_proto::ads::AdsCode;
use linesman_proto::command::Command;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::mailbox::coe::emergency::code;
use linesman_proto::mailbox::error_reply::ErrorReplyCode;
use linesman_proto::mailbox::foe::FoeErrorCode;
use linesman_proto::mailbox::soe::SoeError;
use linesman_proto::register;
use linesman_proto::state::status_code::Origin;
use linesman_proto::state::{AlStatusCode, DeviceState, NetworkState};

use super::found::Found;
use super::number::{self, Number};
use super::{bare_number, codes, commands, objects, registers, state_words, states};

/// The kind of number that the word in front of it names.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum What {
    AlStatusCode,
    AlStatus,
    AlStatusWord,
    AnyCode,
    Abort,
    Register,
    Object,
    Emergency,
    Foe,
    Soe,
    Ads,
    Mailbox,
    Command,
    State,
    NetworkState,
    FrameState,
    Text,
    Diagnosis,
    Station,
    SubDevice,
    Dl,
    Rx,
}

/// Words in front of a number, without spaces.
const WORDS: &[(&[&str], What)] = &[
    (
        &[
            "alstatuscode",
            "alcode",
            "alstatusmessage",
            "alerror",
            "alerrorcode",
            "statuscode",
            "alsc",
        ],
        What::AlStatusCode,
    ),
    (&["al", "alstatus", "alstate", "alcontrol"], What::AlStatus),
    (&["code", "withcode", "errorcode", "error", "err", "errcode"], What::AnyCode),
    (
        &[
            "abort",
            "abortcode",
            "sdoabort",
            "sdoabortcode",
            "sdoabortmessage",
            "coeabort",
            "coeabortcode",
            "sdoerror",
            "sdoerrorcode",
            "aborted",
        ],
        What::Abort,
    ),
    (&["register", "reg", "escregister", "escreg", "ado", "ecatado"], What::Register),
    (&["object", "coeobject", "coe", "index", "sdo", "sdoindex", "pdo", "coeindex"], What::Object),
    (
        &[
            "emergency",
            "emergencycode",
            "emergencyerrorcode",
            "emcy",
            "emcycode",
            "emergencymessage",
            "driveerror",
            "driveerrorcode",
            "faultcode",
        ],
        What::Emergency,
    ),
    (&["foe", "foeerror", "foeerr", "foeerrorcode"], What::Foe),
    (&["soe", "soeerror", "soeerr", "soeerrorcode"], What::Soe),
    (
        &["ads", "adserror", "adserr", "adserrorcode", "adscode", "adsreturncode", "adsresult"],
        What::Ads,
    ),
    (&["mailboxerror", "mbxerror", "mailboxerrorreply", "mailboxerrorcode"], What::Mailbox),
    (&["command", "cmd", "ecatcmd", "ecatcommand"], What::Command),
    (
        &["state", "devicestate", "slavestate", "infodatastate", "subdevicestate", "stateword"],
        What::State,
    ),
    (&["devstate", "masterdevstate", "networkstate"], What::NetworkState),
    (&["frmwcstate", "frmxwcstate", "framewcstate"], What::FrameState),
    (&["text", "textid", "textnumber", "messageid", "msgid"], What::Text),
    (&["diag", "diagcode", "diagnosiscode", "diagnosticcode"], What::Diagnosis),
    (&["subdevice", "slave"], What::SubDevice),
    (
        &[
            "station",
            "stationaddress",
            "fixedaddress",
            "physaddr",
            "configadr",
            "configuredaddress",
        ],
        What::Station,
    ),
    (&["dl", "dlstatus"], What::Dl),
    (&["rx", "rxerror", "rxerrorcounter", "crc", "crcerror", "rxerr", "crcerrors"], What::Rx),
];

/// Most words in front of a number that are looked at.
const MOST_WORDS: usize = 4;

/// Most numbers that are addresses and values by turns.
const MOST_PAIRED: usize = 16;

/// A word or a number of a line.
pub(super) enum Token<'a> {
    Word(&'a str),
    Number(Vec<Number>),
}

/// The words and numbers of a line. Words that look like a number, such as `ADC`, are words.
pub(super) fn tokens(line: &str) -> Vec<Token<'_>> {
    let is_separator = |letter: char| !letter.is_alphanumeric() && letter != '#' && letter != '$';
    let words = line.split(is_separator).filter(|word| !word.is_empty());
    words
        .map(|word| match number::readings(word) {
            numbers if numbers.is_empty() => Token::Word(word),
            numbers => Token::Number(numbers),
        })
        .collect()
}

/// Numbers of a line with the words in front of them.
struct Group<'a> {
    words: Vec<&'a str>,
    numbers: Vec<&'a [Number]>,
}

fn groups<'a>(tokens: &'a [Token<'_>]) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for token in tokens {
        match (token, groups.last_mut()) {
            (Token::Word(word), Some(group)) if group.numbers.is_empty() => group.words.push(word),
            (Token::Word(word), _) => {
                groups.push(Group { words: vec![word], numbers: Vec::new() });
            }
            (Token::Number(numbers), Some(group)) => group.numbers.push(numbers),
            (Token::Number(numbers), None) => {
                groups.push(Group { words: Vec::new(), numbers: vec![numbers] });
            }
        }
    }
    groups
}

/// Adds what the numbers of a line are by the words in front of them.
pub(super) fn add(line: &str, found: &mut Found) {
    let tokens = tokens(line);
    let groups = groups(&tokens);
    emergency_of_pysoem(&groups, found);
    let has_code = groups.iter().any(|group| longest(&group.words) == Some(What::AlStatusCode));
    for group in groups {
        match longest(&group.words) {
            Some(what) => {
                let several = group.numbers.len() > 1;
                for (nth, readings) in group.numbers.iter().enumerate() {
                    // The status word and its code are told together.
                    let is_status = what == What::AlStatus;
                    let what = if is_status && nth > 0 {
                        What::AlStatusCode
                    } else if is_status && (several || has_code) {
                        What::AlStatusWord
                    } else {
                        what
                    };
                    each_base(what, readings, nth, found);
                }
            }
            None => {
                if let Some(number) = group.numbers.first().and_then(|numbers| numbers.first()) {
                    named(&group.words.join(" "), *number, found);
                }
            }
        }
        for number in group.numbers.iter().filter_map(|numbers| numbers.first()) {
            let code = number.long().filter(|_| number.is_long()).map(SdoAbortCode);
            let known = code.filter(|code| code.explain().known);
            found.extend(85, known.map(codes::abort));
        }
    }
    pair(&tokens, found);
}

/// Adds a state word in each base in which it makes sense, since tools show it in decimal, too; the
/// one with fewer bits first.
fn state(readings: &[Number], found: &mut Found) {
    let makes_sense = |word: &u16| *word < 0x20 || state_words::is_device_state(DeviceState(*word));
    let mut words: Vec<u16> = readings.iter().filter_map(|number| number.word()).collect();
    let first = words.first().copied();
    words.retain(makes_sense);
    if words.is_empty() {
        words.extend(first);
    }
    words.sort_by_key(|word| word.count_ones());
    found.extend(
        95,
        words.into_iter().map(|word| match states::al_status(word) {
            Some(page) if word < 0x20 => page,
            Some(_) | None => state_words::device_state(DeviceState(word)),
        }),
    );
}

/// Adds what a number is in the first base in which it is something, and in decimal besides.
fn each_base(what: What, readings: &[Number], nth: usize, found: &mut Found) {
    let before = found.len();
    if what == What::State {
        state(readings, found);
        return;
    }
    for number in readings {
        one(what, *number, nth, found);
        if found.len() > before && !number.decimal {
            break;
        }
    }
    if what == What::Ads && found.len() == before {
        let first = readings.first().and_then(|number| number.long());
        found.extend(85, first.map(|code| codes::ads(AdsCode(code))));
    }
}

/// The longest run of words right in front of a number that says what it is.
fn longest(words: &[&str]) -> Option<What> {
    let from = words.len().saturating_sub(MOST_WORDS);
    (from..words.len()).find_map(|from| {
        // The number of a frame within `Frm0WcState` does not matter.
        let joined: String = words[from..]
            .concat()
            .chars()
            .filter(char::is_ascii_alphabetic)
            .map(|letter| letter.to_ascii_lowercase())
            .collect();
        WORDS.iter().find(|(words, _)| words.contains(&joined.as_str())).map(|(_, what)| *what)
    })
}

/// Adds what a number of this kind means; `nth` counts the numbers behind the same words.
fn one(what: What, number: Number, nth: usize, found: &mut Found) {
    let word = number.word();
    let status = word.map(AlStatusCode);
    let is_standard = status.is_some_and(|code| code.explain().origin == Origin::Standard);
    let code = |found: &mut Found, likelihood| {
        found.extend(likelihood, status.map(codes::status));
    };
    match what {
        What::AlStatusCode => code(found, 95),
        What::AlStatusWord => found.extend(95, word.and_then(states::al_status)),
        What::AlStatus => {
            found.extend(
                if is_standard && number.digits > 2 { 85 } else { 92 },
                word.and_then(states::al_status),
            );
            if is_standard || found.is_empty() {
                code(found, 90);
            }
        }
        // The numbers of a MainDevice and a SubDevice stand behind `ERROR`, too.
        What::AnyCode if number.digits < 2 => {}
        What::AnyCode => {
            if number.is_long() {
                found.extend(90, number.long().map(|code| codes::abort(SdoAbortCode(code))));
            } else {
                let known = word.filter(|word| code::lookup(*word).known);
                found.extend(85, known.map(codes::emergency));
                if is_standard || known.is_none() {
                    code(found, 90);
                }
            }
        }
        What::Abort => {
            found.extend(95, number.long().map(|code| codes::abort(SdoAbortCode(code))));
        }
        What::Register if nth > 0 => {}
        What::Register => {
            let register = word.and_then(bare_number::register_at);
            found.extend(95, register.map(|register| registers::register(&register)));
        }
        What::Object => {
            let index = word.filter(|_| nth == 0).map(ObjectIndex);
            found.extend(95, index.into_iter().flat_map(|index| objects::pages(index, None)));
        }
        What::Emergency if nth == 0 => found.extend(95, word.map(codes::emergency)),
        What::Emergency => {}
        What::Foe => found.extend(
            95,
            number.long().map(|code| {
                // Some tools leave the highest bit away.
                codes::foe(FoeErrorCode(if code < 0x10 { code | 0x8000 } else { code }))
            }),
        ),
        What::Soe => found.extend(95, word.map(|code| codes::soe(SoeError(code)))),
        What::Ads => {
            let code = number.long().map(AdsCode);
            found.extend(95, code.filter(|code| code.meaning().is_some()).map(codes::ads));
        }
        What::Mailbox => {
            found.extend(95, word.map(|code| codes::mailbox(ErrorReplyCode::from_code(code))));
        }
        What::Command => {
            let code = u8::try_from(number.value).ok();
            found.extend(95, code.and_then(Command::from_code).map(commands::command));
        }
        What::State => state(&[number], found),
        What::NetworkState => {
            found.extend(95, word.map(|word| state_words::network_state(NetworkState(word))));
        }
        What::FrameState => found.extend(95, word.map(state_words::frame_state)),
        What::Text => found.extend(95, word.map(codes::text)),
        What::Diagnosis => found.extend(95, number.long().map(codes::diagnosis)),
        What::Station => found.extend(95, word.map(bare_number::station)),
        What::SubDevice => {
            found.extend(90, word.filter(|word| *word > 1000).map(bare_number::station));
        }
        What::Dl => of_register(register::DL_STATUS.address.value(), number, found),
        What::Rx => {
            let port = nth.min(3) as u16;
            of_register(register::RX_ERROR_COUNTER.address.value() + 2 * port, number, found);
        }
    }
}

fn of_register(address: u16, number: Number, found: &mut Found) {
    let register = bare_number::register_at(address);
    found.extend(95, register.map(|register| registers::value(&register, number.value)));
}

/// Adds what a value of a register, an object or a variable says, by its name.
fn named(name: &str, number: Number, found: &mut Found) {
    if name.is_empty() {
        return;
    }
    if let Some(address) = register::address_by_name(name) {
        of_register(address.value(), number, found);
    }
    let of_object = objects::index_by_name(name);
    found.extend(94, of_object.and_then(|index| objects::value(index, None, number.value)));
}

/// Adds what a pair of numbers says: address and value of a register or object.
fn pair(tokens: &[Token<'_>], found: &mut Found) {
    let numbers: Vec<&Vec<Number>> = tokens
        .iter()
        .filter_map(|token| match token {
            Token::Number(numbers) => Some(numbers),
            Token::Word(_) => None,
        })
        .collect();
    let words: Vec<&str> = tokens
        .iter()
        .filter_map(|token| match token {
            Token::Word(word) => Some(*word),
            Token::Number(_) => None,
        })
        .collect();
    let only_addresses = match longest(&words) {
        None => words.is_empty(),
        Some(what) => matches!(what, What::Register | What::Object),
    };
    if !only_addresses || !numbers.len().is_multiple_of(2) || numbers.len() > MOST_PAIRED {
        return;
    }
    for pair in numbers.chunks_exact(2) {
        value_of(pair[0], pair[1], found);
    }
}

/// Adds what a value says that was read from an address.
fn value_of(address: &[Number], value: &[Number], found: &mut Found) {
    let hexadecimal = |numbers: &[Number]| numbers.iter().copied().find(|number| !number.decimal);
    let Some(address) = hexadecimal(address).and_then(Number::word) else { return };
    let Some(value) = hexadecimal(value).or_else(|| value.first().copied()) else { return };
    if let Some(register) = bare_number::register_at(address) {
        registers::add_value(&register, value.value, 97, found);
        return;
    }
    let index = ObjectIndex(address);
    if index == ObjectIndex::ERROR_CODE {
        found.extend(98, value.word().map(codes::emergency));
    }
    match objects::value(index, None, value.value) {
        Some(page) => found.add(97, page),
        None => found.extend(90, objects::pages(index, None)),
    }
}

/// Adds an emergency as pysoem prints it: `Slave 1:  8130, 11, (00,00,00,00,00)`.
fn emergency_of_pysoem(groups: &[Group<'_>], found: &mut Found) {
    let [group] = groups else { return };
    let is_slave = group.words.iter().any(|word| word.eq_ignore_ascii_case("slave"));
    let hexadecimal = |numbers: &[Number]| numbers.iter().find(|number| !number.decimal).copied();
    if let (true, 8, Some(code)) = (is_slave, group.numbers.len(), group.numbers.get(1)) {
        let code = hexadecimal(code).and_then(Number::word);
        found.extend(90, code.map(codes::emergency));
    }
}
