//! Grid of a drawing: the cell of each box, and the course of each link between them.
//!
//! A chain of SubDevices runs to the right and goes on in the next row where the paper ends. What else
//! hangs on one of them begins a row of its own below. Three rules keep wires short and apart:
//!
//! - the column below a box with a branch stays free for the wire of the branch: the rows that follow
//!   begin to the right of it;
//! - branches further to the right are placed first, so no wire crosses another branch;
//! - where too few columns would be left, the branch begins at the left edge behind a *reference*, a
//!   small copy of the box that it hangs on.

use linesman_proto::address::Path;
use linesman_proto::topology::{End, Tree};

/// Fewest columns for a branch below its box, and for the rows in which a chain goes on beside the wire
/// of a branch.
const LEAST_FOR_BRANCH: usize = 3;
const LEAST_TO_GO_ON: usize = 4;

/// A cell of the grid.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Cell {
    pub(super) column: usize,
    pub(super) row: usize,
}

/// A box of the drawing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Item {
    /// A card of the MainDevice.
    Card(Path),
    /// A SubDevice, by node of the tree.
    Node(usize),
}

/// The course of the link to a box from what it hangs on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Course {
    /// To the right, to the next cell.
    Beside,
    /// Around the end of a row to the begin of the next.
    Around,
    /// Straight down, to a cell of the same column.
    Down,
    /// Down, then to the right, to a cell of the next column.
    Aside,
    /// To the right, from a reference.
    Referred(Cell),
}

/// A box with its place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Placed {
    pub(super) cell: Cell,
    /// `None` for a box that hangs on nothing.
    pub(super) course: Option<Course>,
}

/// Places of all boxes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Layout {
    /// The cards of the MainDevice; the second only where something hangs on it.
    cards: [Option<Placed>; 2],
    /// By node.
    nodes: Vec<Option<Placed>>,
    /// Columns and rows.
    pub(super) size: Cell,
    columns: usize,
}

/// A chain that is still to be placed.
struct Branch {
    first: Item,
    column: usize,
    course: Option<Course>,
}

impl Layout {
    /// The layout of a tree on paper of so many columns.
    pub(super) fn of(tree: &Tree, columns: usize) -> Self {
        let mut layout = Self {
            cards: [None; 2],
            nodes: vec![None; tree.len()],
            size: Cell { column: 1, row: 0 },
            columns: columns.max(2),
        };
        // A list instead of recursion: a long line of couplers is deeper than the stack.
        let root = |path| Branch { first: Item::Card(path), column: 0, course: None };
        let mut waiting: Vec<Branch> = Vec::new();
        if tree.first(Path::B).is_some() {
            waiting.push(root(Path::B));
        }
        waiting.push(root(Path::A));
        let mut referred = Vec::new();
        while let Some(branch) = waiting.pop() {
            layout.branch(tree, &branch, &mut waiting, &mut referred);
            if waiting.is_empty() && !referred.is_empty() {
                waiting.extend(referred.drain(..).rev());
            }
        }
        let begin = layout.size.row;
        for (index, node) in tree.detached().enumerate() {
            let (column, row) = (index % layout.columns, begin + index / layout.columns);
            layout.put(Item::Node(node), Cell { column, row }, None);
        }
        layout
    }

    /// The place of a box.
    pub(super) fn placed(&self, item: Item) -> Option<Placed> {
        match item {
            Item::Card(path) => self.cards[path.index()],
            Item::Node(node) => self.nodes.get(node).copied().flatten(),
        }
    }

    /// Places a chain. Its branches are put on the list `waiting`, the last to be placed first; those
    /// without room on the list `referred`.
    fn branch(
        &mut self,
        tree: &Tree,
        branch: &Branch,
        waiting: &mut Vec<Branch>,
        referred: &mut Vec<Branch>,
    ) {
        let next = |item: &Item| below(tree, *item).first().copied();
        let chain: Vec<Item> = std::iter::successors(Some(branch.first), next).collect();
        let (mut row, mut column, mut begin) = (self.size.row, branch.column, branch.column);
        let mut course = branch.course;
        if let Some(Course::Referred(_)) = course {
            course = Some(Course::Referred(Cell { column: 0, row }));
            (column, begin) = (1, 0);
        }
        for (index, item) in chain.iter().enumerate() {
            if column == self.columns {
                (row, column) = (row + 1, begin);
                course = Some(Course::Around);
            }
            self.put(*item, Cell { column, row }, course);
            course = Some(Course::Beside);
            let others: Vec<Item> = below(tree, *item).into_iter().skip(1).collect();
            let goes_on = chain.len() - index > self.columns - column;
            if others.is_empty() {
                // Nothing to keep free.
            } else if self.has_room(column, others.len(), goes_on) {
                begin = column + 1;
                for (nth, first) in others.iter().enumerate().rev() {
                    let is_last = nth + 1 == others.len();
                    let (column, course) =
                        if is_last { (column, Course::Down) } else { (column + 1, Course::Aside) };
                    waiting.push(Branch { first: *first, column, course: Some(course) });
                }
            } else {
                let nowhere = Course::Referred(Cell { column: 0, row: 0 });
                referred.extend(others.iter().map(|first| Branch {
                    first: *first,
                    column: 0,
                    course: Some(nowhere),
                }));
            }
            column += 1;
        }
    }

    /// Whether so many branches find room below a box, and the chain beside them if it goes on.
    fn has_room(&self, column: usize, branches: usize, goes_on: bool) -> bool {
        let right = self.columns - column - 1;
        let least = LEAST_FOR_BRANCH.min(self.columns);
        let has_branches = right + 1 >= least && (branches < 2 || right >= least);
        has_branches && branches <= 2 && (!goes_on || right >= LEAST_TO_GO_ON)
    }

