//! Where each box stands: columns and rows of a grid.
//!
//! A chain of SubDevices runs to the right; what else hangs on one of them begins a row of its own
//! below. So a coupler's terminals stand beside it, and the next coupler beneath it. Rows that are
//! too long go on in the next.

use linesman_proto::address::Path;
use linesman_proto::topology::Tree;

/// A row has so many boxes before it goes on in the next.
const ROW: usize = 10;
/// A branch that begins far to the right gets at least so many.
const SHORTEST_ROW: usize = 4;

/// A place on the grid.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Cell {
    pub(super) column: usize,
    pub(super) row: usize,
}

/// Places for all boxes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Layout {
    /// Where the cards of the MainDevice are; the second only where something hangs on it.
    pub(super) cards: [Cell; 2],
    /// By node; `None` for those that hang nowhere.
    pub(super) cells: Vec<Option<Cell>>,
    /// How many columns and rows there are.
    pub(super) size: Cell,
}

impl Layout {
    /// Places all boxes of a tree.
    pub(super) fn of(tree: &Tree) -> Self {
        let mut layout = Self {
            cards: [Cell { column: 0, row: 0 }; 2],
            cells: vec![None; tree.len()],
            size: Cell { column: 1, row: 1 },
        };
        let mut next_row = 0;
        for path in Path::ALL {
            layout.cards[path.index()] = Cell { column: 0, row: next_row };
            if let Some(first) = tree.first(path) {
                layout.branch(tree, first, &mut next_row);
            }
        }
        // What hangs nowhere is shown all the same.
        for node in tree.detached() {
            layout.put(node, Cell { column: 1, row: next_row });
            next_row += 1;
        }
        layout.size.row = layout.size.row.max(next_row);
        layout
    }

    /// Places `first` and all behind it.
    fn branch(&mut self, tree: &Tree, first: usize, next_row: &mut usize) {
        // A long line is deeper than the stack: what is still to be placed stands in a list.
        let mut waiting = vec![(first, 1)];
        while let Some((first, column)) = waiting.pop() {
            let chain: Vec<usize> = std::iter::successors(Some(first), |node| {
                tree.children(*node).next().map(|(_, child)| child)
            })
            .collect();
            let width = (ROW + 1).saturating_sub(column).max(SHORTEST_ROW);
            for (index, node) in chain.iter().enumerate() {
                let cell = Cell { column: column + index % width, row: *next_row + index / width };
                self.put(*node, cell);
                // Those further to the right are placed first, and so stand nearer: no line has to
                // go around them.
                let others: Vec<usize> =
                    tree.children(*node).skip(1).map(|(_, child)| child).collect();
                waiting.extend(others.into_iter().rev().map(|child| (child, cell.column)));
            }
            *next_row += chain.len().div_ceil(width);
        }
    }

    fn put(&mut self, node: usize, cell: Cell) {
        self.cells[node] = Some(cell);
        self.size.column = self.size.column.max(cell.column + 1);
        self.size.row = self.size.row.max(cell.row + 1);
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::port::Port;
    use linesman_proto::topology::{End, Wired};

    use super::*;

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

    #[test]
    fn terminals_stand_beside_their_coupler_and_the_next_coupler_beneath() {
        let tree = tree(&[
            (None, Port::A),
            (Some((0, Port::B)), Port::A),
            (Some((1, Port::B)), Port::A),
            (Some((0, Port::C)), Port::A),
            (Some((3, Port::B)), Port::A),
        ]);
        let cells: Vec<(usize, usize)> = Layout::of(&tree)
            .cells
            .into_iter()
            .flatten()
            .map(|cell| (cell.column, cell.row))
            .collect();
        assert_eq!(cells, [(1, 0), (2, 0), (3, 0), (1, 1), (2, 1)]);
    }

    #[test]
    fn no_two_boxes_stand_in_one_place_and_long_rows_go_on() {
        // A line of 300, and a comb whose every third has a branch.
        let line: Vec<_> = (0..300)
            .map(|node: usize| (node.checked_sub(1).map(|on| (on, Port::B)), Port::A))
            .collect();
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
        for wired in [line, comb] {
            let layout = Layout::of(&tree(&wired));
            let mut cells: Vec<(usize, usize)> =
                layout.cells.iter().flatten().map(|cell| (cell.column, cell.row)).collect();
            cells.sort_unstable();
            cells.dedup();
            assert_eq!(cells.len(), 300);
            assert!(layout.size.column <= ROW + 1, "{:?}", layout.size);
        }
    }
}
