use linesman_proto::address::{DeviceId, RegisterAddress, WorkingCounter};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::port::Port;
use linesman_proto::topology::End;

use super::*;
use crate::compare::{Comparison, Difference};
use crate::identity::{Identity, Mismatch, mismatch};
use crate::plan::expect::expect;
use crate::plan::{Doubt, PathView, Plan, Presence, Role, Served};

/// A coupler with a branch, and a tool behind it: a coupler with a selector and two terminals.
const MACHINE: &str = r#"name = "machine"

[[device]]
name = "K1"
on = "maindevice"
description = { ports = "YKY-" }

[[device]]
name = "T1"
on = "K1.B"
description = { ports = "KK--", inputs_bits = 8, outputs_bits = 8 }

[[device]]
name = "K2"
type = "EK1101"
on = "K1.C"
description = { ports = "YKY-", identification_register = 0x0F18 }

[[device]]
name = "T2"
on = "K2.B"
description = { ports = "KK--", inputs_bits = 8, outputs_bits = 8 }

[[device]]
name = "T3"
on = "T2.B"
description = { ports = "KK--", inputs_bits = 8 }

[[device]]
name = "K3"
on = "K2.C"
description = { ports = "YKY-" }

[[group]]
name = "tool"
first = "K2"
identification = { by = "selector", value = 300 }
"#;

fn with(from: &str, to: &str) -> String {
    assert!(MACHINE.contains(from), "{from}");
    MACHINE.replace(from, to)
}

fn plan(text: &str) -> Plan {
    Project::parse(text).unwrap().plan(&mut |_| Ok(None)).unwrap()
}

fn refused(text: &str) -> String {
    match Project::parse(text) {
        Err(error) => error.to_string(),
        Ok(project) => project.plan(&mut |_| Ok(None)).unwrap_err().to_string(),
    }
}

fn named(plan: &Plan, name: &str) -> Option<Doubt> {
    plan.doubts().into_iter().find(|doubt| doubt.name == name)
}

// proves: HC-08
#[test]
fn a_group_has_its_first_device_all_behind_it_and_the_number_of_its_first_device() {
    let project = Project::parse(MACHINE).unwrap();
    assert_eq!(Project::parse(&project.to_toml()), Ok(project));
    let told_once = plan(MACHINE);
    let group = &told_once.groups[0];
    let names: Vec<&str> =
        group.members.iter().map(|id| told_once.devices[id.index()].name.as_str()).collect();
    assert_eq!((group.name.as_str(), group.optional), ("tool", true));
    assert_eq!(names, ["K2", "T2", "T3", "K3"]);
    assert_eq!(told_once.group_of(DeviceId(0)), None);
    assert!(told_once.is_optional(group.first()));
    let check = told_once.devices[group.first().index()].settings.identification.unwrap();
    let selector = IdentificationSource::Memory(RegisterAddress(0x0F18));
    assert_eq!((check.source, check.value, check.compulsory), (selector, 300, true));
    // Given at the device, it is that of the group.
    let at_device = with(
        "identification = { by = \"selector\", value = 300 }\n",
        "members = [\"T2\", \"T3\", \"K3\"]\n",
    );
    let at_device = at_device
        .replace("type = \"EK1101\"", "identification = { by = \"selector\", value = 300 }");
    let pre_filled = plan(&at_device);
    assert_eq!(pre_filled.groups, told_once.groups);
    let first = &pre_filled.devices[group.first().index()];
    assert_eq!(first.settings.identification, Some(check));
}

// proves: HC-06 partial: the choice of the way, from the description
#[test]
fn the_description_chooses_how_a_selector_is_read_and_the_project_may_say_otherwise() {
    let source = |text: &str| {
        let plan = plan(text);
        plan.devices[plan.groups[0].first().index()].settings.identification.unwrap().source
    };
    let memory = IdentificationSource::Memory(RegisterAddress(0x0F18));
    assert_eq!(source(MACHINE), memory);
    let by_al = with("identification_register = 0x0F18", "identification_register = 0x0134");
    assert_eq!(source(&by_al), IdentificationSource::AlStatus);
    let chosen = with("value = 300 }", "value = 300, register = 0x0134 }");
    assert_eq!(source(&chosen), IdentificationSource::AlStatus);
    let alias = with("by = \"selector\"", "by = \"alias\"");
    assert_eq!(source(&alias), IdentificationSource::Alias);
    let none = refused(&with(", identification_register = 0x0F18", ""));
    assert!(none.contains("names no selector: expected by = \"alias\""), "{none}");
}

