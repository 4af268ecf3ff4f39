//! `linesman explain`: what a code or a name means, and what to do about it.
//!
//! A number may be several things: 0x0130 is a register, 0x001D an AL status code; what it may be
//! is all shown. `al:`, `abort:` and `register:` in front say which is meant.

mod page;
mod topic;

use linesman_config::fault::FaultName;
use linesman_diagnosis::rule::{self, RulePage};
use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::register::{self, Description};
use linesman_proto::state::status_code::{AlStatusCode, Origin};
use linesman_proto::state::{AlState, status_code};

use self::page::Page;
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;

/// Most names that are suggested for a word which is none.
const MOST_SUGGESTIONS: usize = 8;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// A finding (H101), AL status code (0x001D), abort code (0x06090011), register (0x0130 or its
    /// name), state (SAFEOP), fault name (link-open) or topic (counter-guide, lamps, line-codes, located,
    /// lost-links, running-errors, start-up-errors, two-counters); several words are one name
    #[arg(required = true, value_name = "CODE")]
    code: Vec<String>,
}

/// Prints all pages about the word.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let word = arguments.code.join(" ");
    let pages = pages(&word);
    if pages.is_empty() {
        return Err(unknown(&word));
    }
    for (index, page) in pages.iter().enumerate() {
        let gap = if index == 0 { "" } else { "\n" };
        output.text(&format!("{gap}{}", page.render(output.paint(), output.width())));
    }
    Ok(Status::Good)
}

/// All that the word can mean.
fn pages(word: &str) -> Vec<Page> {
    if let Some((kind, rest)) = word.split_once(':') {
        let number = number(rest);
        return match (kind, number) {
            ("al", Some(Number { value, .. })) => u16::try_from(value)
                .map(|code| page::status(AlStatusCode(code)))
                .into_iter()
                .collect(),
            ("abort", Some(Number { value, .. })) => vec![page::abort(SdoAbortCode(value))],
            ("register" | "reg", Some(Number { value, .. })) => {
                register_at(value).map(|found| page::register(&found)).into_iter().collect()
            }
            ("register" | "reg", None) => named_register(rest).into_iter().collect(),
            _ => Vec::new(),
        };
    }
    if let Some(number) = number(word) {
        return numbered(number);
    }
    let findings = rule::catalogue().into_iter().filter(|page| is_about(page, word));
    let state = AlState::ALL.into_iter().find(|state| state.name().eq_ignore_ascii_case(word));
    let fault = word.to_ascii_lowercase().parse::<FaultName>().ok();
    let mut pages: Vec<Page> = findings.map(page::finding).collect();
    pages.extend(state.map(page::state));
    pages.extend(fault.map(page::fault));
    pages.extend(named_register(word));
    pages.extend(topic::find(word).map(|topic| page::topic(topic.text)));
    pages
}

/// Whether a finding's page is meant, by code or by name.
fn is_about(page: &RulePage, word: &str) -> bool {
    page.code.eq_ignore_ascii_case(word) || page.name.eq_ignore_ascii_case(word)
}

/// A number and how it was written.
#[derive(Clone, Copy)]
struct Number {
    value: u32,
    /// Whether it was written with the digits of an abort code, eight.
    long: bool,
}

/// `0x1D`, `0x001d`, `29`.
fn number(word: &str) -> Option<Number> {
    let word = word.trim();
    let hex = word.strip_prefix("0x").or_else(|| word.strip_prefix("0X"));
    let value = match hex {
        Some(digits) => u32::from_str_radix(digits, 16).ok()?,
        None => word.parse().ok()?,
    };
    Some(Number { value, long: hex.is_some_and(|digits| digits.len() > 4) })
}

