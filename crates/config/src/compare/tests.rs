use linesman_proto::address::Path;
use linesman_proto::port::Port::{self, A, B, C};
use linesman_proto::topology::Wired;

use super::*;

const EK1100: u32 = 0x044C_2C52;
const EL1008: u32 = 0x03F0_3052;
const EL2008: u32 = 0x07D8_3052;

fn identity(product_code: u32) -> Option<Identity> {
    Some(Identity { vendor_id: 2, product_code, revision: 1, serial_number: 0 })
}

fn tree(wired: &[(Option<(usize, Port)>, Port)]) -> Tree {
    let wired: Vec<Wired> = wired
        .iter()
        .map(|(on, entry)| Wired {
            on: on.map_or(End::MainDevice(Path::A), |(node, port)| End::Controller(node, port)),
            entry: *entry,
        })
        .collect();
    Tree::from_wiring(&wired, None).unwrap()
}

/// Each as (product, where it hangs), all entered at port A.
fn line(devices: &[(u32, Option<(usize, Port)>)]) -> (Tree, Vec<u32>) {
    let wired: Vec<_> = devices.iter().map(|(_, on)| (*on, A)).collect();
    (tree(&wired), devices.iter().map(|(product, _)| *product).collect())
}

fn compared(planned: &(Tree, Vec<u32>), found: &(Tree, Vec<u32>)) -> Comparison {
    let wanted: Vec<Wanted> = planned
        .1
        .iter()
        .map(|code| Wanted { identity: identity(*code), ..Wanted::default() })
        .collect();
    let there: Vec<There> =
        found.1.iter().map(|code| There { identity: identity(*code), alias: None }).collect();
    compare(Side { tree: &planned.0, nodes: &wanted }, Side { tree: &found.0, nodes: &there })
}

fn press() -> (Tree, Vec<u32>) {
    line(&[
        (EK1100, None),
        (EL2008, Some((0, B))),
        (EL1008, Some((1, B))),
        (EK1100, Some((0, C))),
        (EL1008, Some((3, B))),
        (EK1100, Some((3, C))),
    ])
}

#[test]
fn equal_plan_and_scan_have_no_differences() {
    let comparison = compared(&press(), &press());
    assert_eq!(comparison.differences, []);
    assert_eq!(comparison.pairs, (0..6).map(Some).collect::<Vec<_>>());
}

// proves: HW-01 partial: the comparison itself
#[test]
fn a_terminal_too_few_or_too_many_is_one_difference_and_not_all_behind_it() {
    let without = line(&[
        (EK1100, None),
        (EL1008, Some((0, B))),
        (EK1100, Some((0, C))),
        (EL1008, Some((2, B))),
        (EK1100, Some((2, C))),
    ]);
    let missing = compared(&press(), &without);
    assert_eq!(missing.differences, [Difference::Missing { planned: 1, all: vec![1] }]);
    assert_eq!(missing.pairs, [Some(0), None, Some(1), Some(2), Some(3), Some(4)]);
    let extra = compared(&without, &press());
    let on = Some(End::Controller(0, B));
    assert_eq!(extra.differences, [Difference::Extra { found: 1, all: vec![1], on }]);
}

#[test]
fn another_device_and_two_in_each_others_place_are_told_apart() {
    let mut other = press();
    other.1[4] = EL2008;
    let [Difference::Wrong { planned: 4, found: 4, what }] =
        compared(&press(), &other).differences[..]
    else {
        panic!("{:?}", compared(&press(), &other).differences);
    };
    assert_eq!(what, Unlike::Identity(Mismatch::Product));
    let mut swapped = press();
    swapped.1.swap(1, 2);
    assert_eq!(
        compared(&press(), &swapped).differences,
        [Difference::Swapped { one: 1, other: 2, twins: false }]
    );
}

#[test]
fn a_device_the_wrong_way_round_keeps_what_hangs_on_it() {
    // The coupler is entered at C, and what hung on C hangs on A.
    let wired = [
        (None, A),
        (Some((0, B)), A),
        (Some((1, B)), A),
        (Some((0, C)), C),
        (Some((3, B)), A),
        (Some((3, A)), A),
    ];
    let found = (tree(&wired), press().1);
    let reversed = Difference::Reversed { planned: 3, found: 3, entry: C, wanted: A };
    assert_eq!(compared(&press(), &found).differences, [reversed]);
}

// proves: HW-02 partial: the comparison itself
#[test]
fn a_cable_in_another_port_is_one_cable_and_no_missing_devices() {
    let planned = line(&[
        (EK1100, None),
        (EL2008, Some((0, B))),
        (EK1100, Some((0, C))),
        (EL1008, Some((2, B))),
        (EL1008, Some((3, B))),
    ]);
    // The second group hangs behind the terminal, the socket of the coupler is empty.
    let found = line(&[
        (EK1100, None),
        (EL2008, Some((0, B))),
        (EK1100, Some((1, B))),
        (EL1008, Some((2, B))),
        (EL1008, Some((3, B))),
    ]);
    let wanted = Some(End::Controller(0, C));
    let on = Some(End::Controller(1, B));
    let comparison = compared(&planned, &found);
    assert_eq!(comparison.differences, [Difference::Moved { planned: 2, found: 2, wanted, on }]);
    assert_eq!(comparison.pairs, (0..5).map(Some).collect::<Vec<_>>());
}

#[test]
fn twins_are_told_by_their_alias() {
    let (tree, codes) = press();
    let with = |aliases: [u16; 6]| -> Vec<There> {
        let all = codes.iter().zip(aliases);
        all.map(|(code, alias)| There { identity: identity(*code), alias: Some(alias) }).collect()
    };
    let wanted: Vec<Wanted> = codes
        .iter()
        .zip([0, 0, 11, 0, 12, 0])
        .map(|(code, alias)| Wanted {
            identity: identity(*code),
            alias: (alias != 0).then_some(alias),
            ..Wanted::default()
        })
        .collect();
    let planned = Side { tree: &tree, nodes: &wanted[..] };
    let right = with([0, 5, 11, 0, 12, 0]);
    assert_eq!(compare(planned, Side { tree: &tree, nodes: &right }).differences, []);
    let swapped = with([0, 0, 12, 0, 11, 0]);
    assert_eq!(
        compare(planned, Side { tree: &tree, nodes: &swapped }).differences,
        [Difference::Swapped { one: 2, other: 4, twins: true }]
    );
}

#[test]
fn a_thousand_terminals_with_one_missing_are_compared_at_once() {
    let chain = |codes: Vec<u32>| {
        let wired: Vec<_> =
            (0..codes.len()).map(|at| (at.checked_sub(1).map(|before| (before, B)), A)).collect();
        (tree(&wired), codes)
    };
    let codes: Vec<u32> = (0..1_000).map(|at| if at % 3 == 0 { EL1008 } else { EL2008 }).collect();
    let mut fewer = codes.clone();
    fewer.remove(500);
    let comparison = compared(&chain(codes), &chain(fewer));
    let [Difference::Missing { all, .. }] = &comparison.differences[..] else {
        panic!("{:?}", comparison.differences);
    };
    assert_eq!(all.len(), 1);
}
