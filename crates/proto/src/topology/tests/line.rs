//! A line as sockets and cables, and a frame that is carried through it port by port.
//!
//! This is the referee, so it shares nothing with the code under test: ports are numbers, the order
//! 0 → 3 → 1 → 2 stands here once more, and nothing is known of trees. Reference: S1 chapter 3.

use proptest::prelude::*;

/// Index of the MainDevice's cards among the boxes: port 0 is card A, port 1 card B.
pub(super) const CARDS: usize = usize::MAX;

/// The sockets at both ends of a cable: box and port number.
pub(super) type Socket = (usize, usize);

/// Where the ring port is handed to next: 0 → 3, 1 → 2, 2 → 0, 3 → 1.
const NEXT: [usize; 4] = [3, 2, 0, 1];

#[derive(Clone, Copy, Debug)]
pub(super) struct Cable {
    pub(super) near: Socket,
    pub(super) far: Socket,
    /// Time over it in one direction, ns.
    pub(super) delay: i64,
    pub(super) whole: bool,
}

#[derive(Clone, Debug)]
pub(super) struct Line {
    /// How many controllers there are.
    pub(super) len: usize,
    /// The cable above controller `i` is cable `i`; one that closes a ring is the last.
    pub(super) cables: Vec<Cable>,
    /// Time through a controller, ns, and what the processing unit adds.
    pub(super) forwarding: i64,
    pub(super) processing: i64,
    /// By what each controller's clock is off.
    pub(super) clock_offset: Vec<u32>,
}

/// What a frame met.
#[derive(Clone, Debug, Default)]
pub(super) struct Walk {
    /// Sockets left and entered, in order.
    pub(super) hops: Vec<(Socket, Socket)>,
    /// Controllers in the order in which their units were passed, and after how many hops.
    pub(super) processed: Vec<(usize, usize)>,
    /// True time of reception: controller, port, ns.
    pub(super) received: Vec<(usize, usize, i64)>,
    /// True time at which the frame came to each unit passed, as in `processed`.
    pub(super) unit_reached: Vec<i64>,
}

impl Line {
    /// The socket at the other end of the cable in `socket`, if that is whole, and its delay.
    fn plugged(&self, by_socket: &[[Option<usize>; 4]], socket: Socket) -> Option<(Socket, i64)> {
        let (node, port) = socket;
        let index = if node == CARDS { by_socket[self.len][port] } else { by_socket[node][port] };
        let cable = self.cables[index?];
        let other = if cable.near == socket { cable.far } else { cable.near };
        cable.whole.then_some((other, cable.delay))
    }

    fn by_socket(&self) -> Vec<[Option<usize>; 4]> {
        let mut by_socket = vec![[None; 4]; self.len + 1];
        for (index, cable) in self.cables.iter().enumerate() {
            for (node, port) in [cable.near, cable.far] {
                let row = if node == CARDS { self.len } else { node };
                assert_eq!(by_socket[row][port].replace(index), None, "one cable a socket");
            }
        }
        by_socket
    }

    /// Which ports of each controller have a whole cable.
    pub(super) fn open(&self) -> Vec<[bool; 4]> {
        let by_socket = self.by_socket();
        let open = |node: usize| {
            std::array::from_fn(|port| self.plugged(&by_socket, (node, port)).is_some())
        };
        (0..self.len).map(open).collect()
    }

    /// Carries a frame from `card` (0 or 1) until it is at a card again.
    pub(super) fn carry(&self, card: usize) -> Walk {
        let by_socket = self.by_socket();
        let mut walk = Walk::default();
        let mut time = 0i64;
        let mut from = (CARDS, card);
        while let Some((to, delay)) = self.plugged(&by_socket, from) {
            time += delay;
            walk.hops.push((from, to));
            let (node, mut port) = to;
            if node == CARDS {
                break;
            }
            walk.received.push((node, port, time));
            let came = time;
            time += self.forwarding;
            loop {
                if port == 0 {
                    walk.processed.push((node, walk.hops.len()));
                    walk.unit_reached.push(came);
                    time += self.processing;
                }
                port = NEXT[port];
                if self.plugged(&by_socket, (node, port)).is_some() {
                    break;
                }
            }
            from = (node, port);
        }
        walk
    }

    /// What each controller latched of a frame of card A: its own clock, 32 bits of ns. Ports
    /// without reception hold leftovers.
    pub(super) fn latched(&self, walk: &Walk) -> Vec<[u32; 4]> {
        let mut latched = vec![[u32::from_le_bytes(*b"hoff"); 4]; self.len];
        for &(node, port, time) in &walk.received {
            let time = u32::try_from(time).unwrap();
            latched[node][port] = self.clock_offset[node].wrapping_add(time);
        }
        latched
    }
}

/// What is drawn for one controller.
#[derive(Clone, Copy, Debug)]
struct Draw {
    on: usize,
    port: usize,
    entry: usize,
    delay: u16,
    clock_offset: u32,
}

/// Lines of up to `most` controllers, each hung on a free port of any earlier one. About one in
/// `reversed_in` is entered at a port other than 0; none if that is 0.
pub(super) fn any_line(most: usize, reversed_in: usize) -> impl Strategy<Value = Line> {
    // Clocks that wrap while the frame is under way are as likely as others.
    let offset = prop_oneof![any::<u32>(), u32::MAX - 200_000..=u32::MAX];
    let draw = (any::<usize>(), 0..4usize, any::<usize>(), 1..3_000u16, offset).prop_map(
        move |(on, port, entry, delay, clock_offset)| Draw {
            on,
            port,
            entry: match entry.checked_rem(reversed_in) {
                Some(0) => 1 + entry / reversed_in % 3,
                Some(_) | None => 0,
            },
            delay,
            clock_offset,
        },
    );
    // Every other line grows mostly at its end, so that long ones come up, too.
    let draws = (proptest::collection::vec(draw, 1..most), any::<bool>());
    (draws, 0..100i64, 0..50i64).prop_map(|((draws, long), forwarding, processing)| {
        let cables = plug(&draws, long);
        let clock_offset = draws.iter().map(|draw| draw.clock_offset).collect();
        Line { len: draws.len(), cables, forwarding, processing, clock_offset }
    })
}

fn plug(draws: &[Draw], long: bool) -> Vec<Cable> {
    let mut free: Vec<Vec<usize>> = Vec::new();
    let mut cables = Vec::new();
    for (node, draw) in draws.iter().enumerate() {
        let near = if node == 0 {
            (CARDS, 0)
        } else {
            let span = if long { node.min(3) } else { node };
            let mut on = node - 1 - draw.on % span;
            // An end of a branch always has free ports, so the search ends.
            while free[on].is_empty() {
                on = (on + 1) % node;
            }
            let at = draw.port % free[on].len();
            (on, free[on].swap_remove(at))
        };
        let far = (node, draw.entry);
        cables.push(Cable { near, far, delay: i64::from(draw.delay), whole: true });
        free.push((0..4).filter(|&port| port != draw.entry).collect());
    }
    cables
}
