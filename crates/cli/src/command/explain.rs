//! `linesman explain`: what a code, a name, a value or a line of a log means, and what to do about it.
//!
//! A number may be several things: 0x0130 is a register, 0x001D an AL status code, 8130 the code of an
//! emergency. All that it may be is shown, the most likely first. A word in front (`AL`, `abort`,
//! `register`, `object`, `emergency`) says which is meant.

mod bare_number;
mod bytes;
mod codes;
mod commands;
mod findings;
mod found;
mod messages;
mod number;
mod objects;
mod page;
mod prefixed_number;
mod register_bytes;
mod registers;
mod resolve;
mod state_words;
mod states;
mod suggest;
mod topic;
mod vocabulary;
mod working_counter;

use linesman_diagnosis::rule;
use serde::Serialize;

use self::page::{Kind, Page, Reading};
use crate::exit::Status;
use crate::failure::Failure;
use crate::output::Output;
use crate::version;

/// Letters of a word that are repeated when it is unknown.
const MOST_REPEATED: usize = 60;

/// Arguments of the command.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// A code (0x001B, 06010000, 8130), register (0x0130), object (0x1C32:0B), finding (H101), fault,
    /// state (SAFEOP+ERR), command (LRW), word of TwinCAT, IgH or SOEM, value (DL 0x5617), bytes of a
    /// message, or a line of a log; without it, a list of what can be asked
    #[arg(value_name = "WORD", allow_negative_numbers = true)]
    word: Vec<String>,
    /// JSON, schema linesman.explain/1
    #[arg(long)]
    pub(crate) json: bool,
}

/// The answer as JSON.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Report {
    /// `linesman.explain/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// The word or line that was asked; `null` without one.
    asked: Option<String>,
    /// All that it can mean, the most likely first; without a word, what can be asked.
    readings: Vec<Reading>,
}

/// Prints all pages about the word.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    let asked = arguments.word.join(" ");
    let pages = match arguments.word.is_empty() {
        true => vec![overview()],
        false => resolve::resolve(&asked),
    };
    if pages.is_empty() {
        return Err(unknown(&asked));
    }
    if arguments.json {
        output.json(&Report {
            schema: "linesman.explain/1".to_owned(),
            tool: version::tool(),
            asked: (!arguments.word.is_empty()).then_some(asked),
            readings: pages.iter().map(Page::reading).collect(),
        });
        return Ok(Status::Good);
    }
    for (index, page) in pages.iter().enumerate() {
        let gap = if index == 0 { "" } else { "\n" };
        output.text(&format!("{gap}{}", page.render(output.paint(), output.width())));
    }
    Ok(Status::Good)
}

/// A page that lists the kinds of words, with examples.
fn overview() -> Page {
    let topics: Vec<&str> = topic::ALL.iter().map(|topic| topic.name).collect();
    let codes: Vec<&str> = rule::catalogue().into_iter().map(|page| page.code).collect();
    Page::new(Kind::Topic, "linesman explain WORD: what can be asked")
        .fact("codes", "`0x001B`, `1B`, `AL 0x14`, `abort 06010000`, `8130`, `emergency 0x8611`, `FoE 0x8003`")
        .fact("registers", "`0x0130`, `al-status`, `RX error counter port B`; ports: `port B`")
        .fact("objects", "`0x1C12`, `0x1C32:0B`, `6041`, `Statusword`; mapped entries: `60410010`")
        .fact(
            "values",
            "`DL 0x5617`, `rx 0x0412`, `0x6041 = 0x0237`, `State 0x2408`, `DevState 0x0800`, `WKC 2/3`",
        )
        .fact("bytes", "`00 E0 21 1C …` (diagnosis message), `30 81 11 00 00 00 00 00` (emergency)")
        .fact("states", "`SAFEOP`, `SAFEOP+ERR`, `OP LNK_MIS B`")
        .fact("commands", "`LRW`, `FPRD` and the other thirteen")
        .fact(
            "words",
            "`WKC`, `SYNC0`, `WcState`, `NO_COMM`, `VPRS`, `SKIPPED`, `no slaves found`; a line of a log, whole",
        )
        .fact("findings", format!("{} to {}, as `linesman diagnose` gives them", codes.first().unwrap_or(&""), codes.last().unwrap_or(&"")))
        .fact("faults", "`link-open`, `cable-degraded` and the other causes of findings")
        .fact("topics", topics.join(", "))
}

