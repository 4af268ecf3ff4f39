//! Execution of the datagrams of a frame on the fast path, each at all controllers that it is for.

use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, WKC_LEN};

use super::FastTransit;
use crate::controller::{Answer, Header, PlainRead};
use crate::wire::address_cache::{AddressKind, AddressQuery};
use crate::wire::world::World;

impl World {
    #[inline]
    pub(super) fn execute_all(&mut self, transit: &FastTransit<'_>, bytes: &mut [u8]) {
        let interrupting = self.nodes.address_directory.interrupting();
        let irq = if interrupting.is_empty() { 0 } else { self.irq(transit, interrupting) };
        let mut rest = bytes;
        while let Some((header, body)) = rest.split_first_chunk_mut::<DATAGRAM_HEADER_LEN>() {
            let read = Header::read(header);
            if irq != 0 {
                let irq = u16::from_le_bytes([header[8], header[9]]) | irq;
                header[8..10].copy_from_slice(&irq.to_le_bytes());
            }
            let (data, behind) = body.split_at_mut(read.len);
            let Some((counter, next)) = behind.split_first_chunk_mut::<WKC_LEN>() else { return };
            if let Some(command) = read.command {
                if command.increments_position() {
                    let passed = read.adp.wrapping_add(transit.route.visits.len() as u16);
                    header[2..4].copy_from_slice(&passed.to_le_bytes());
                }
                let increment = self.execute(transit, command, read, data);
                *counter = u16::from_le_bytes(*counter).wrapping_add(increment).to_le_bytes();
            }
            if !read.more {
                return;
            }
            rest = next;
        }
    }

    /// What controllers on the way add to the event field.
    fn irq(&self, transit: &FastTransit<'_>, interrupting: &[u32]) -> u16 {
        let here = interrupting.iter().filter(|node| transit.route.place(**node).is_some());
        here.fold(0, |irq, node| irq | self.nodes[*node as usize].controller.irq())
    }

    /// Executes a datagram at everybody it is for, and says what to add to its working counter.
    fn execute(
        &mut self,
        transit: &FastTransit<'_>,
        command: Command,
        header: Header,
        data: &mut [u8],
    ) -> u16 {
        let effect = command.effect();
        let plain = if effect.reads && !effect.writes && !effect.multiple_write {
            PlainRead::of(header.ado, header.len)
        } else {
            None
        };
        let addressing = command.addressing();
        if effect.multiple_write {
            return self.execute_everywhere(transit, addressing, header, data);
        }
        let ors = effect.ors;
        match addressing {
            Addressing::None => 0,
            Addressing::Broadcast => match plain {
                Some(read) => self.broadcast(transit, &read, header, data),
                None => self.execute_everywhere(transit, addressing, header, data),
            },
            Addressing::Position => {
                let first = usize::from(0_u16.wrapping_sub(header.adp));
                let header = Header { adp: 0, ..header };
                let mut sum = 0_u16;
                for place in (first..transit.route.visits.len()).step_by(1 << 16) {
                    let place = place as u32;
                    sum = sum.wrapping_add(self.one(
                        transit,
                        place,
                        plain.as_ref(),
                        ors,
                        header,
                        data,
                    ));
                }
                sum
            }
            Addressing::Station => {
                let query = AddressQuery::station(transit.card, header.adp);
                self.each(transit, query, |world, place| {
                    world.one(transit, place, plain.as_ref(), ors, header, data)
                })
            }
            Addressing::Logical => {
                let query = AddressQuery::logical(transit.card, header.logical(), header.len);
                self.each(transit, query, |world, place| world.at(transit, place, header, data))
            }
        }
    }

