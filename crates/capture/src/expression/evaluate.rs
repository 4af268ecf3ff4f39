//! Evaluation of an expression on a frame, or on one datagram of it.

use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{destination, source};
use linesman_proto::frame::Datagram;

use super::field::{FieldReference, FieldSource, address};
use super::node::{ExpressionNode, Leaf, Test};
use crate::knowledge::DeviceIndex;
use crate::row::{CaptureRow, DatagramRow};

/// True if a node is true of a frame; of datagram `only` alone, where one is given.
pub(super) fn holds(
    node: &ExpressionNode,
    row: &CaptureRow<'_>,
    only: Option<usize>,
    devices: Option<&DeviceIndex>,
) -> bool {
    let is_true = |part: &ExpressionNode| holds(part, row, only, devices);
    match node {
        ExpressionNode::Or(parts) => parts.iter().any(is_true),
        ExpressionNode::And(parts) => parts.iter().all(is_true),
        ExpressionNode::Xor(parts) => parts.iter().filter(|part| is_true(part)).count() % 2 == 1,
        ExpressionNode::Not(part) => !is_true(part),
        ExpressionNode::OneDatagram(part) => match only {
            Some(_) => is_true(part),
            None => (0..row.datagrams.len()).any(|index| holds(part, row, Some(index), devices)),
        },
        ExpressionNode::Leaf(leaf) => Look { row, only, devices }.leaf(leaf),
    }
}

/// The frame on which a leaf is evaluated.
struct Look<'l, 'a> {
    row: &'l CaptureRow<'a>,
    only: Option<usize>,
    devices: Option<&'l DeviceIndex>,
}

impl<'a> Look<'_, 'a> {
    fn leaf(&self, leaf: &Leaf) -> bool {
        match leaf {
            Leaf::Exists(reference) => {
                let mut is_there = false;
                self.values(*reference, &mut |_| {
                    is_there = true;
                    false
                });
                is_there
            }
            Leaf::Values(test) => self.test(test),
            // Nobody is found before words are looked up.
            Leaf::SubDevices(_) => false,
            Leaf::Around(around) => around.holds(self.row.frame.time),
        }
    }

    fn test(&self, test: &Test) -> bool {
        let (mut met, mut missed) = (false, false);
        self.values(test.reference, &mut |value| {
            let value = test.mask.map_or(value, |mask| value & mask);
            let is_within = test.ranges.iter().any(|range| range.contains(&value));
            let is_met = is_within != test.outside;
            met |= is_met;
            missed |= !is_met;
            if test.all { !missed } else { !met }
        });
        met && !(test.all && missed)
    }

    /// Gives the values of a field one by one, until `receive` wants no more.
    fn values(&self, reference: FieldReference, receive: &mut dyn FnMut(i128) -> bool) {
        let each = |value: &dyn Fn(&DatagramRow<'a>) -> Option<i128>,
                    receive: &mut dyn FnMut(i128) -> bool| {
            let all = self.datagrams(reference.datagram).iter();
            all.filter_map(value).all(receive);
        };
        match reference.field.source {
            FieldSource::Frame(value) => {
                value(self.row).map(receive);
            }
            FieldSource::Addresses => {
                let bytes = self.row.frame.bytes;
                let both = [address(destination(bytes)), address(source(bytes))];
                both.into_iter().flatten().all(receive);
            }
            FieldSource::Datagram(value) => each(&|row| value(row), receive),
            FieldSource::Mailbox(value) => each(&|row| value(&row.mailbox()?), receive),
            FieldSource::Registers => {
                let all = self.datagrams(reference.datagram).iter();
                all.flat_map(|row| registers(&row.datagram)).all(receive);
            }
            FieldSource::SubDevices => {
                let Some(devices) = self.devices else { return };
                let all = self.datagrams(reference.datagram).iter();
                let concerned = |row: &DatagramRow<'a>| devices.concerned(&row.datagram, self.row);
                all.flat_map(concerned).map(i128::from).all(receive);
            }
        }
    }

    /// The datagrams that count: all, the one that is looked at, or the one with the number of the field.
    fn datagrams(&self, numbered: Option<u8>) -> &[DatagramRow<'a>] {
        let all = &self.row.datagrams;
        let one = |index: usize| all.get(index..=index).unwrap_or_default();
        match (self.only, numbered.map(usize::from)) {
            (Some(only), Some(number)) if only != number => &[],
            (_, Some(number)) => one(number),
            (Some(only), None) => one(only),
            (None, None) => all,
        }
    }
}

/// Each address that a datagram covers; none for process data and NOP.
fn registers(datagram: &Datagram<'_>) -> impl Iterator<Item = i128> {
    let addressing = datagram.command().map_or(Addressing::None, Command::addressing);
    let covered = match addressing {
        Addressing::None | Addressing::Logical => None,
        Addressing::Position | Addressing::Station | Addressing::Broadcast => {
            let first = i128::from(datagram.ado().0);
            let last = first + datagram.data_len().max(1) as i128 - 1;
            // Behind the last address there is none.
            Some(first..=last.min(u16::MAX.into()))
        }
    };
    covered.into_iter().flatten()
}

/// All values of a field.
pub(super) fn values(
    row: &CaptureRow<'_>,
    reference: FieldReference,
    devices: Option<&DeviceIndex>,
) -> Vec<i128> {
    let mut all = Vec::new();
    Look { row, only: None, devices }.values(reference, &mut |value| {
        all.push(value);
        true
    });
    all
}
