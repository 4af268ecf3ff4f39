//! Resolver: turns a typed or pasted text into the pages of all its meanings.

use linesman_config::fault::FaultName;
use linesman_diagnosis::rule;
use linesman_proto::command::Command;
use linesman_proto::mailbox::abort_code;
use linesman_proto::mailbox::coe::ObjectIndex;
use linesman_proto::mailbox::coe::emergency::code;
use linesman_proto::register;
use linesman_proto::state::{DeviceState, status_code};

use super::found::Found;
use super::page::Page;
use super::{
    bare_number, bytes, codes, commands, findings, messages, number, objects, prefixed_number,
    register_bytes, registers, state_words, states, topic, vocabulary, working_counter,
};

/// Most letters that are looked at: more is no word, and no line of a log.
pub(super) const MOST_LETTERS: usize = 8192;
/// Fewest bytes that are a message when they are written as one number.
const MESSAGE_BYTES: usize = 8;
/// An index with a subindex is an object for sure; within a line it is what something else is about.
const OBJECT: u8 = 95;
const OBJECT_IN_LINE: u8 = 75;
/// With so few words it is a code with its name, no line of a log.
const FEW_WORDS: usize = 5;
/// Letters from which on the beginning of a name is enough.
const TELLING_BEGIN: usize = 12;
/// With a page of this likelihood no guesses are added.
const CERTAIN: u8 = 80;

/// All that it can mean, the most likely first.
pub(super) fn resolve(asked: &str) -> Vec<Page> {
    let text = clean(asked);
    let mut found = Found::default();
    if text.is_empty() || text.len() > MOST_LETTERS {
        return Vec::new();
    }
    names(&text, &mut found);
    if found.has(100) {
        return found.into_pages();
    }
    bare_number::add(&number::readings(&text), &mut found);
    object_entry(&text, OBJECT, &mut found);
    register_bytes::add(&text, &mut found);
    pasted_bytes(behind_history(&text), &mut found);
    if !found.has(CERTAIN) {
        working_counter::add(&text, &mut found);
        prefixed_number::add(&text, &mut found);
        if let Some((number, words)) = text.split_once(' ').filter(|_| found.is_empty()) {
            prefixed_number::add(&format!("{words} {number}"), &mut found);
        }
        if found.is_empty() || text.split(' ').count() > FEW_WORDS {
            line(&text, &mut found);
        }
    }
    found.into_pages()
}

/// Without quotes, the marks around it, and spaces at the ends.
fn clean(asked: &str) -> String {
    let words: Vec<&str> = asked.split_whitespace().collect();
    let text = words.join(" ");
    let outer = |letter: char| matches!(letter, '`' | '"' | '\'' | ' ' | '!' | '?' | ',' | ';');
    // The quotes of bytes in Python belong to them.
    if text.starts_with("b'") || text.starts_with("b\"") {
        return text;
    }
    let text = text.trim_matches(outer);
    match text.ends_with("..") {
        true => text.to_owned(),
        false => text.trim_end_matches(['.', ':']).to_owned(),
    }
}

/// Adds what is called like this.
fn names(text: &str, found: &mut Found) {
    let lower = text.to_ascii_lowercase();
    for page in rule::catalogue() {
        if page.code.eq_ignore_ascii_case(text) {
            found.add(100, findings::finding(page));
        } else if page.name == lower {
            found.add(90, findings::finding(page));
        }
    }
    let command =
        Command::ALL.into_iter().find(|command| command.name().eq_ignore_ascii_case(text));
    found.extend(92, command.map(commands::command));
    found.extend(91, states::named(text).map(|(state, error)| states::state(state, error)));
    let word = text.parse::<DeviceState>().ok().filter(|word| word.0 > 0x1F);
    found.extend(95, word.map(state_words::device_state));
    found.extend(91, commands::named_port(text).map(commands::port));
    found.extend(89, lower.replace(' ', "-").parse::<FaultName>().ok().map(findings::fault));
    found.extend(88, topic::find(text).map(topic::Topic::page));
    for word in vocabulary::find(text) {
        let is_exact = word.spellings().any(|spelling| spelling.eq_ignore_ascii_case(text));
        let likelihood = match (word.is_common(), is_exact) {
            (false, true) => 88,
            (true, true) => 85,
            (true, false) => 84,
            (false, false) => 83,
        };
        found.add(likelihood, word.page());
    }
    let register = register::address_by_name(text).and_then(register::describe);
    found.extend(86, register.map(|register| registers::register(&register)));
    found.extend(85, objects::by_name(text));
    named_codes(text, text.len() > TELLING_BEGIN, found);
    // Errors of programs have such names within: `SubDevice(SyncManagerWatchdog)`.
    for inner in text.split(['(', ')', ':', ' ']).filter(|inner| inner.len() < text.len()) {
        if inner.len() > TELLING_BEGIN {
            named_codes(inner, false, found);
        }
    }
    if found.is_empty() {
        found.extend(84, vocabulary::glossary(text));
    }
}

