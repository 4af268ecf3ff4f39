//! Addresses of registers are written once, in `proto::register`; elsewhere code names the entry of the table.
//!
//! Found is a number from 0x0000 to 0x0FFF in hexadecimal, outside tests, that is
//!
//! * put into a `RegisterAddress`,
//! * an argument of something that takes a register ([`TAKES_REGISTER`]), or has such a name or is compared with it,
//! * one end of a range of two such numbers with four digits,
//! * in front of the bytes that are written there, as in `(0x0300, &[0; 8])`.
//!
//! Not found is an address that nothing says to be one, as in `const STATUS: u16 = 0x0805`. Recorded frames and
//! texts that people read are free.

use std::collections::BTreeMap;

use super::code::{self, TestFiles};
use crate::files::TextFile;

/// Where the numbers belong.
const HOME: &str = "crates/proto/src/register/";

/// First address that is memory and no register.
const MEMORY: u32 = 0x1000;

/// Names of functions, methods, fields and constants whose number is the address of a register.
const TAKES_REGISTER: &[&str] =
    &["RegisterAddress", "address", "ado", "register", "registers", "read", "write", "Init::new"];

/// Files that have such numbers, how many lines of them, and why. The number may only fall.
const KNOWN: &[(&str, usize, &str)] = &[
    ("crates/config/src/eni/own.rs", 1, "to be named"),
    ("crates/config/src/eni/state.rs", 6, "ranges of several registers"),
    ("crates/config/src/eni/sub_device.rs", 1, "to be named"),
    ("crates/config/src/eni/write/main_device.rs", 9, "to be named"),
    ("crates/config/src/eni/write/sub_device.rs", 9, "to be named"),
    ("crates/config/src/plan/layout/area.rs", 1, "a range of registers"),
    ("crates/diagnosis/src/ask/asker.rs", 2, "to be named"),
    ("crates/diagnosis/src/ask/disturbance.rs", 2, "ranges of several registers"),
    ("crates/diagnosis/src/ask/schedule.rs", 6, "to be named"),
    ("crates/diagnosis/src/model/learn/answer.rs", 17, "ranges of several registers"),
    ("crates/diagnosis/src/model/learn/registers.rs", 3, "ranges of several registers"),
    ("crates/diagnosis/src/model/learn/sii.rs", 1, "a range of registers"),
    ("crates/diagnosis/src/main_device/habits.rs", 4, "to be named"),
    ("crates/diagnosis/src/main_device/poll.rs", 1, "a range of registers"),
    ("crates/diagnosis/src/report/main_device.rs", 1, "to be named"),
    ("crates/diagnosis/src/rule/clock_drift.rs", 1, "to be named"),
    ("crates/diagnosis/src/rule/reference_clock.rs", 1, "to be named"),
    ("crates/diagnosis/src/rule/restarted.rs", 1, "to be named"),
    ("crates/diagnosis/src/rule/state_error.rs", 3, "to be named"),
    ("crates/diagnosis/src/rule/state_unanswered.rs", 2, "to be named"),
    ("crates/diagnosis/src/rule/watchdog_short.rs", 1, "to be named"),
    ("crates/lab/src/lab/capture_loss.rs", 1, "a range of registers"),
    ("crates/lab/src/replay/compare.rs", 7, "ranges of several registers"),
    ("crates/lab/src/replay/learn/mod.rs", 1, "ranges of several registers"),
    ("crates/lab/src/replay/model/mod.rs", 28, "ranges of several registers"),
    ("crates/lab/src/score/trace.rs", 1, "a range of registers"),
    ("crates/lab/src/soem/mapping.rs", 1, "to be named"),
    ("crates/lab/src/soem/start_up.rs", 17, "requests as SOEM writes them"),
    ("crates/lab/src/swarm/physics.rs", 2, "to be named"),
    ("crates/cli/src/command/explain/commands.rs", 3, "to be named"),
    ("crates/cli/src/command/probe.rs", 1, "the first address of all"),
    ("crates/cli/src/text/finding.rs", 1, "a range of registers"),
    ("crates/maindevice/src/supervisor/by_alias.rs", 1, "to be named"),
    ("crates/proto/src/mailbox/coe/emergency.rs", 1, "ranges of emergency codes"),
    ("crates/sim/src/controller/access.rs", 1, "a range of registers"),
    ("crates/sim/src/controller/plain_read.rs", 7, "ranges of several registers"),
    ("crates/sim/src/device/application/oversampling.rs", 2, "to be named"),
    ("crates/sim/src/device/library/digital.rs", 7, "to be named"),
];

/// Lines with a number of a register outside the table.
pub(super) fn check(files: &[TextFile], tests: &TestFiles, broken: &mut Vec<String>) {
    judge(files, tests, KNOWN, broken);
}

fn judge(
    files: &[TextFile],
    tests: &TestFiles,
    known: &[(&str, usize, &str)],
    broken: &mut Vec<String>,
) {
    let mut found: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for file in files.iter().filter(|file| is_checked(&file.path, tests)) {
        for line in code::lines(&file.text) {
            if let Some(number) = register_number(line.code) {
                let at = format!("{}:{}", file.path, line.number);
                found.entry(&file.path).or_default().push(format!(
                    "{at}: the register {number} as a number; name it by proto::register"
                ));
            }
        }
    }
    for (path, most, why) in known {
        let count = found.get(path).map_or(0, Vec::len);
        if count < *most {
            broken.push(format!(
                "{path}: {count} lines with numbers of registers ({why}): lower {most} in \
                 xtask/src/tidy/registers.rs"
            ));
        }
    }
    for (path, lines) in found {
        let most = known.iter().find(|(known, ..)| *known == path).map_or(0, |(_, most, _)| *most);
        if lines.len() > most {
            broken.extend(lines);
        }
    }
}

