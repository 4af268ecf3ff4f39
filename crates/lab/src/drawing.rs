//! A line as text: one row for each SubDevice, branches indented, for terminals and reports.
//!
//! ```text
//! MainDevice
//! A─  1 K1  EK1100
//!     ├─B─  2 T1  EL1008
//!     │ B─  3 T2  EL2008
//! C─  4 K2  EK1100
//! ```
//! The letter in front of a row is the port that the device hangs on: of the row above for the
//! first of a branch, else of the device before it on the same level.

use linesman_proto::address::{DeviceId, Path};
use linesman_proto::topology::{End, Tree};

/// A row of the drawing.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Row {
    /// What is printed.
    pub text: String,
    /// Whose row it is; `None` for the MainDevice.
    pub device: Option<DeviceId>,
}

/// What is written about a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Label {
    /// Its name.
    pub name: String,
    /// Its type.
    pub type_name: String,
}

/// Draws `tree`; `labels[n]` belongs to node *n*, missing ones stay blank.
#[must_use]
pub fn draw(tree: &Tree, labels: &[Label]) -> Vec<Row> {
    let width = labels.iter().map(|label| label.name.chars().count()).max().unwrap_or(0);
    let mut pen = Pen { tree, labels, width, rows: Vec::with_capacity(tree.len() + 2) };
    for card in Path::ALL {
        if let Some(first) = tree.first(card) {
            let name = match card {
                Path::A => "MainDevice".to_owned(),
                Path::B => "MainDevice, second card".to_owned(),
            };
            pen.rows.push(Row { text: name, device: None });
            pen.chain(first, "", "");
        }
    }
    if let Some((node, port)) = tree.closes_at() {
        let name = match pen.name(node) {
            "" => format!("SubDevice {}", node + 1),
            name => name.to_owned(),
        };
        let text = format!("ring closed: {name}.{port} to the second card");
        pen.rows.push(Row { text, device: None });
    }
    pen.rows
}

struct Pen<'a> {
    tree: &'a Tree,
    labels: &'a [Label],
    width: usize,
    rows: Vec<Row>,
}

impl Pen<'_> {
    fn name(&self, node: usize) -> &str {
        self.labels.get(node).map_or("", |label| label.name.as_str())
    }

    /// Draws `first` and all that hangs on it. The last child continues the level of its parent,
    /// the others are branches of their own; `head` stands before the first row, `rest` before the
    /// later ones.
    fn chain(&mut self, first: usize, head: &str, rest: &str) {
        let mut node = first;
        let mut lead = head.to_owned();
        loop {
            self.row(node, &lead);
            lead = rest.to_owned();
            let children: Vec<usize> = self.tree.children(node).map(|(_, child)| child).collect();
            let Some((last, branches)) = children.split_last() else { return };
            for branch in branches {
                self.chain(*branch, &format!("{rest}    ├─"), &format!("{rest}    │ "));
            }
            node = *last;
        }
    }

    fn row(&mut self, node: usize, lead: &str) {
        let via = match self.tree.upstream(node) {
            Some(End::Controller(_, port)) => port.letter(),
            Some(End::MainDevice(Path::A)) => 'A',
            Some(End::MainDevice(Path::B)) => 'B',
            None => '?',
        };
        let entry = if self.tree.is_reversed(node) {
            format!("  (entered by port {})", self.tree.entry(node))
        } else {
            String::new()
        };
        let type_name = self.labels.get(node).map_or("", |label| label.type_name.as_str());
        let (name, width) = (self.name(node), self.width);
        let id = DeviceId(node as u32);
        let text = format!("{lead}{via}─{:>3} {name:width$}  {type_name}{entry}", id.no());
        self.rows.push(Row { text: text.trim_end().to_owned(), device: Some(id) });
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::port::Port;
    use linesman_proto::topology::Wired;

    use super::*;

    #[test]
    fn branches_are_indented_and_the_last_child_goes_on() {
        let on = |node, port| Wired { on: End::Controller(node, port), entry: Port::A };
        let wired = [
            Wired { on: End::MainDevice(Path::A), entry: Port::A },
            on(0, Port::B),
            on(1, Port::B),
            on(0, Port::C),
            Wired { on: End::Controller(3, Port::B), entry: Port::C },
        ];
        let tree = Tree::from_wiring(&wired, None).unwrap();
        let names = ["K1", "T1", "T2", "Box12", "K2"];
        let labels = names.map(|name| Label { name: name.to_owned(), type_name: "EX".to_owned() });
        let text: Vec<String> = draw(&tree, &labels).into_iter().map(|row| row.text).collect();
        assert_eq!(
            text,
            [
                "MainDevice",
                "A─  1 K1     EX",
                "    ├─B─  2 T1     EX",
                "    │ B─  3 T2     EX",
                "C─  4 Box12  EX",
                "B─  5 K2     EX  (entered by port C)",
            ]
        );
    }

    #[test]
    fn a_ring_says_where_it_closes() {
        let wired = [Wired { on: End::MainDevice(Path::A), entry: Port::A }];
        let tree = Tree::from_wiring(&wired, Some((0, Port::B))).unwrap();
        let label = Label { name: "B1".to_owned(), type_name: "EP1008".to_owned() };
        let rows = draw(&tree, &[label]);
        assert_eq!(rows.last().unwrap().text, "ring closed: B1.B to the second card");
        let rows = draw(&tree, &[]);
        assert_eq!(rows.last().unwrap().text, "ring closed: SubDevice 1.B to the second card");
    }
}
