//! `ethercat domains` and `ethercat domains -v` of the IgH EtherCAT Master: working counters, and who shares in
//! them.

use super::fact::{Block, FactKind, Format, SubDeviceRef, extent};
use super::igh_slaves::configured;
use super::text::{Line, between, hex, leading_number, so_many};
use crate::observation_file::{LogicalCommand, ObservedWorkingCounter};

struct Domain {
    name: String,
    received: u16,
    expected: u16,
}

fn domain(line: &str) -> Option<Domain> {
    let rest = line.trim().strip_prefix("Domain")?;
    let (index, rest) = leading_number(rest)?;
    let rest = rest.strip_prefix(':')?;
    let (received, expected) = working_counter(rest.split_once("WorkingCounter")?.1)?;
    Some(Domain { name: format!("domain {index}"), received, expected })
}

/// `7/9`: what came, and what should have.
pub(super) fn working_counter(text: &str) -> Option<(u16, u16)> {
    let (received, rest) = leading_number(text.trim_start())?;
    let (expected, _) = leading_number(rest.strip_prefix('/')?)?;
    Some((u16::try_from(received).ok()?, u16::try_from(expected).ok()?))
}

/// `SlaveConfig 1001:0, SM3 ( Input), LogAddr 0x00000006, Size 6`.
fn share(line: &str) -> Option<(SubDeviceRef, bool)> {
    let whom = configured(between(line, "SlaveConfig ", ",")?)?;
    Some((whom, line.contains("Input")))
}

fn is_data(line: &str) -> bool {
    let mut words = line.split_whitespace().peekable();
    words.peek().is_some() && words.all(|word| word.len() == 2 && hex(word).is_some())
}

/// Takes all domains in a row.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    domain(&lines.first()?.text)?;
    let mut block = Block::new(Format::IghDomains);
    let mut seen = Vec::new();
    (block.lines, block.unused) = extent(lines, |line| {
        if let Some(domain) = domain(&line.text) {
            let is_new = !seen.contains(&domain.name);
            seen.push(domain.name);
            return is_new;
        }
        share(&line.text).is_some() || is_data(&line.text)
    });
    let mut domains: Vec<(Domain, Vec<(SubDeviceRef, bool)>)> = Vec::new();
    for line in &lines[..block.lines] {
        if let Some(domain) = domain(&line.text) {
            domains.push((domain, Vec::new()));
        } else if let (Some(share), Some((_, shares))) = (share(&line.text), domains.last_mut()) {
            shares.push(share);
        }
    }
    block.what = format!("`ethercat domains` of {}", so_many(domains.len(), "domain"));
    for (domain, shares) in domains {
        let has = |inputs| shares.iter().any(|(_, is_input)| *is_input == inputs);
        let command = match (has(true), has(false)) {
            (true, false) => LogicalCommand::Lrd,
            (false, true) => LogicalCommand::Lwr,
            (true, true) | (false, false) => LogicalCommand::Lrw,
        };
        let counter = ObservedWorkingCounter {
            name: Some(domain.name),
            command,
            expected: Some(domain.expected),
            received: Some(domain.received),
            ..ObservedWorkingCounter::default()
        };
        let mut whom: Vec<SubDeviceRef> = shares.into_iter().map(|(whom, _)| whom).collect();
        whom.dedup();
        block.tell(FactKind::WorkingCounter(Box::new(counter), whom));
    }
    Some(block)
}

#[cfg(test)]
mod tests {
    use super::super::text::lines;
    use super::*;

    #[test]
    fn domains_give_counters_and_who_shares_in_them() {
        let text = "Domain0: LogBaseAddr 0x00000000, Size   6, WorkingCounter 2/3\n\
                    \x20 SlaveConfig 1001:0, SM2 (Output), LogAddr 0x00000000, Size 2\n    00 1f\n\
                    \x20 SlaveConfig 0:3, SM3 ( Input), LogAddr 0x00000002, Size 4\n    00 00 00 00\n\
                    Domain1: LogBaseAddr 0x00000006, Size   6, WorkingCounter 1/1 (1+0)\n";
        let block = take(&lines(text)).unwrap();
        assert_eq!(block.lines, 6);
        let [first, second] = &block.facts[..] else { panic!("{:?}", block.facts) };
        let FactKind::WorkingCounter(counter, whom) = &first.what else { panic!() };
        assert_eq!((counter.received, counter.expected), (Some(2), Some(3)));
        assert_eq!(whom[..], [SubDeviceRef::Alias(1001, 0), SubDeviceRef::Position(3)]);
        let FactKind::WorkingCounter(counter, whom) = &second.what else { panic!() };
        assert_eq!((counter.received, counter.expected, whom.len()), (Some(1), Some(1), 0));
        assert!(take(&lines("Domain0: nothing")).is_none());
    }
}