/// Adds codes by their names, or by the beginning of a name.
fn named_codes(text: &str, is_begin: bool, found: &mut Found) {
    let wanted = letters(text);
    let short = wanted.strip_prefix("slave").unwrap_or(&wanted);
    let short = short.strip_suffix("error").unwrap_or(short);
    if wanted.len() < 4 {
        return;
    }
    // Tools shorten the names of some codes: `Invalid mailbox configuration` is two of them.
    let is = |name: &str| {
        let name = letters(name);
        let is_whole = name == wanted || name == short || name.strip_suffix("error") == Some(short);
        is_whole || is_begin && name.starts_with(&wanted)
    };
    for entry in status_code::ALL.iter().filter(|entry| is(entry.name)) {
        found.add(84, codes::status(entry.code));
    }
    for entry in abort_code::ALL.iter().filter(|entry| is(entry.text)) {
        found.add(83, codes::abort(entry.code));
    }
    for entry in code::ALL.iter().filter(|entry| is(entry.name) && entry.code & 0x0FFF != 0) {
        found.add(81, codes::emergency(entry.code));
    }
}

fn letters(text: &str) -> String {
    let letters = text.chars().filter(char::is_ascii_alphanumeric);
    letters.map(|letter| letter.to_ascii_lowercase()).collect()
}

/// Adds an entry of an object: `0x1C32:0B`, `1C32.11`, `1018h:01`, `0x1018 sub 1`, `6040/0`; with a value behind it
/// (`0x1C32:05 0x249F0`) also what that says.
///
/// Behind a colon a subindex is hexadecimal, as ETG writes it; behind a dot people count in decimal.
fn object_entry(text: &str, likely: u8, found: &mut Found) {
    let lower = text.to_ascii_lowercase();
    let mut text = lower.as_str();
    for word in ["coe object ", "object ", "sdo ", "coe ", "index "] {
        text = text.strip_prefix(word).unwrap_or(text);
    }
    let (text, value) = entry_and_value(text);
    let text = text.replace("subindex", ":").replace(" sub ", ":").replace(' ', "");
    let text = text.as_str();
    let Some((index, sub)) = text.split_once([':', '.', '/', ',']) else { return };
    let by_dot = text.contains('.') && !text.contains(':');
    let index = number::readings(index).into_iter().find(|number| !number.decimal);
    let Some(index) = index.and_then(number::Number::word).filter(|index| *index >= 0x1000) else {
        return;
    };
    let digits = sub.trim_start_matches("0x");
    if digits.len() > 3 {
        return;
    }
    let bases = if sub.starts_with("0x") || !by_dot { [16, 10] } else { [10, 16] };
    let mut subindices: Vec<u8> =
        bases.into_iter().filter_map(|base| u8::from_str_radix(digits, base).ok()).collect();
    subindices.truncate(if sub.starts_with("0x") || digits.starts_with('0') { 1 } else { 2 });
    subindices.dedup();
    let value = value.and_then(|value| number::readings(value).first().copied());
    for (order, subindex) in subindices.into_iter().enumerate() {
        let likelihood = if order == 0 { likely } else { likely.min(60) };
        let told = value
            .filter(|_| order == 0)
            .and_then(|number| objects::value(ObjectIndex(index), Some(subindex), number.value));
        found.extend(likelihood.saturating_add(2), told);
        found.extend(likelihood, objects::pages(ObjectIndex(index), Some(subindex)));
    }
}

