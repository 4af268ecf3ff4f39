//! All controllers in their places, with the data that the fast path needs of them: due times,
//! addresses, routes.
//!
//! Whoever changes a node wakes it by that ([`IndexMut`], [`Nodes::iter_mut`]); before the book is
//! asked, the entries of all that woke are made anew. So nobody who changes a controller needs to
//! think of the book, and nothing is done for those that rest.

use std::ops::{Deref, Index, IndexMut};

use linesman_proto::address::Path;
use linesman_proto::port::Port;
use linesman_proto::time::{Instant, Span};

use super::address_directory::AddressDirectory;
use super::fast_path::FastFrame;
use super::node::Node;
use super::timer_queue::TimerQueue;
use crate::controller::{Controller, FastPathInfo};
use crate::device::SignalId;

/// All nodes of a segment, by their index in the tree.
#[derive(Debug)]
pub(crate) struct Nodes {
    all: Vec<Node>,
    /// Nodes whose entries are to be made anew.
    woken: Vec<u32>,
    /// When something is due at a node.
    due: TimerQueue,
    /// When something is due that can lead frames another way.
    ways: TimerQueue,
    /// By card: the frames that find something to do at a node.
    departures: [Option<DepartureTimers>; 2],
    /// Who answers to what.
    pub(super) address_directory: AddressDirectory,
    /// Signals on which what a device samples depends, and its node; sorted.
    listeners: Vec<(SignalId, u32)>,
}

/// For each node on the way of a frame: if it leaves its card at this instant or later, something is
/// to be done at the node as it comes by. On a long line that is long after it has left.
#[derive(Debug)]
struct DepartureTimers {
    timer_queue: TimerQueue,
    /// From the card to the node, for those on the way.
    after: Vec<Option<Span>>,
}

/// What the book says of a node.
#[derive(Clone, Default, Debug)]
pub(super) struct Entry {
    awake: bool,
    pub(super) fast_path_info: FastPathInfo,
    /// What the directory has of its FMMUs.
    pub(super) mapped: Vec<(u64, u64)>,
}

impl Nodes {
    pub(super) fn new(controllers: Vec<Controller>) -> Self {
        let count = controllers.len();
        let mut listeners = Vec::new();
        for (index, controller) in controllers.iter().enumerate() {
            let heard = controller.firmware().listens_to();
            listeners.extend(heard.into_iter().map(|signal| (signal, index as u32)));
        }
        listeners.sort_unstable();
        let mut nodes = Self {
            all: controllers.into_iter().map(Node::new).collect(),
            woken: Vec::new(),
            due: TimerQueue::new(count),
            ways: TimerQueue::new(count),
            departures: [None, None],
            address_directory: AddressDirectory::default(),
            listeners,
        };
        nodes.wake_all();
        nodes
    }