fn numbered(number: Number) -> Vec<Page> {
    let code = match u16::try_from(number.value) {
        Ok(code) if !number.long => AlStatusCode(code),
        Ok(_) | Err(_) => return vec![page::abort(SdoAbortCode(number.value))],
    };
    let register = register_at(number.value);
    let is_standard = code.explain().origin == Origin::Standard;
    let mut pages = Vec::new();
    // A number that no table has is a status code all the same: what to do with one is known too.
    if is_standard || register.is_none() {
        pages.push(page::status(code));
    }
    // Few mean the middle of a register when there is a status code of that number.
    let meant = register.filter(|found| !is_standard || found.offset == 0);
    pages.extend(meant.map(|found| page::register(&found)));
    pages
}

fn register_at(value: u32) -> Option<Description> {
    register::describe(RegisterAddress(u16::try_from(value).ok()?))
}

fn named_register(name: &str) -> Option<Page> {
    let found = register::by_name(name)?;
    register::describe(found.address).map(|description| page::register(&description))
}

fn unknown(word: &str) -> Failure {
    let near = near(word);
    let advice = if near.is_empty() {
        "name an AL status code (0x001D), an abort code (0x06090011), a register (0x0130, `AL \
         status`), a state (SAFEOP), a fault name (link-open) or a finding (H101)"
            .to_owned()
    } else {
        format!("try one of: {}", near.join(", "))
    };
    Failure::new(format!("`{word}`: no code or name like this is known"), advice)
}

/// Names that have the word in them.
fn near(word: &str) -> Vec<String> {
    let wanted = word.to_ascii_lowercase();
    let has = |name: &str| wanted.len() > 2 && name.to_ascii_lowercase().contains(&wanted);
    let faults = FaultName::ALL.iter().map(|fault| fault.name()).filter(|name| has(name));
    let registers = register::ALL.iter().map(|register| register.name).filter(|name| has(name));
    let findings = rule::catalogue().into_iter();
    let findings = findings
        .filter(|page| has(page.name) || page.code.to_ascii_lowercase().starts_with(&wanted));
    let codes = status_code::ALL.iter().filter(|code| has(code.name));
    findings
        .map(|page| format!("{} ({})", page.code, page.name))
        .chain(faults.map(str::to_owned))
        .chain(registers.map(|name| format!("`{name}`")))
        .chain(codes.map(|entry| format!("0x{:04X} ({})", entry.code.value(), entry.name)))
        .take(MOST_SUGGESTIONS)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn titles(word: &str) -> Vec<String> {
        pages(word).iter().map(|page| page.title().to_owned()).collect()
    }

    #[test]
    fn a_word_gives_all_that_it_can_mean() {
        assert_eq!(titles("0x001D"), ["AL status code 0x001D: invalid output configuration"]);
        assert_eq!(titles("0x0130"), ["Register 0x0130: AL status"]);
        assert_eq!(titles("al-status"), ["Register 0x0130: AL status"]);
        assert_eq!(titles("0x0303"), ["Register 0x0302: RX error counter, port B"]);
        assert_eq!(titles("safeop"), ["State SAFEOP"]);
        assert_eq!(titles("link-open"), ["Fault link-open"]);
        assert!(titles("h100")[0].starts_with("Finding H100"));
        assert_eq!(titles("0x06010002").len(), 1);
        assert_eq!(titles("0x0011").len(), 1, "a status code, no register");
        assert_eq!(titles("al:0x0130").len(), 1);
        assert_eq!(titles("nonsense"), [""; 0]);
    }

    #[test]
    fn every_entry_of_every_table_has_a_page() {
        for register in register::ALL {
            let word = format!("0x{:04X}", register.address.value());
            assert!(titles(&word).iter().any(|title| title.starts_with("Register")), "{word}");
        }
        for code in status_code::ALL {
            let word = format!("0x{:04X}", code.code.value());
            assert!(titles(&word)[0].starts_with("AL status code"), "{word}");
        }
        for fault in FaultName::ALL {
            assert!(titles(fault.name()).contains(&format!("Fault {fault}")));
        }
    }

    #[test]
    fn a_near_miss_is_told() {
        let failure = unknown("watchdog");
        assert!(failure.next_step.contains("watchdog-starved"), "{failure:?}");
    }
}