/// The entry of a text, and a value behind it.
fn entry_and_value(text: &str) -> (&str, Option<&str>) {
    if let Some((entry, value)) = text.split_once('=') {
        return (entry, Some(value.trim()));
    }
    match text.rsplit_once(' ') {
        Some((entry, value)) if entry.contains([':', '/']) && !entry.ends_with(':') => {
            (entry, Some(value))
        }
        Some(_) | None => (text, None),
    }
}

/// The text behind the object of the diagnosis history: `0x10F3:06 00 E0 21 1C …`.
fn behind_history(text: &str) -> &str {
    let upper = text.to_ascii_uppercase();
    let digits = upper.strip_prefix("0X").unwrap_or(&upper);
    if !digits.starts_with("10F3") {
        return text;
    }
    text.split_once([' ', '=']).map_or(text, |(_, rest)| rest.trim_start_matches([' ', '=']))
}

/// Adds what pasted bytes are.
fn pasted_bytes(text: &str, found: &mut Found) {
    let Some(bytes) = bytes::parse(text) else { return };
    // Four digits are a code or an index rather than two bytes.
    let is_message = bytes.apart || bytes.cut || bytes.data.len() >= MESSAGE_BYTES;
    let is_number = !number::readings(text).is_empty() && bytes.data.len() < MESSAGE_BYTES;
    if is_message && !is_number {
        found.extend(93, messages::pages(&bytes));
    }
    if bytes.cut
        && let Some(four) = bytes.data.first_chunk::<4>()
        && bytes.data.len() == 4
    {
        let value = u32::from_be_bytes(*four);
        if abort_code::lookup(value).known {
            found.add(80, codes::abort(abort_code::SdoAbortCode(value)));
        }
    }
}

/// Adds what a line of a log says: messages of other tools in it, entries of objects, states in
/// brackets.
fn line(text: &str, found: &mut Found) {
    let words = vocabulary::within(text);
    let (common, of_tools): (Vec<_>, Vec<_>) = words.into_iter().partition(|word| word.is_common());
    let likelihood = if found.is_empty() { 88 } else { 82 };
    found.extend(likelihood, of_tools.into_iter().take(MOST_MESSAGES).map(vocabulary::Word::page));
    for piece in text.split([' ', '(', ')', '\'', '"']) {
        if piece.len() > 6 && piece.to_ascii_lowercase().starts_with("0x") {
            object_entry(piece.trim_end_matches([':', ',', '.']), OBJECT_IN_LINE, found);
        }
    }
    for inner in text.split(['(', ')', '\'', '"']).skip(1) {
        if let Some((state, true)) = states::named(inner) {
            found.add(70, states::state(state, true));
        }
    }
    let tokens = format!(" {} ", vocabulary::words(text));
    let has = |name: &str| tokens.contains(&format!(" {} ", vocabulary::words(name)));
    let named = status_code::ALL.iter().filter(|entry| entry.name.contains(' ') && has(entry.name));
    found.extend(86, named.map(|entry| codes::status(entry.code)));
    let named = abort_code::ALL.iter().filter(|entry| entry.text.contains(' ') && has(entry.text));
    found.extend(84, named.map(|entry| codes::abort(entry.code)));
    if found.is_empty() {
        found.extend(80, common.into_iter().take(MOST_MESSAGES).map(vocabulary::Word::page));
    }
    if found.is_empty() {
        let words = text.split(|letter: char| !letter.is_ascii_alphanumeric());
        let is_marked = |word: &&str| word.starts_with("0x") || word.starts_with("0X");
        for word in words.filter(is_marked).take(MOST_NUMBERS) {
            bare_number::add(&number::readings(word), found);
        }
    }
}

/// Most numbers of a line that are looked up for themselves.
const MOST_NUMBERS: usize = 50;
/// Most messages that one line is said to hold.
const MOST_MESSAGES: usize = 3;