    /// Does something at each place on the way that answers a question, in order, and adds up.
    #[inline]
    fn each(
        &mut self,
        transit: &FastTransit<'_>,
        query: AddressQuery,
        mut one: impl FnMut(&mut Self, u32) -> u16,
    ) -> u16 {
        let edition = self.fast_path.edition + self.nodes.address_directory.names();
        let places = match self.fast_path.address_cache.take(query, edition) {
            Ok(places) => places,
            Err(mut places) => {
                let address_directory = &self.nodes.address_directory;
                let mut answer = |node| places.extend(transit.route.place(node));
                match query.asked() {
                    AddressKind::Station(address) => {
                        address_directory.stations(address).for_each(&mut answer)
                    }
                    AddressKind::Logical(start, len) => {
                        address_directory.mapping(start, len).for_each(&mut answer);
                    }
                }
                places.sort_unstable();
                places.dedup();
                places
            }
        };
        let mut sum = 0_u16;
        for place in &places {
            sum = sum.wrapping_add(one(self, *place));
        }
        self.fast_path.address_cache.keep(query, edition, places);
        sum
    }

    /// Reads registers of all controllers into one.
    fn broadcast(
        &mut self,
        transit: &FastTransit<'_>,
        read: &PlainRead,
        header: Header,
        data: &mut [u8],
    ) -> u16 {
        let mut sum = 0_u16;
        let mut gathered = 0_u64;
        for (place, visit) in (0_u32..).zip(&transit.route.visits) {
            let controller = &self.nodes[visit.node as usize].controller;
            let answer = if read.is_short() {
                controller.peek(read, &mut gathered)
            } else {
                controller.read_plainly(read, data, true)
            };
            match answer {
                Answer::Nothing => {}
                Answer::Read => sum = sum.wrapping_add(1),
                Answer::Effect => {
                    sum = sum.wrapping_add(self.at(transit, place, header, data));
                }
            }
        }
        for (out, byte) in data.iter_mut().zip(gathered.to_le_bytes()) {
            *out |= byte;
        }
        sum
    }

    /// Goes past all controllers, as auto-increment and multiple-write commands need it.
    fn execute_everywhere(
        &mut self,
        transit: &FastTransit<'_>,
        addressing: Addressing,
        header: Header,
        data: &mut [u8],
    ) -> u16 {
        let counts = addressing == Addressing::Position;
        let mut sum = 0_u16;
        for place in 0..transit.route.visits.len() as u32 {
            let adp = if counts { header.adp.wrapping_add(place as u16) } else { header.adp };
            sum = sum.wrapping_add(self.at(transit, place, Header { adp, ..header }, data));
        }
        sum
    }

    /// Executes a datagram at one controller that it is for.
    #[inline]
    fn one(
        &mut self,
        transit: &FastTransit<'_>,
        place: u32,
        plain: Option<&PlainRead>,
        ors: bool,
        header: Header,
        data: &mut [u8],
    ) -> u16 {
        if let Some(read) = plain {
            let node = transit.route.visits[place as usize].node as usize;
            match self.nodes[node].controller.read_plainly(read, data, ors) {
                Answer::Nothing => return 0,
                Answer::Read => return 1,
                Answer::Effect => {}
            }
        }
        self.at(transit, place, header, data)
    }

    /// Executes a datagram at one controller.
    #[inline]
    fn at(
        &mut self,
        transit: &FastTransit<'_>,
        place: u32,
        header: Header,
        data: &mut [u8],
    ) -> u16 {
        let (index, at) = transit.at_place(place);
        let node = self.nodes.quietly(index);
        if node.last_frame != transit.number {
            node.last_frame = transit.number;
            node.controller.begin(at, transit.number);
            self.fast_path.touched.push(place);
        }
        node.controller.execute(&header, data)
    }

    /// The frame has passed all.
    pub(super) fn end_all(&mut self, transit: &FastTransit<'_>) {
        let mut touched = std::mem::take(&mut self.fast_path.touched);
        for place in touched.drain(..) {
            let (index, at) = transit.at_place(place);
            let changed = self.nodes.quietly(index).controller.end(at + transit.duration);
            if changed {
                self.nodes.wake(index);
            } else {
                self.nodes.reschedule(index);
            }
        }
        self.fast_path.touched = touched;
    }
}