    /// All nodes, to change.
    pub(crate) fn iter_mut(&mut self) -> std::slice::IterMut<'_, Node> {
        self.wake_all();
        self.all.iter_mut()
    }

    /// A node whose fast-path information is not going to change: what becomes due is told by
    /// [`Nodes::reschedule`].
    #[inline]
    pub(super) fn quietly(&mut self, node: usize) -> &mut Node {
        &mut self.all[node]
    }

    fn wake_all(&mut self) {
        for node in 0..self.all.len() {
            self.wake(node);
        }
    }

    #[inline]
    pub(super) fn wake(&mut self, node: usize) {
        let entry = &mut self.all[node].entry;
        if !entry.awake {
            entry.awake = true;
            self.woken.push(node as u32);
        }
    }

    /// Makes the entries of all that woke anew.
    #[inline]
    pub(super) fn settle(&mut self) {
        if !self.woken.is_empty() {
            self.settle_woken();
        }
    }

    fn settle_woken(&mut self) {
        while let Some(index) = self.woken.pop() {
            let index = index as usize;
            let node = &mut self.all[index];
            node.entry.awake = false;
            let fast_path_info = node.fast_path_info();
            if fast_path_info != node.entry.fast_path_info {
                self.address_directory.change(index, node, fast_path_info);
            }
            self.reschedule(index);
        }
    }

    /// What is due at a node may have come nearer. What was put off stays in the book as it is, and
    /// is looked up again when its time comes.
    #[inline]
    pub(super) fn reschedule(&mut self, index: usize) {
        let node = &self.all[index];
        let next = node.next_event();
        let turn = next.min(node.next_sample());
        if next != Instant::MAX {
            self.due.bring_forward(index as u32, next);
            self.ways.bring_forward(index as u32, node.next_way_event());
        }
        for departures in self.departures.iter_mut().flatten() {
            departures.bring_forward(index as u32, turn);
        }
    }

    /// Whether anything may be due up to `until`.
    #[inline]
    pub(super) fn may_be_due(&self, until: Instant) -> bool {
        !self.woken.is_empty() || self.due.first_until(until).is_some()
    }

    /// Takes the nodes out at which something is due up to `until`, in no order; they wake.
    #[inline]
    pub(super) fn due_until(&mut self, until: Instant, taken: &mut Vec<u32>) {
        self.settle();
        while let Some(index) = self.due.first_until(until) {
            let next = self.all[index as usize].next_event();
            if next <= until {
                self.due.put_off(index, Instant::MAX);
                self.wake(index as usize);
                taken.push(index);
            } else {
                self.due.put_off(index, next);
            }
        }
    }

    /// Whether anything happens up to `until` that can lead frames another way.
    #[inline]
    pub(super) fn ways_change_until(&mut self, until: Instant) -> bool {
        while let Some(index) = self.ways.first_until(until) {
            let next = self.all[index as usize].next_way_event();
            if next <= until {
                return true;
            }
            self.ways.put_off(index, next);
        }
        false
    }

    // ---- what frames meet ----

    /// A way was found for the frames of a card: it passes these nodes so long after leaving.
    pub(super) fn plan_departures(&mut self, card: Path, way: impl Iterator<Item = (u32, Span)>) {
        let mut after = vec![None; self.all.len()];
        for (node, span) in way {
            after[node as usize] = Some(span);
        }
        let mut departures =
            DepartureTimers { timer_queue: TimerQueue::new(self.all.len()), after };
        for (index, node) in self.all.iter().enumerate() {
            departures.bring_forward(index as u32, node.next_event().min(node.next_sample()));
        }
        self.departures[card.index()] = Some(departures);
    }

    /// No way is known any more.
    pub(super) fn forget_departures(&mut self) {
        self.departures = [None, None];
    }

    /// Whether a frame that leaves a card at `at` may find something to do on its way.
    #[inline]
    pub(super) fn may_meet(&self, card: Path, at: Instant) -> bool {
        let departures = self.departures[card.index()].as_ref();
        departures.is_some_and(|routes| routes.timer_queue.first_until(at).is_some())
    }

    /// Takes the nodes out at which something is to be done when a frame comes by that leaves a card
    /// at `at`, in no order. The book must be settled.
    pub(super) fn met_by(&mut self, card: Path, at: Instant, taken: &mut Vec<u32>) {
        let Some(departures) = &mut self.departures[card.index()] else { return };
        while let Some(index) = departures.timer_queue.first_until(at) {
            let node = &self.all[index as usize];
            let turn = node.next_event().min(node.next_sample());
            let leaves = departures.leaves(index, turn);
            if leaves > at {
                departures.timer_queue.put_off(index, leaves);
                continue;
            }
            departures.timer_queue.put_off(index, Instant::MAX);
            taken.push(index);
        }
    }

    /// Controllers learn when a frame that did not walk came in at ports, so long after it left.
    pub(super) fn note_entries(
        &mut self,
        entries: impl Iterator<Item = (u32, Port, Span)>,
        frame: FastFrame,
    ) {
        for (node, port, after) in entries {
            let controller = &mut self.all[node as usize].controller;
            controller.note_entry(port, frame.number, frame.at + after, frame.duration);
        }
    }

    /// Which of the listeners are those of devices that sample a signal.
    pub(super) fn listeners(&self, signal: SignalId) -> std::ops::Range<usize> {
        let first = self.listeners.partition_point(|(other, _)| *other < signal);
        let len = self.listeners[first..].iter().take_while(|(other, _)| *other == signal).count();
        first..first + len
    }

    /// The node of a listener.
    pub(super) fn listener(&self, at: usize) -> u32 {
        self.listeners[at].1
    }
}

impl DepartureTimers {
    /// The first departure whose frame is at a node at `turn` or later.
    #[inline]
    fn leaves(&self, index: u32, turn: Instant) -> Instant {
        match self.after[index as usize] {
            Some(after) if turn != Instant::MAX => turn.before(after),
            Some(_) | None => Instant::MAX,
        }
    }

    #[inline]
    fn bring_forward(&mut self, index: u32, turn: Instant) {
        let leaves = self.leaves(index, turn);
        if leaves != Instant::MAX {
            self.timer_queue.bring_forward(index, leaves);
        }
    }
}

impl Deref for Nodes {
    type Target = [Node];

    fn deref(&self) -> &[Node] {
        &self.all
    }
}

impl Index<usize> for Nodes {
    type Output = Node;

    #[inline]
    fn index(&self, node: usize) -> &Node {
        &self.all[node]
    }
}

impl IndexMut<usize> for Nodes {
    #[inline]
    fn index_mut(&mut self, node: usize) -> &mut Node {
        self.wake(node);
        &mut self.all[node]
    }
}

impl Node {
    /// What the wire must know of it.
    fn fast_path_info(&self) -> FastPathInfo {
        let fast_path_info = self.controller.fast_path_info();
        FastPathInfo {
            acts_on_all_frames: fast_path_info.acts_on_all_frames || !self.glitches.is_empty(),
            ..fast_path_info
        }
    }

    /// From when on a frame that comes by samples something new.
    #[inline]
    pub(super) fn next_sample(&self) -> Instant {
        if self.entry.fast_path_info.samples {
            self.controller.wants_sample()
        } else {
            Instant::MAX
        }
    }
}
