//! Controllers in a row.

use super::Tree;

impl Tree {
    /// The controllers in a row with `node`, nearest to the card first and without itself, as far as each of
    /// them is `alike`: one hangs on the other, and nothing else hangs on any but the last.
    pub fn in_a_row(&self, node: usize, alike: impl Fn(usize) -> bool) -> Vec<usize> {
        let above = std::iter::successors(self.parent(node), |above| self.parent(*above));
        let above = above.take_while(|above| self.only_child(*above).is_some() && alike(*above));
        let mut row: Vec<usize> = above.collect();
        row.reverse();
        let below = std::iter::successors(self.only_child(node), |below| self.only_child(*below));
        row.extend(below.take_while(|below| alike(*below)));
        row
    }

    fn only_child(&self, node: usize) -> Option<usize> {
        let mut children = self.children(node).map(|(_, child)| child);
        children.next().filter(|_| children.next().is_none())
    }
}

#[cfg(test)]
mod tests {
    use crate::address::Path;
    use crate::port::Port::{A, B, C};
    use crate::topology::{End, Tree, Wired};

    #[test]
    fn a_row_ends_where_a_branch_or_another_one_stands() {
        let on = |node, port| Wired { on: End::Controller(node, port), entry: A };
        let first = Wired { on: End::MainDevice(Path::A), entry: A };
        // 0 has two branches: 1, 2, 3, 4 and 5.
        let wiring = [first, on(0, B), on(1, B), on(2, B), on(3, B), on(0, C)];
        let tree = Tree::from_wiring(&wiring, None).unwrap();
        assert_eq!(tree.in_a_row(2, |_| true), [1, 3, 4]);
        assert_eq!(tree.in_a_row(2, |other| other != 3), [1]);
        assert_eq!(tree.in_a_row(4, |other| other != 2), [3]);
        assert_eq!(tree.in_a_row(5, |_| true), [0; 0]);
    }
}
