//! The four ports of a controller and the order in which a frame meets them.
//!
//! Reference: S1 chapter 3; the order 0 → 3 → 1 → 2 → 0 stands here and nowhere else.

use std::fmt;
use std::ops::{Index, IndexMut};

/// A port of a controller: 0..3 in the data sheet, A..D for people.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Port {
    /// Port 0, the IN port: the processing unit sits behind it.
    A,
    /// Port 1.
    B,
    /// Port 2.
    C,
    /// Port 3.
    D,
}

impl Port {
    /// All four in the order of their numbers, which is the order of registers.
    pub const ALL: [Self; 4] = [Self::A, Self::B, Self::C, Self::D];
    /// All four in the order in which a frame passes them: 0, 3, 1, 2.
    pub const FRAME_ORDER: [Self; 4] = [Self::A, Self::D, Self::B, Self::C];

    /// 0..=3.
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::A => 0,
            Self::B => 1,
            Self::C => 2,
            Self::D => 3,
        }
    }

    /// The port with this number, if it is 0..=3.
    #[must_use]
    pub const fn from_index(index: usize) -> Option<Self> {
        match index {
            0 => Some(Self::A),
            1 => Some(Self::B),
            2 => Some(Self::C),
            3 => Some(Self::D),
            _ => None,
        }
    }

    /// The port that a frame is handed to after this one: 0 → 3 → 1 → 2 → 0.
    #[must_use]
    pub const fn next(self) -> Self {
        match self {
            Self::A => Self::D,
            Self::D => Self::B,
            Self::B => Self::C,
            Self::C => Self::A,
        }
    }

    /// `A`..`D`.
    #[must_use]
    pub const fn letter(self) -> char {
        match self {
            Self::A => 'A',
            Self::B => 'B',
            Self::C => 'C',
            Self::D => 'D',
        }
    }

    /// The port that a person wrote, by letter in either case.
    #[must_use]
    pub const fn from_letter(letter: char) -> Option<Self> {
        match letter {
            'A' | 'a' => Some(Self::A),
            'B' | 'b' => Some(Self::B),
            'C' | 'c' => Some(Self::C),
            'D' | 'd' => Some(Self::D),
            _ => None,
        }
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.letter())
    }
}

/// One value for each port, indexed by [`Port`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct PortMap<T>(pub [T; 4]);

impl<T> PortMap<T> {
    /// A map whose values come from `value`.
    pub fn from_fn(mut value: impl FnMut(Port) -> T) -> Self {
        Self(Port::ALL.map(&mut value))
    }

    /// Port and value, in the order of port numbers.
    pub fn iter(&self) -> impl Iterator<Item = (Port, &T)> {
        Port::ALL.into_iter().zip(&self.0)
    }
}

impl<T> Index<Port> for PortMap<T> {
    type Output = T;
    fn index(&self, port: Port) -> &T {
        &self.0[port.index()]
    }
}

impl<T> IndexMut<Port> for PortMap<T> {
    fn index_mut(&mut self, port: Port) -> &mut T {
        &mut self.0[port.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: ESC-02 partial, ESC-09, HW-07 partial
    #[test]
    fn a_frame_meets_the_ports_in_the_order_0_3_1_2() {
        let mut port = Port::A;
        let seen: Vec<usize> = std::iter::from_fn(|| {
            let now = port;
            port = port.next();
            Some(now.index())
        })
        .take(5)
        .collect();
        assert_eq!(seen, [0, 3, 1, 2, 0]);
        assert_eq!(Port::FRAME_ORDER.map(Port::index), [0, 3, 1, 2]);
    }

    #[test]
    fn letters_and_numbers_are_the_same_ports() {
        for port in Port::ALL {
            assert_eq!(Port::from_letter(port.letter()), Some(port));
            assert_eq!(Port::from_index(port.index()), Some(port));
        }
        assert_eq!(Port::from_letter('E'), None);
        assert_eq!(Port::from_index(4), None);
    }
}