// proves: HC-07 partial: none unless set
#[test]
fn without_a_choice_nothing_is_compared() {
    let plan = plan(&MACHINE[..MACHINE.find("[[group]]").unwrap()]);
    assert!(plan.devices.iter().all(|device| device.settings.identification.is_none()));
    assert_eq!(plan.groups, []);
}

#[test]
fn alias_and_serial_are_those_of_the_device_and_what_it_must_be() {
    let text = with("type = \"EK1101\"", "alias = 300\nvendor_id = 2\nproduct_code = 5")
        .replace("{ by = \"selector\", value = 300 }", "{ by = \"alias\" }");
    let first = |text: &str| {
        let plan = plan(text);
        plan.devices[plan.groups[0].first().index()].clone()
    };
    assert_eq!(first(&text).settings.identification.unwrap().value, 300);
    let serial = text.replace("{ by = \"alias\" }", "{ by = \"serial\", value = 70000 }");
    assert_eq!(first(&serial).identity.serial_number, 70_000);
}

#[test]
fn mistakes_in_groups_are_named_with_the_line_and_the_next_step() {
    let again = "\n[[group]]\nname = \"other\"\nfirst = \"K3\"\nidentification = { by = \"alias\", value = 7 }\n";
    let line = MACHINE.lines().position(|line| line == "[[group]]").unwrap() + 1;
    let said = refused(&with("first = \"K2\"", "first = \"K9\""));
    assert!(said.starts_with(&format!("group `tool` (line {line}): first = `K9`")), "{said}");
    for (text, expected) in [
        (format!("{MACHINE}{again}"), "`K3` is in group `tool` already"),
        (
            format!("{MACHINE}{}", again.replace("other", "tool")),
            "another group has this name: give each a name of its own",
        ),
        (
            with("first = \"K2\"", "first = \"K2\"\nmembers = [\"T2\", \"T3\"]"),
            "`K3` hangs behind `K2` and would go with it: add it to `members`",
        ),
        (
            with("first = \"K2\"", "first = \"K2\"\nmembers = [\"T2\", \"T3\", \"K3\", \"T1\"]"),
            "member `T1` does not hang behind `K2`",
        ),
        (
            with("identification = { by = \"selector\", value = 300 }\n", ""),
            "nothing tells it from others: expected `identification",
        ),
        (
            with("{ by = \"selector\", value = 300 }", "\"selector\""),
            "expected a table such as { by = \"selector\", value = 5 }",
        ),
        (with("value = 300 }", "value = 0 }"), "value 0, expected 1 to 65535"),
        (with(", value = 300 }", " }"), "there is no number: expected `value`"),
        (with("value = 300 }", "value = 70000 }"), "value 70000, expected 1 to 65535"),
        (
            with("value = 300 }", "value = 300, compulsory = false }"),
            "a group is known by its number",
        ),
        (with("first = \"K2\"", "first = \"K2\"\nplaces = [\"K9.C\"]"), "no device is called `K9`"),
        (
            with("first = \"K2\"", "first = \"K2\"\nplaces = [\"K1.B\"]"),
            "`T1` hangs at `K1.B`: expected a free port",
        ),
        (
            with("first = \"K2\"", "first = \"K2\"\nplaces = [\"K3.C\"]"),
            "a port of the group itself",
        ),
        (
            with("first = \"K2\"", "first = \"K2\"\nplaces = [\"maindevice\"]"),
            "the first SubDevice is never in a group",
        ),
    ] {
        let error = refused(&text);
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn one_number_for_two_devices_that_may_be_equal_is_refused() {
    let drives = |other: &str| {
        let drive = |name: &str, on: &str, kind: &str, number: u32| {
            format!(
                "[[device]]\nname = \"{name}\"\non = \"{on}\"\ntype = \"{kind}\"\n\
                 identification = {{ by = \"alias\", value = {number} }}\n\
                 description = {{ ports = \"YY--\" }}\n"
            )
        };
        format!("{}{}", drive("X", "maindevice", "AX", 7), drive("Y", "X.B", other, 7))
    };
    let error = refused(&drives("AX"));
    assert!(error.contains("device `Y` (line 7)"), "{error}");
    assert!(error.contains("number 7 is that of `X` already"), "{error}");
    assert!(
        Project::parse(&drives("EL")).is_ok(),
        "devices of other types are told apart by these"
    );
}

// proves: HC-09
#[test]
fn a_group_begins_at_a_coupler_or_a_device_with_a_cable_and_not_at_a_terminal() {
    assert_eq!(named(&plan(MACHINE), "group-terminal"), None);
    let stand_alone =
        with("first = \"K2\"", "first = \"K3\"").replace("by = \"selector\"", "by = \"alias\"");
    assert_eq!(named(&plan(&stand_alone), "group-terminal"), None);
    let terminal =
        with("first = \"K2\"", "first = \"T2\"").replace("by = \"selector\"", "by = \"alias\"");
    let doubt = named(&plan(&terminal), "group-terminal").unwrap();
    assert!(doubt.text.contains("tool begins at T2, a terminal on the E-bus"), "{}", doubt.text);
    assert_eq!(doubt.severity, crate::plan::Severity::Error);
}

#[test]
fn a_group_that_is_absent_or_elsewhere_is_no_difference_from_the_plan() {
    let project = Project::parse(MACHINE).unwrap();
    let may_go = project.optional_devices();
    assert_eq!(may_go, [(2, 2), (3, 2), (4, 2), (5, 2)].into());
    let missing = |planned: usize, all: Vec<usize>| Difference::Missing { planned, all };
    let moved = |planned: usize| Difference::Moved { planned, found: 1, wanted: None, on: None };
    let differences = vec![missing(2, vec![2, 3, 4, 5]), missing(1, vec![1]), moved(2), moved(1)];
    let comparison = Comparison { pairs: Vec::new(), differences };
    let left = comparison.without_groups(|node| may_go.contains_key(&node)).differences;
    assert_eq!(left, [missing(1, vec![1]), moved(1)]);
}

// proves: HC-10
#[test]
fn the_first_subdevice_of_the_line_is_in_no_group() {
    assert_eq!(named(&plan(MACHINE), "group-first"), None);
    let text =
        with("first = \"K2\"", "first = \"K1\"").replace("by = \"selector\"", "by = \"alias\"");
    let doubt = named(&plan(&text), "group-first").unwrap();
    assert!(
        doubt.text.contains("tool holds K1, the first SubDevice of the line"),
        "{}",
        doubt.text
    );
}

// proves: HC-11 partial: it is proposed
#[test]
fn for_a_group_with_one_place_a_sync_unit_of_its_own_is_proposed() {
    assert_eq!(named(&plan(MACHINE), "sync-unit-suffices"), None);
    let fixed = with("first = \"K2\"", "first = \"K2\"\nplaces = [\"K1.C\"]");
    let plan = plan(&fixed);
    assert_eq!(plan.groups[0].places, [End::Controller(0, Port::C)]);
    let doubt = named(&plan, "sync-unit-suffices").unwrap();
    assert!(doubt.text.contains("has one place only, K1.C"), "{}", doubt.text);
}

// proves: HC-13
#[test]
fn fast_ports_go_to_fast_ports_only_and_never_to_the_maindevice() {
    let fast = |k1: &str, k2: &str| {
        let text = with(
            "on = \"maindevice\"\ndescription = { ports = \"YKY-\" }",
            &format!("on = \"maindevice\"\ndescription = {{ ports = \"{k1}\" }}"),
        );
        text.replace(
            "{ ports = \"YKY-\", identification",
            &format!("{{ ports = \"{k2}\", identification"),
        )
    };
    assert_eq!(named(&plan(&fast("YKH-", "HKY-")), "fast-port"), None);
    let doubt = named(&plan(&fast("YKH-", "YKY-")), "fast-port").unwrap();
    assert!(
        doubt.text.contains("K1.C is a fast connecting port and is wired to K2.A"),
        "{}",
        doubt.text
    );
    let doubt = named(&plan(&fast("YKY-", "HKY-")), "fast-port").unwrap();
    assert!(
        doubt.text.contains("K2.A is a fast connecting port and is wired to K1.C"),
        "{}",
        doubt.text
    );
    let doubt = named(&plan(&fast("HKY-", "YKY-")), "fast-port").unwrap();
    assert!(
        doubt.text.contains("K1.A is a fast connecting port and is wired to maindevice"),
        "{}",
        doubt.text
    );
    let elsewhere =
        fast("YKH-", "HKY-").replace("first = \"K2\"", "first = \"K2\"\nplaces = [\"K1.D\"]");
    let elsewhere = elsewhere.replace("ports = \"YKH-\"", "ports = \"YKHY\"");
    let doubt = named(&plan(&elsewhere), "group-place").unwrap();
    assert!(
        doubt.text.contains("that port is for an Ethernet cable, the entry a fast"),
        "{}",
        doubt.text
    );
}

// proves: HC-01 partial: the frames
#[test]
fn a_group_has_datagrams_of_its_own_behind_those_of_all_others() {
    for layout in ["", "\n[network]\nlayout = \"compact\"\n"] {
        let text =
            with("\n[[device]]\nname = \"K1\"", &format!("{layout}\n[[device]]\nname = \"K1\""));
        let plan = plan(&text);
        let group = &plan.groups[0];
        let is_of_group = |id: &DeviceId| group.members.contains(id);
        let data: Vec<_> = (plan.datagrams().map(|(.., datagram)| datagram))
            .filter(|datagram| datagram.role == Role::ProcessData)
            .collect();
        let owners: Vec<Vec<bool>> = (data.iter())
            .map(|datagram| datagram.ownership.iter().map(|one| is_of_group(&one.device)).collect())
            .collect();
        // None is shared, and those of the group come last.
        assert!(
            owners.iter().all(|all| all.windows(2).all(|pair| pair[0] == pair[1])),
            "{owners:?}"
        );
        let firsts: Vec<bool> = owners.iter().map(|all| all[0]).collect();
        assert!(firsts.is_sorted() && firsts.contains(&true), "{firsts:?}");
        // Logical addresses of others are those that they have without the group.
        let alone =
            with("\n[[device]]\nname = \"K1\"", &format!("{layout}\n[[device]]\nname = \"K1\""));
        let end = alone.find("[[device]]\nname = \"K2\"").unwrap();
        let alone = super::tests::plan(&alone[..end]);
        let logical = |plan: &Plan| -> Vec<(Command, DatagramAddress, usize)> {
            let data = plan.datagrams().map(|(.., one)| one);
            data.filter(|one| one.role == Role::ProcessData)
                .map(|one| (one.command, one.address, one.len))
                .collect()
        };
        let (all, fixed) = (logical(&plan), logical(&alone));
        assert_eq!(all[..fixed.len()], fixed);
        // A sync unit that both name stays two.
        let shared = text.replace("on = \"K1.B\"", "on = \"K1.B\"\nsync_unit = \"S\"");
        let shared = shared.replace("on = \"K2.B\"", "on = \"K2.B\"\nsync_unit = \"S\"");
        let units = super::tests::plan(&shared).tasks[0].sync_units.clone();
        assert_eq!(units.iter().filter(|unit| unit.name == "S").count(), 2, "{units:?}");
    }
}

/// Three couplers in a row, with a terminal at each.
fn ring(closes_at: &str) -> String {
    let coupler = |name: &str, on: &str| {
        format!(
            "[[device]]\nname = \"{name}\"\non = \"{on}\"\ndescription = {{ ports = \"YKYY\" }}\n\
             [[device]]\nname = \"T{name}\"\non = \"{name}.B\"\ndescription = {{ ports = \"KK--\" }}\n"
        )
    };
    let line = coupler("K1", "maindevice") + &coupler("K2", "K1.C") + &coupler("K3", "K2.C");
    format!("[ring]\ncloses_at = \"{closes_at}\"\n{line}")
}

/// What a plan says of each place, compared with who is found there.
// proves: HC-03 (U)
#[test]
fn who_is_found_is_compared_by_position_with_the_rule_that_was_chosen() {
    let device = |name: &str, on: &str, more: &str| {
        format!(
            "[[device]]\nname = \"{name}\"\non = \"{on}\"\nvendor_id = 2\nproduct_code = 5\nrevision = 0x00120003\n{more}\n\
             description = {{ ports = \"YY--\" }}\n"
        )
    };
    let rules = [
        ("", 0x0012_0003, 0x0013_0003),
        ("revision_rule = \"any\"", 0, 0),
        ("revision_rule = \"equal-or-greater\"", 0x0013_0000, 0x0012_0002),
        ("revision_rule = \"low-word-equal\"", 0x0001_0003, 0x0012_0004),
        ("revision_rule = \"low-word-equal-high-word-equal-or-greater\"", 0x0013_0003, 0x0011_0003),
        ("revision_rule = \"high-word-equal\"", 0x0012_0009, 0x0013_0003),
        ("revision_rule = \"high-word-equal-or-greater\"", 0x0013_0000, 0x0011_0003),
    ];
    let mut text = device("D0", "maindevice", "serial = 4711");
    for (at, (rule, ..)) in rules.iter().enumerate() {
        text += &device(&format!("D{}", at + 1), &format!("D{at}.B"), rule);
    }
    let plan = plan(&text);
    let compared = |at: usize, found: Identity| {
        let planned = &plan.devices[at];
        mismatch(&planned.identity, &found, planned.revision_rule)
    };
    let right =
        Identity { vendor_id: 2, product_code: 5, revision: 0x0012_0003, serial_number: 4711 };
    for at in 0..plan.devices.len() {
        assert_eq!(compared(at, right), None, "{at}");
        let vendor = Identity { vendor_id: 3, ..right };
        assert_eq!(compared(at, vendor), Some(Mismatch::Vendor), "{at}");
        let product = Identity { product_code: 6, ..right };
        assert_eq!(compared(at, product), Some(Mismatch::Product), "{at}");
        let other_serial = Identity { serial_number: 4712, ..right };
        let expected = (at == 0).then_some(Mismatch::Serial);
        assert_eq!(
            compared(at, other_serial),
            expected,
            "only the first place names a serial: {at}"
        );
    }
    for (at, (rule, accepted, refused)) in rules.into_iter().enumerate() {
        let found = |revision| compared(at + 1, Identity { revision, ..right });
        assert_eq!(found(accepted), None, "{rule} 0x{accepted:08X}");
        let expected = (!rule.contains("any")).then_some(Mismatch::Revision);
        assert_eq!(found(refused), expected, "{rule} 0x{refused:08X}");
    }
}

/// The `RemovableBranch` of the source (S0 L1236-1250): a working counter of its own, and those of all others are the
/// same without it.
// proves: HC-11 (U)
#[test]
fn a_branch_in_a_sync_unit_of_its_own_has_datagrams_of_its_own() {
    let text = MACHINE[..MACHINE.find("[[group]]").unwrap()]
        .replace("name = \"T2\"", "name = \"T2\"\nsync_unit = \"RemovableBranch\"")
        .replace("name = \"T3\"", "name = \"T3\"\nsync_unit = \"RemovableBranch\"");
    let plan = plan(&text);
    let branch: Vec<DeviceId> = (plan.devices.iter())
        .filter(|device| ["T2", "T3"].contains(&device.name.as_str()))
        .map(|device| device.id)
        .collect();
    let full = Presence::full(plan.devices.len());
    let mut without = full.clone();
    branch.iter().for_each(|id| without.set(*id, Served::default()));
    let mut of_branch = 0;
    for (.., datagram) in plan.datagrams().filter(|(.., one)| one.role == Role::ProcessData) {
        let owners = datagram.ownership.iter().map(|own| branch.contains(&own.device));
        let owners: Vec<bool> = owners.collect();
        assert!(owners.iter().all(|is_branch| *is_branch == owners[0]), "{datagram:?}");
        let counter = |presence| expect(datagram, presence, PathView::Merged);
        if owners[0] {
            of_branch += 1;
            assert_eq!(counter(&without), WorkingCounter(0), "{datagram:?}");
        } else {
            assert_eq!(counter(&without), counter(&full), "{datagram:?}");
        }
    }
    assert!(of_branch > 0 && plan.datagrams().count() > of_branch);
}

// proves: RED-07
#[test]
fn a_ring_closes_behind_the_last_subdevice_only() {
    assert_eq!(named(&plan(&ring("K3.C")), "ring-end"), None, "port C of the last coupler");
    let box_end = "[[device]]\nname = \"B\"\non = \"K3.C\"\ndescription = { ports = \"YY--\" }\n";
    let boxed = format!("{}{box_end}", ring("B.B"));
    assert_eq!(named(&plan(&boxed), "ring-end"), None, "port B of the last device with two ports");
    let between = named(&plan(&ring("K2.D")), "ring-end").unwrap();
    assert!(
        between.text.contains("K2.D, between others: K3 hangs behind K2, too"),
        "{}",
        between.text
    );
    let contact = named(&plan(&ring("TK3.B")), "ring-end").unwrap();
    assert!(contact.text.contains("TK3.B, which is a contact for terminals"), "{}", contact.text);
}

// proves: RED-08 (U), RED-09
#[test]
fn cables_that_may_break_are_told_from_those_whose_break_costs_devices() {
    let branch = "[[device]]\nname = \"B\"\non = \"K2.D\"\ndescription = { ports = \"YY--\" }\n\
                  [[device]]\nname = \"C\"\non = \"B.B\"\ndescription = { ports = \"YY--\" }\n";
    let plan = plan(&format!("{}{branch}", ring("K3.C")));
    let name = |id: &DeviceId| plan.devices[id.index()].name.clone();
    let told: Vec<(bool, Vec<String>)> = (plan.cables().iter())
        .map(|cable| (cable.may_break, cable.lost.iter().map(name).collect()))
        .collect();
    assert_eq!(told.iter().filter(|(may_break, _)| *may_break).count(), 4, "{told:?}");
    let costly: Vec<_> = told.iter().filter(|(may_break, _)| !may_break).collect();
    let expected = [vec!["B", "C"], vec!["C"]];
    assert_eq!(costly.iter().map(|(_, lost)| lost.clone()).collect::<Vec<_>>(), expected);
}
