//! Groups of SubDevices that share a datagram.

use linesman_proto::frame::MAX_DATAGRAM_DATA;
use linesman_proto::sii::Direction;

use super::super::{PlannedDevice, ProcessAccess};
use super::{Grouping, PlanError, PlanOptions, TaskOptions};

/// SubDevices that share datagrams.
#[derive(Debug, Default)]
pub(super) struct Group {
    /// Whose outputs.
    pub(super) outputs: Vec<usize>,
    /// Whose inputs.
    pub(super) inputs: Vec<usize>,
    /// One LRW for both.
    pub(super) lrw: bool,
    len: usize,
}

/// What a SubDevice takes part in.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum ExchangeKind {
    /// Outputs and inputs in one LRW, or in LWR and LRD side by side.
    Both {
        lrw: bool,
    },
    Outputs,
    Inputs,
}

/// The groups of a sync unit, in order.
pub(super) fn groups(
    members: &[usize],
    devices: &[PlannedDevice],
    task: &TaskOptions,
    options: &PlanOptions,
) -> Result<Vec<Group>, PlanError> {
    let separate = options.separate_directions || task.separate_inputs.is_some();
    let mut filling = Filling::default();
    for &member in members {
        let device = &devices[member];
        let outputs = device.profile.process_len(Direction::Outputs);
        let inputs = device.profile.process_len(Direction::Inputs);
        let len = outputs + inputs;
        if len > MAX_DATAGRAM_DATA {
            return Err(PlanError::TooMuchProcessData { name: device.name.clone(), len });
        }
        let lrw = !separate
            && match device.settings.access {
                ProcessAccess::Auto => !device.profile.no_lrw,
                ProcessAccess::ReadWrite => true,
                ProcessAccess::Separate => false,
            };
        match options.grouping {
            Grouping::Compact => filling.put(ExchangeKind::Both { lrw }, member, (outputs, inputs)),
            Grouping::ByKind if lrw && outputs > 0 && inputs > 0 => {
                filling.put(ExchangeKind::Both { lrw }, member, (outputs, inputs));
            }
            Grouping::ByKind => {
                filling.put(ExchangeKind::Outputs, member, (outputs, 0));
                filling.put(ExchangeKind::Inputs, member, (0, inputs));
            }
        }
    }
    Ok(filling.finish(options.grouping, task.separate_inputs.is_some()))
}

/// Groups as they are being filled; one of each kind is open.
#[derive(Default)]
struct Filling {
    groups: Vec<(ExchangeKind, Group)>,
}

impl Filling {
    fn put(&mut self, kind: ExchangeKind, member: usize, (outputs, inputs): (usize, usize)) {
        let len = outputs + inputs;
        if len == 0 {
            return;
        }
        let open = self.groups.iter().rposition(|(known, _)| *known == kind);
        let open = open.filter(|at| self.groups[*at].1.len + len <= MAX_DATAGRAM_DATA);
        let at = open.unwrap_or(self.groups.len());
        if open.is_none() {
            let lrw = kind == ExchangeKind::Both { lrw: true };
            self.groups.push((kind, Group { lrw, ..Group::default() }));
        }
        let group = &mut self.groups[at].1;
        group.len += len;
        if outputs > 0 {
            group.outputs.push(member);
        }
        if inputs > 0 {
            group.inputs.push(member);
        }
    }

    /// By kind: LRW first, then LWR, then LRD; inputs that are fetched earlier come first.
    fn finish(mut self, grouping: Grouping, inputs_first: bool) -> Vec<Group> {
        if grouping == Grouping::ByKind {
            self.groups.sort_by_key(|(kind, _)| match kind {
                ExchangeKind::Both { .. } => 1,
                ExchangeKind::Outputs => 2,
                ExchangeKind::Inputs if inputs_first => 0,
                ExchangeKind::Inputs => 3,
            });
        }
        self.groups.into_iter().map(|(_, group)| group).collect()
    }
}
