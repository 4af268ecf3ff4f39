//! Scene of a drawing: the boxes, links and marks.

use linesman_diagnosis::report::{DirectionReport, PlaceReport, Severity};
use linesman_proto::port::Port;
use linesman_proto::state::AlState;
use linesman_proto::topology::{End, Tree};

/// A line with everything that is told about it.
#[derive(Clone, Debug)]
pub(crate) struct Scene<'a> {
    /// How it is wired.
    pub(crate) tree: &'a Tree,
    /// What stands in the boxes, by node.
    pub(crate) boxes: Vec<Label>,
    /// Where something is wrong.
    pub(crate) marks: Vec<Mark>,
}

/// What stands in a box.
#[derive(Clone, Default, Debug)]
pub(crate) struct Label {
    /// What people call the SubDevice; may be empty.
    pub(crate) name: String,
    /// Its order designation; may be empty.
    pub(crate) type_name: String,
    /// Its state; `None` when nobody saw it.
    pub(crate) state: Option<State>,
    /// It was planned, and is not there.
    pub(crate) is_missing: bool,
    /// What its error counters rose by, by port; those that did not rise are left out.
    pub(crate) rises: Vec<(Port, u64)>,
}

/// The state of a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct State {
    /// Which.
    pub(crate) state: Option<AlState>,
    /// As it is written: `OP`, `PREOP 0x001E`.
    pub(crate) text: String,
    /// It reports an error.
    pub(crate) error: bool,
}

/// Something is wrong here.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Mark {
    /// The finding: `F1`.
    pub(crate) id: String,
    /// How bad.
    pub(crate) severity: Severity,
    /// Where.
    pub(crate) place: PlaceReport,
    /// Shown where the mouse rests on it.
    pub(crate) title: String,
}

impl Scene<'_> {
    /// The marks on the link at this end.
    pub(super) fn on_link(&self, ends: (End, End)) -> impl Iterator<Item = &Mark> {
        let is_end = move |end: linesman_diagnosis::report::EndReport| {
            named(ends.0) == (end.no, end.port) || named(ends.1) == (end.no, end.port)
        };
        self.marks.iter().filter(move |mark| match &mark.place {
            PlaceReport::Link { a, b, .. } => is_end(*a) && b.is_none_or(is_end),
            PlaceReport::Device { .. } | PlaceReport::Network { .. } | PlaceReport::Host => false,
        })
    }

    /// The marks on a SubDevice, and those of links whose far end was never seen.
    pub(super) fn on_device(&self, node: usize) -> impl Iterator<Item = &Mark> {
        let number = node as u32 + 1;
        self.marks.iter().filter(move |mark| match &mark.place {
            PlaceReport::Device { no, .. } => *no == number,
            PlaceReport::Link { a, b: None, .. } => {
                let end = Port::ALL.into_iter().find(|port| port.letter() == a.port);
                let wired = end.and_then(|port| self.tree.opposite(End::Controller(node, port)));
                a.no == number && wired.is_none()
            }
            PlaceReport::Link { .. } | PlaceReport::Network { .. } | PlaceReport::Host => false,
        })
    }

    /// The marks on the MainDevice: its computer, or the network as a whole.
    pub(super) fn on_main_device(&self) -> impl Iterator<Item = &Mark> {
        let is_here =
            |mark: &&Mark| matches!(mark.place, PlaceReport::Host | PlaceReport::Network { .. });
        self.marks.iter().filter(is_here)
    }
}

/// The direction in which a link is in trouble, with the end it begins at: away from `a`, or to it.
pub(super) fn direction(mark: &Mark) -> Option<DirectionReport> {
    match mark.place {
        PlaceReport::Link { direction, .. } => direction,
        PlaceReport::Device { .. } | PlaceReport::Network { .. } | PlaceReport::Host => None,
    }
}

/// An end of a link as reports name it.
fn named(end: End) -> (u32, char) {
    match end {
        End::MainDevice(path) => (0, if path.index() == 0 { 'A' } else { 'B' }),
        End::Controller(node, port) => (node as u32 + 1, port.letter()),
    }
}
