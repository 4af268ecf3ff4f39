//! The rules: each one file, whose doc comment is its manual page.
//!
//! A rule is a pure function of the line. It is asked whenever something was learnt, and says all
//! conditions that hold or held, each time anew; [`crate::finding`] keeps track of what is news.

pub mod assumed_wiring;
pub mod clock_drift;
pub mod counters;
pub mod damage_at_probe;
pub mod device_message;
pub mod early_link;
pub mod ebus_budget;
pub mod emergency;
pub mod errors_at_device;
pub mod ethernet;
pub mod exchanged;
pub mod fewer_answer;
pub mod foreign_frames;
pub mod frame_errors;
pub mod frames_unplaced;
pub mod host_trouble;
pub mod identity;
pub mod inputs_still;
pub mod jitter;
pub mod late;
pub mod link_changed;
pub mod link_lost;
pub mod long_delay;
pub mod mailbox;
pub mod nobody_answers;
pub mod not_answering;
pub mod one_direction;
pub mod paused;
pub mod processor_stopped;
pub mod reference_clock;
pub mod reported_late;
pub mod reported_trouble;
pub mod reported_wrong;
pub mod restarted;
pub mod ring_reversed;
pub mod second_maindevice;
pub mod shared_address;
pub mod state_behind;
pub mod state_error;
pub mod state_unanswered;
pub mod watchdog_short;
pub mod wiring;
pub mod working_counter;

use linesman_config::fault::Class;
use linesman_proto::time::Instant;

use crate::finding::{Condition, Severity};
use crate::model::NetworkModel;

/// What a rule is: shown by `linesman explain CODE`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RulePage {
    /// `H1xx` hardware, `S2xx` software, `C3xx` configuration, `T4xx` timing, `X5xx` host.
    pub code: &'static str,
    /// Short name, lower case with hyphens.
    pub name: &'static str,
    /// How bad its conditions usually are.
    pub severity: Severity,
    /// Who is called.
    pub class: Class,
    /// The source file of the rule: its doc comment is the manual page. Given by `include_str!`.
    pub source: &'static str,
}

impl RulePage {
    /// The manual page: the doc comment at the head of the rule's file, in Markdown.
    #[must_use]
    pub fn manual(&self) -> String {
        let doc = self.source.lines().take_while(|model| model.starts_with("//!"));
        let mut text = String::new();
        for model in doc {
            let model = model.trim_start_matches("//!");
            text.push_str(model.strip_prefix(' ').unwrap_or(model));
            text.push('\n');
        }
        text
    }
}

/// A rule.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// Its pages, one for each code it gives.
    pub pages: &'static [RulePage],
    /// Looks at the line and adds all conditions that hold or held.
    pub judge: fn(&View<'_>, &mut Vec<Condition>),
}

/// What a rule may look at.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// What is known of the network.
    pub model: &'a NetworkModel,
    /// The time of the latest frame or observation.
    pub now: Instant,
    /// Whether the input is at its end: nothing more will come that could settle an open question.
    pub has_ended: bool,
}

/// All rules, causes before what may follow from them.
pub const RULES: &[Rule] = &[
    // Hardware, configuration and host: frame errors, links, devices.
    link_lost::RULE,
    early_link::RULE,
    not_answering::RULE,
    frame_errors::RULE,
    identity::RULE,
    wiring::RULE,
    ring_reversed::RULE,
    ebus_budget::RULE,
    reported_wrong::RULE,
    //
    // The network as a whole, working counters and states.
    nobody_answers::RULE,
    fewer_answer::RULE,
    shared_address::RULE,
    restarted::RULE,
    reference_clock::RULE,
    clock_drift::RULE,
    processor_stopped::RULE,
    watchdog_short::RULE,
    state_error::RULE,
    state_unanswered::RULE,
    working_counter::RULE,
    one_direction::RULE,
    emergency::RULE,
    host_trouble::RULE,
    jitter::RULE,
    late::RULE,
    paused::RULE,
    mailbox::RULE,
    ethernet::RULE,
    inputs_still::RULE,
    device_message::RULE,
    counters::RULE,
    second_maindevice::RULE,
    foreign_frames::RULE,
    //
    // What another tool tells, where nothing above explains it; and what was exchanged, of all above.
    reported_trouble::RULE,
    state_behind::RULE,
    reported_late::RULE,
    long_delay::RULE,
    errors_at_device::RULE,
    damage_at_probe::RULE,
    frames_unplaced::RULE,
    link_changed::RULE,
    exchanged::RULE,
    assumed_wiring::RULE,
];

/// The manual: every page of every rule, by code.
#[must_use]
pub fn catalogue() -> Vec<&'static RulePage> {
    let mut pages: Vec<_> = RULES.iter().flat_map(|rule| rule.pages).collect();
    pages.sort_by_key(|page| page.code);
    pages
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_is_unique_and_has_a_manual_page() {
        let pages = catalogue();
        assert!(pages.is_sorted_by(|a, b| a.code < b.code), "a code twice");
        for page in pages {
            let letter = match page.class {
                Class::Hardware => 'H',
                Class::Software => 'S',
                Class::Configuration => 'C',
                Class::Timing => 'T',
                Class::Host => 'X',
            };
            assert!(page.code.starts_with(letter), "{}", page.code);
            let manual = page.manual();
            assert!(manual.starts_with("# "), "{}", page.code);
            for part in ["How it is found.", "What it means.", "What to do."] {
                assert!(manual.contains(part), "{}: {part}", page.code);
            }
        }
    }
}