fn unknown(asked: &str) -> Failure {
    let near = suggest::near(asked);
    let advice = if near.is_empty() {
        "name an AL status code (0x001D), an abort code (0x06090011), a register (0x0130, `AL status`), an \
         object (0x1C32:0B), a state (SAFEOP), a fault name (link-open) or a finding (H101); `linesman \
         explain` lists what can be asked"
            .to_owned()
    } else {
        format!("try one of: {}", near.join(", "))
    };
    let shown: String = asked.chars().take(MOST_REPEATED).flat_map(char::escape_debug).collect();
    let more = if asked.chars().count() > MOST_REPEATED { "…" } else { "" };
    let reason = match asked.len() > resolve::MOST_LETTERS {
        true => format!(
            "`{shown}{more}`: {} letters, at most {} are looked at",
            asked.len(),
            resolve::MOST_LETTERS
        ),
        false => format!("`{shown}{more}`: no code or name like this is known"),
    };
    Failure::new(reason, advice)
}

#[cfg(test)]
mod tests {
    use linesman_config::fault::FaultName;
    use linesman_proto::mailbox::abort_code;
    use linesman_proto::mailbox::coe::{emergency, standard_object};
    use linesman_proto::register;
    use linesman_proto::state::status_code;

    use super::*;
    use crate::output::Paint;

    fn titles(word: &str) -> Vec<String> {
        resolve::resolve(word).iter().map(|page| page.title().to_owned()).collect()
    }

    /// Every word that any table has.
    fn all_words() -> Vec<String> {
        let mut words: Vec<String> = Vec::new();
        words.extend(register::ALL.iter().map(|entry| format!("0x{:04X}", entry.address.value())));
        words.extend(
            status_code::ALL.iter().map(|entry| format!("al:0x{:04X}", entry.code.value())),
        );
        words.extend(abort_code::ALL.iter().map(|entry| format!("0x{:08X}", entry.code.value())));
        words.extend(
            emergency::code::ALL.iter().map(|entry| format!("emergency 0x{:04X}", entry.code)),
        );
        words.extend(standard_object::all().map(|object| format!("object {}", object.first)));
        words.extend(FaultName::ALL.iter().map(|fault| fault.name().to_owned()));
        words.extend(rule::catalogue().iter().map(|page| page.code.to_owned()));
        words.extend(topic::ALL.iter().map(|topic| topic.name.to_owned()));
        words.extend(vocabulary::all().flat_map(|word| word.spellings()).map(str::to_owned));
        words
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
        for object in standard_object::all() {
            let word = object.first.to_string();
            assert!(titles(&word)[0].starts_with("CoE object"), "{word}: {:?}", titles(&word));
        }
        for fault in FaultName::ALL {
            assert!(titles(fault.name()).contains(&format!("Fault {fault}")));
        }
    }

    #[test]
    fn no_page_shows_marks_of_markdown_or_a_line_too_long() {
        for word in all_words() {
            let pages = resolve::resolve(&word);
            assert!(!pages.is_empty(), "{word}");
            for (page, width) in pages.iter().flat_map(|page| [(page, 60), (page, 110)]) {
                let text = page.render(Paint::PLAIN, width);
                for mark in ["`", "**", "\n  #", "](", "| ", "|---"] {
                    assert!(!text.contains(mark), "{word}: {mark} in {text}");
                }
                for line in text.lines() {
                    let room = line.trim_start();
                    let is_one_word = !room.trim_start_matches("- ").contains(' ');
                    assert!(
                        line.chars().count() <= width || is_one_word,
                        "{word}: {width}: {line}"
                    );
                }
            }
        }
    }

    #[test]
    fn bytes_behind_an_address_are_told_register_by_register() {
        let counters = [
            "RX error counter, port A (0x0300) = 0x1200",
            "RX error counter, port B (0x0302) = 0x0003",
        ];
        for line in ["0x0300: 00 12 03 00", "slave 3 0x0300: 00 12 03 00", "0x0300 00 12 03 00"] {
            assert_eq!(titles(line)[..2], counters, "{line}");
        }
        assert_eq!(titles("0x0110: 37 56")[0], "DL status (0x0110) = 0x5637");
        // Of a register that is cut off nothing is said.
        assert_eq!(titles("0x0300: 00 12 03")[0], counters[0]);
        assert!(!titles("0x0300: 00 12 03").iter().any(|title| title.contains("0x0302")));
        assert!(titles("0x0134: 1b 00")[0].starts_with("AL status code 0x001B"));
    }

    #[test]
    fn return_codes_of_ads_are_told_in_both_bases() {
        for word in ["ADS 0x701", "ADS error 1793", "ads error code 0x0701"] {
            assert_eq!(
                titles(word)[0],
                "ADS return code 0x701 (1793): service not supported",
                "{word}"
            );
        }
        let unknown = &titles("ADS 0x7FF")[0];
        assert!(unknown.starts_with("ADS return code 0x7FF (2047): none"), "{unknown}");
    }

    #[test]
    fn a_near_miss_is_told() {
        let failure = unknown("watchdog-strved");
        assert!(failure.next_step.contains("watchdog-starved"), "{failure:?}");
    }
}