    fn put(&mut self, item: Item, cell: Cell, course: Option<Course>) {
        let placed = Some(Placed { cell, course });
        match item {
            Item::Card(path) => self.cards[path.index()] = placed,
            Item::Node(node) => self.nodes[node] = placed,
        }
        self.size.column = self.size.column.max(cell.column + 1);
        self.size.row = self.size.row.max(cell.row + 1);
    }
}

/// The boxes that hang on a box, in the order in which a frame gets there. The card that closes a ring
/// hangs on the last SubDevice.
pub(super) fn below(tree: &Tree, item: Item) -> Vec<Item> {
    match item {
        Item::Card(path) => tree.first(path).map(Item::Node).into_iter().collect(),
        Item::Node(node) => {
            let closing = tree.closes_at().filter(|(at, _)| *at == node);
            let children = tree.children(node).map(|(_, child)| Item::Node(child));
            children.chain(closing.map(|_| Item::Card(Path::B))).collect()
        }
    }
}

/// The box at an end of a link.
pub(super) const fn item_at(end: End) -> Item {
    match end {
        End::MainDevice(path) => Item::Card(path),
        End::Controller(node, _) => Item::Node(node),
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::port::Port;
    use linesman_proto::topology::Wired;

    use super::*;

    fn tree(wired: &[(Option<(usize, Port)>, Port)], closes_at: Option<(usize, Port)>) -> Tree {
        let wired: Vec<Wired> = wired
            .iter()
            .map(|(on, entry)| Wired {
                on: on.map_or(End::MainDevice(Path::A), |(node, port)| End::Controller(node, port)),
                entry: *entry,
            })
            .collect();
        Tree::from_wiring(&wired, closes_at).unwrap()
    }

    fn chain(len: usize) -> Vec<(Option<(usize, Port)>, Port)> {
        (0..len).map(|node| (node.checked_sub(1).map(|on| (on, Port::B)), Port::A)).collect()
    }

    fn places(layout: &Layout) -> Vec<(usize, usize)> {
        layout.nodes.iter().flatten().map(|one| (one.cell.column, one.cell.row)).collect()
    }

    #[test]
    fn terminals_stand_beside_their_coupler_and_the_next_coupler_beneath() {
        let couplers = [
            (None, Port::A),
            (Some((0, Port::B)), Port::A),
            (Some((1, Port::B)), Port::A),
            (Some((0, Port::C)), Port::A),
            (Some((3, Port::B)), Port::A),
        ];
        let layout = Layout::of(&tree(&couplers, None), 7);
        assert_eq!(places(&layout), [(1, 0), (2, 0), (3, 0), (1, 1), (2, 1)]);
        assert_eq!(layout.placed(Item::Node(3)).unwrap().course, Some(Course::Down));
        // No room for a branch below: it begins at the left, behind a reference.
        let narrow = Layout::of(&tree(&couplers, None), 2);
        assert_eq!(places(&narrow), [(1, 0), (0, 1), (1, 1), (1, 2), (0, 3)]);
        let reference = Course::Referred(Cell { column: 0, row: 2 });
        assert_eq!(narrow.placed(Item::Node(3)).unwrap().course, Some(reference));
    }

    #[test]
    fn rows_go_on_to_the_right_of_the_wire_of_a_branch() {
        let mut wired = chain(12);
        wired.push((Some((0, Port::C)), Port::A));
        let layout = Layout::of(&tree(&wired, None), 7);
        assert_eq!(places(&layout)[6..], [(2, 1), (3, 1), (4, 1), (5, 1), (6, 1), (2, 2), (1, 3)]);
        assert_eq!(layout.placed(Item::Node(6)).unwrap().course, Some(Course::Around));
    }

    #[test]
    fn card_that_closes_a_ring_stands_behind_the_last() {
        let layout = Layout::of(&tree(&chain(4), Some((3, Port::B))), 7);
        let card = layout.placed(Item::Card(Path::B)).unwrap();
        assert_eq!(card.cell, Cell { column: 5, row: 0 });
        assert_eq!(card.course, Some(Course::Beside));
        let open = Layout::of(&tree(&chain(4), None), 7);
        assert_eq!(open.placed(Item::Card(Path::B)), None);
    }

    #[test]
    fn no_two_boxes_stand_in_one_place_and_long_rows_go_on() {
        // A line of 300, a comb whose every third has a branch, and couplers that are deep.
        let comb: Vec<_> = (0..300)
            .map(|node: usize| {
                let on = match node {
                    0 => None,
                    _ if node.is_multiple_of(3) => Some((node - 3, Port::C)),
                    _ => Some((node - 1, Port::B)),
                };
                (on, Port::A)
            })
            .collect();
        let teeth: Vec<_> = (0..300)
            .map(|node: usize| {
                let on = match node {
                    0 => None,
                    _ if node % 3 == 2 => Some((node - 1, Port::C)),
                    _ if node.is_multiple_of(3) => Some((node - 2, Port::B)),
                    _ => Some((node - 1, Port::B)),
                };
                (on, Port::A)
            })
            .collect();
        for wired in [chain(300), comb, teeth] {
            for columns in [2, 7] {
                let layout = Layout::of(&tree(&wired, None), columns);
                let mut cells = places(&layout);
                cells.sort_unstable();
                cells.dedup();
                assert_eq!(cells.len(), 300);
                assert!(layout.size.column <= columns, "{:?}", layout.size);
                assert!(layout.size.row <= 300, "{:?}", layout.size);
            }
        }
    }
}
