//! All controllers in their places, and a book of what the wire must know of them: when something
//! is due where, who answers to which name.
//!
//! Whoever changes a node wakes it by that ([`IndexMut`], [`Nodes::iter_mut`]); before the book is
//! asked, the entries of all that woke are made anew. So nobody who changes a controller needs to
//! think of the book, and nothing is done for those that rest.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::{Deref, Index, IndexMut};

use linesman_proto::time::Instant;

use super::directory::Directory;
use super::node::Node;
use crate::controller::{Controller, Manner};

/// All nodes of a segment, by their index in the tree.
#[derive(Debug)]
pub(crate) struct Nodes {
    all: Vec<Node>,
    /// Nodes whose entries are to be made anew.
    woken: Vec<u32>,
    /// When something is due at a node. A node may have several entries; that of its
    /// [`Entry::scheduled`] counts, which is never later than the truth.
    due: BinaryHeap<Reverse<(Instant, u32)>>,
    /// Who answers to what.
    pub(super) directory: Directory,
    /// Counts how often nodes woke that sample inputs.
    samplers_woken: u64,
}

/// What the book says of a node.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    awake: bool,
    scheduled: Instant,
    pub(super) manner: Manner,
    /// What the directory has of its FMMUs.
    pub(super) mapped: Vec<(u64, u64)>,
}

impl Default for Entry {
    fn default() -> Self {
        Self {
            awake: false,
            scheduled: Instant::MAX,
            manner: Manner::default(),
            mapped: Vec::new(),
        }
    }
}

impl Nodes {
    pub(super) fn new(controllers: Vec<Controller>) -> Self {
        let mut nodes = Self {
            all: controllers.into_iter().map(Node::new).collect(),
            woken: Vec::new(),
            due: BinaryHeap::new(),
            directory: Directory::default(),
            samplers_woken: 0,
        };
        nodes.wake_all();
        nodes
    }

    /// All nodes, to change.
    pub(crate) fn iter_mut(&mut self) -> std::slice::IterMut<'_, Node> {
        self.wake_all();
        self.all.iter_mut()
    }

    /// A node whose manner is not going to change: what becomes due is told by
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
        self.samplers_woken += u64::from(entry.manner.samples);
        if !entry.awake {
            entry.awake = true;
            self.woken.push(node as u32);
        }
    }

    /// A number that changes whenever something happens to a node that samples inputs.
    #[inline]
    pub(super) fn samplers_woken(&self) -> u64 {
        self.samplers_woken
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
            self.reschedule(index);
            let node = &mut self.all[index];
            node.entry.awake = false;
            let manner = node.manner();
            if manner != node.entry.manner {
                self.directory.change(index, node, manner);
            }
        }
    }

    /// What is due at a node may have come nearer.
    #[inline]
    pub(super) fn reschedule(&mut self, index: usize) {
        let node = &mut self.all[index];
        let next = node.next_event();
        // What was put off stays in the book as it is, and is looked up again when its time comes.
        if next < node.entry.scheduled {
            node.entry.scheduled = next;
            self.due.push(Reverse((next, index as u32)));
        }
    }

    /// Takes the nodes out at which something is due up to `until`, in no order; they wake. The
    /// book must be settled.
    fn take_due(&mut self, until: Instant, taken: &mut Vec<u32>) {
        while let Some(Reverse((at, index))) = self.due.peek().copied() {
            if at > until {
                return;
            }
            self.due.pop();
            let node = &mut self.all[index as usize];
            if node.entry.scheduled != at {
                continue;
            }
            node.entry.scheduled = Instant::MAX;
            if node.next_event() <= until {
                self.wake(index as usize);
                taken.push(index);
            } else {
                self.reschedule(index as usize);
            }
        }
    }

    /// The nodes at which something is due up to `until`, in no order: in `due`, which is empty.
    #[inline]
    pub(super) fn due_until(&mut self, until: Instant, due: &mut Vec<u32>) {
        self.settle();
        if self.due.peek().is_some_and(|Reverse((at, _))| *at <= until) {
            self.take_due(until, due);
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
    fn manner(&self) -> Manner {
        let manner = self.controller.manner();
        Manner { meddles: manner.meddles || !self.glitches.is_empty(), ..manner }
    }
}