fn is_checked(path: &str, tests: &TestFiles) -> bool {
    let home = path.starts_with(HOME);
    path.ends_with(".rs") && path.starts_with("crates/") && !home && !tests.contain(path)
}

/// The first number of a register in a line of code.
fn register_number(code: &str) -> Option<String> {
    let code = without_texts(code);
    code.match_indices("0x").find_map(|(at, _)| {
        let digits = code[at + 2..].split(|letter: char| !letter.is_ascii_hexdigit()).next()?;
        let end = at + 2 + digits.len();
        let value = u32::from_str_radix(digits, 16).ok()?;
        let found = value < MEMORY && means_register(&code[..at], digits, &code[end..]);
        found.then(|| code[at..end].to_owned())
    })
}

/// Says by what stands around a number if it is the address of a register.
fn means_register(before: &str, digits: &str, after: &str) -> bool {
    if before.ends_with("RegisterAddress(") {
        return true;
    }
    if digits.len() != 4 {
        return false;
    }
    let is_range = |rest: &str| rest.trim_start_matches('=').starts_with("0x0");
    after.strip_prefix("..").is_some_and(is_range)
        || after.starts_with(", &[")
        || callee(before).is_some_and(takes_register)
        || target(before).is_some_and(takes_register)
}

/// What the number is an argument of: the name in front of the last parenthesis that is still open.
fn callee(before: &str) -> Option<&str> {
    let mut depth = 0;
    let open = before.rfind(|letter| {
        depth += match letter {
            ')' => 1,
            '(' => -1,
            _ => 0,
        };
        depth < 0
    })?;
    last_name(&before[..open])
}

/// What the number is compared with, or is the value of: `ado.0 == 0x…`, `register: 0x…`, `ADDRESS: u16 = 0x…`.
fn target(before: &str) -> Option<&str> {
    let before = before.trim_end();
    if let Some(compared) = before.strip_suffix("==").or_else(|| before.strip_suffix("!=")) {
        return last_name(compared.trim_end().trim_end_matches(".0").trim_end_matches(".value()"));
    }
    let before = before.strip_suffix('=').map_or(before, |typed| {
        let typed = typed.trim_end();
        typed.rsplit_once(": ").map_or(typed, |(name, _)| name)
    });
    last_name(before.trim_end_matches(':'))
}

/// The name at the end, with the type that it belongs to.
fn last_name(text: &str) -> Option<&str> {
    let is_part = |letter: char| letter.is_ascii_alphanumeric() || letter == '_' || letter == ':';
    let start = text.rfind(|letter| !is_part(letter)).map_or(0, |at| at + 1);
    Some(&text[start..]).filter(|name| !name.is_empty())
}

/// Constants in capitals are told by the last word of their names.
fn takes_register(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    let words = ["address", "register", "ado"];
    let is_constant = lower != name && name == name.to_ascii_uppercase();
    let by_word = || words.iter().any(|word| lower.rsplit('_').next() == Some(word));
    TAKES_REGISTER.contains(&name) || (is_constant && by_word())
}

/// The line with spaces in place of what stands between quotation marks.
fn without_texts(code: &str) -> String {
    let mut quoted = false;
    let mut escaped = false;
    let blank = |letter: char| {
        let ends = letter == '"' && !escaped;
        escaped = letter == '\\' && !escaped;
        if ends {
            quoted = !quoted;
        }
        if quoted || ends || !letter.is_ascii() { ' ' } else { letter }
    };
    code.chars().map(blank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn broken(text: &str, known: &[(&str, usize, &str)]) -> Vec<String> {
        let files = [TextFile::new("crates/sim/src/a.rs", text)];
        let mut broken = Vec::new();
        judge(&files, &TestFiles::of(&files), known, &mut broken);
        broken
    }

    #[test]
    fn number_that_is_named_or_passed_as_register_is_found() {
        for line in [
            "const STATUS: RegisterAddress = RegisterAddress(0x0130);",
            "let x = address::RegisterAddress(0x130);",
            "bus.read(place(1, 2), 0x0010, 2);",
            "Init::new(\"ask\", 0x0120)",
            "Poll { register: 0x0130, len: 2 }",
            "const DL_ADDRESS: u16 = 0x0110;",
            "request.ado.0 == 0x0900",
            "let counters = 0x0300..0x0314;",
            "(\"clear counters\", 0x0300, &[0; 8]),",
        ] {
            let lines = broken(line, &[]);
            assert_eq!(lines.len(), 1, "{line}");
            assert!(lines[0].starts_with("crates/sim/src/a.rs:1: the register 0x"), "{lines:?}");
        }
    }

    #[test]
    fn other_numbers_texts_and_tests_are_free() {
        for line in [
            "const MANDATORY: u16 = 0x0001;",
            "AlStatusCode(0x001E)",
            "RegisterAddress(0x1000)",
            "read(\"register 0x0130\")",
            "// RegisterAddress(0x0130)",
            "let status = register::AL_STATUS.address;",
            "#[cfg(test)]\nmod tests {\n    read(0x0130);\n}",
        ] {
            assert_eq!(broken(line, &[]), Vec::<String>::new(), "{line}");
        }
    }

    #[test]
    fn known_numbers_may_become_fewer_but_not_more() {
        let known = |count| [("crates/sim/src/a.rs", count, "a table")];
        let text = "read(0x0130);\nread(0x0110);\n";
        assert_eq!(broken(text, &known(2)), Vec::<String>::new());
        assert_eq!(broken(text, &known(1)).len(), 2);
        let fewer = broken(text, &known(3));
        assert!(fewer[0].contains("lower 3"), "{fewer:?}");
    }
}
