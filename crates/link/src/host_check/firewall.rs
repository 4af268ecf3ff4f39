//! Rules of a firewall that stop what Ethernet over EtherCAT sends: pings, and packets that are passed on.
//!
//! Reference: S0 L2985-3067 (EOE-13); nft(8). The kernel tells its rules to the program `nft` alone, which is asked
//! for them (`nft list ruleset`) and changes nothing; rules that `iptables` has set are among them. Where there is no
//! such program, files tell whether any rules are loaded.

use std::process::Command;

use super::{Area, Check, Files, Outcome};

const NAME: &str = "firewall";

/// Rules of a firewall, as `nft list ruleset` prints them.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum FirewallRules {
    /// They were printed.
    Listed(String),
    /// They were not, and why.
    NotKnown(String),
}

impl FirewallRules {
    /// Asks `nft` for the rules of this host, or rather of the network namespace of this process.
    #[must_use]
    pub fn ask() -> Self {
        match Command::new("nft").args(["list", "ruleset"]).output() {
            Ok(answer) if answer.status.success() => {
                Self::Listed(String::from_utf8_lossy(&answer.stdout).into_owned())
            }
            Ok(answer) => {
                let words = String::from_utf8_lossy(&answer.stderr);
                let first = words.lines().next().unwrap_or("no reason given");
                Self::NotKnown(format!("`nft list ruleset` fails: {first}"))
            }
            Err(error) => Self::NotKnown(format!("`nft` cannot be asked: {error}")),
        }
    }
}

/// The check; without rules, files tell whether there are any.
pub(super) fn check(files: &Files, rules: Option<&FirewallRules>) -> Check {
    let why = match rules {
        Some(FirewallRules::Listed(text)) => return judged(text),
        Some(FirewallRules::NotKnown(why)) => Some(why.as_str()),
        None => None,
    };
    by_files(files, why)
}

fn judged(text: &str) -> Check {
    let stops = stopping(text);
    if stops.is_empty() {
        let found = match text.trim().is_empty() {
            true => "no rules of a firewall are loaded",
            false => {
                "rules of a firewall are loaded, and none of those that see packets of this computer drops any"
            }
        };
        return Check::good(Area::Network, NAME, found);
    }
    let check = Check::new(
        Area::Network,
        NAME,
        Outcome::Doubtful,
        format!("rules of a firewall drop packets: {}", stops.join("; ")),
    );
    with_advice(check.effect("they may stop pings, and packets between the LAN and SubDevices"))
}

fn with_advice(check: Check) -> Check {
    check
        .mend("sudo nft list ruleset   # shows them: chains input and forward, icmp type echo-request")
        .mend("sudo nft insert rule ip filter FORWARD iifname eoe0 accept   # and the same with oifname; as your rules are called")
}

/// The hooks through which packets to this computer, from it, and between others pass.
const HOOKS: [&str; 3] = ["input", "forward", "output"];

/// Most that are named.
const SHOWN: usize = 4;

/// The rules and policies that drop or reject packets, each with its chain. Chains without a hook count: others may
/// jump there.
fn stopping(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let (mut chain, mut matters) = (String::new(), false);
    for line in text.lines().map(str::trim) {
        let mut words = line.split_whitespace();
        if let (Some("chain"), Some(name)) = (words.next(), words.next()) {
            (chain, matters) = (name.to_owned(), true);
            continue;
        }
        if let Some(hook) = line.split_whitespace().skip_while(|word| *word != "hook").nth(1) {
            matters = HOOKS.contains(&hook);
            if matters && line.contains("policy drop") {
                found.push(format!("chain {chain}: what no rule accepts"));
            }
            continue;
        }
        let verdict = |word: &str| matches!(word.trim_end_matches(';'), "drop" | "reject");
        if matters && line.split_whitespace().any(verdict) {
            found.push(format!("chain {chain}: {line}"));
        }
    }
    let more = found.len().saturating_sub(SHOWN);
    found.truncate(SHOWN);
    if more > 0 {
        found.push(format!("and {more} more"));
    }
    found
}

fn by_files(files: &Files, why: Option<&str>) -> Check {
    let modules = files.text("proc/modules");
    let old = files.text("proc/net/ip_tables_names");
    let old = old.unwrap_or_default().split_whitespace().any(|table| table == "filter");
    let new = modules.as_deref().unwrap_or_default().lines().any(|line| {
        let mut words = line.split_whitespace();
        // The third word counts users: rules.
        words.next() == Some("nf_tables") && words.nth(1).is_some_and(|users| users != "0")
    });
    if modules.is_none() && !old {
        let no_file = "/proc/modules does not tell";
        let found = why.map_or_else(|| no_file.to_owned(), |why| format!("{why}; {no_file}"));
        return Check::unknown(Area::Network, NAME, &found);
    }
    if !old && !new {
        return Check::good(Area::Network, NAME, "no rules of a firewall are loaded");
    }
    let check =
        Check::new(Area::Network, NAME, Outcome::Doubtful, "rules of a firewall are loaded");
    with_advice(check.effect("they may stop pings, and packets between the LAN and SubDevices"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: &str = "table inet filter {\n\tchain input {\n\t\ttype filter hook input priority filter; policy accept;\n\
        \t\ticmp type echo-request drop\n\t\ttcp dport 22 accept\n\t}\n\tchain forward {\n\
        \t\ttype filter hook forward priority filter; policy drop;\n\t}\n\
        \tchain early {\n\t\ttype filter hook prerouting priority raw; policy accept;\n\t\tip saddr 10.0.0.1 drop\n\t}\n}\n";

    #[test]
    fn rules_that_drop_packets_are_named_with_their_chains() {
        assert_eq!(
            stopping(RULES),
            ["chain input: icmp type echo-request drop", "chain forward: what no rule accepts"]
        );
        let harmless =
            RULES.replace("policy drop", "policy accept").replace("request drop", "request accept");
        assert_eq!(stopping(&harmless), Vec::<String>::new());
        let many = "chain a {\n".to_owned() + &"drop\n".repeat(7);
        assert_eq!(stopping(&many).last().unwrap(), "and 3 more");
    }

    #[test]
    fn rules_that_nobody_can_list_are_not_known() {
        let files = Files::below("/nowhere/at/all");
        let outcome = |rules: Option<&FirewallRules>| check(&files, rules).outcome;
        let listed = |text: &str| FirewallRules::Listed(text.to_owned());
        assert_eq!(outcome(Some(&listed(""))), Outcome::Good);
        assert_eq!(outcome(Some(&listed(RULES))), Outcome::Doubtful);
        assert_eq!(outcome(None), Outcome::Unknown);
        let not_known = FirewallRules::NotKnown("`nft` cannot be asked: not found".to_owned());
        let check = check(&files, Some(&not_known));
        assert_eq!(check.outcome, Outcome::Unknown);
        assert!(check.found.contains("`nft` cannot be asked"), "{}", check.found);
    }
}
