//! Pages about findings and faults.

use linesman_config::fault::{Class, FaultName};
use linesman_diagnosis::rule::RulePage;

use super::page::{Kind, Page};
use crate::text::finding::severity_word;

/// A page about a finding: the manual page of its rule.
pub(super) fn finding(page: &RulePage) -> Page {
    let severity = severity_word(page.severity);
    let title = format!("Finding {} {} ({severity}, {})", page.code, page.name, class(page.class));
    Page::new(Kind::Finding, title).markdown(page.manual().trim())
}

/// A page about a fault name.
pub(super) fn fault(fault: FaultName) -> Page {
    Page::new(Kind::Fault, format!("Fault {fault}"))
        .text(fault.meaning())
        .fact("class", class(fault.class()))
}

const fn class(class: Class) -> &'static str {
    match class {
        Class::Hardware => "hardware",
        Class::Software => "software",
        Class::Configuration => "configuration",
        Class::Timing => "timing",
        Class::Host => "host",
    }
}
