//! EoE of a device: addresses are set and read, frames go to its [`EthernetSide`] and come from there.
//!
//! Read first: ETG.1000.6, EoE; facts 6.6. Whoever wants to know when a frame left is told, at once.

use std::collections::VecDeque;

use linesman_proto::mailbox::eoe::{
    ADDRESS_LEN, Assembly, EOE_HEADER_LEN, EoeError, EoeResult, Fragment, IpParameters, Message,
    Setting, fragments,
};
use linesman_proto::mailbox::{ErrorReplyCode, HEADER_LEN};
use linesman_proto::time::Instant;

use super::Answers;
use crate::device::ethernet::EthernetSide;
use crate::device::software_fault::{FragmentTrouble, FragmentWay, SoftwareFault, SoftwareFaults};

/// Fragments that a fault of the device's software has left out (`eoe-fault`).
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct FragmentsLeftOut {
    /// Of those that it sends.
    pub from_device: u64,
    /// Of those that the MainDevice sent to it.
    pub to_device: u64,
}

/// The port.
#[derive(Default, Debug)]
pub(super) struct EoePort {
    addresses: IpParameters,
    assembly: Assembly,
    side: Option<EthernetSide>,
    /// Fragments of the frame that is being sent.
    fragments: VecDeque<Vec<u8>>,
    /// Number of the next frame, 0 to 15.
    number: u8,
    left_out: FragmentsLeftOut,
}

impl EoePort {
    /// Frames go there from now on.
    pub(super) fn connect(&mut self, side: EthernetSide) {
        self.side = Some(side);
    }

    /// The device has started anew.
    pub(super) fn restarted(mut self) -> Self {
        self.side.iter_mut().for_each(EthernetSide::restart);
        Self { side: self.side, left_out: self.left_out, ..Self::default() }
    }

    /// The IP stack or switch that frames go to.
    pub(super) const fn side(&self) -> Option<&EthernetSide> {
        self.side.as_ref()
    }

    /// The same, to hand frames to its ports.
    pub(super) const fn side_mut(&mut self) -> Option<&mut EthernetSide> {
        self.side.as_mut()
    }

    /// Fragments that were left out since the device was built.
    pub(super) const fn left_out(&self) -> FragmentsLeftOut {
        self.left_out
    }

    /// Does what is to be done now; says when to come again.
    pub(super) fn handle_timeout(&mut self, now: Instant) -> Option<Instant> {
        let side = self.side.as_mut()?;
        side.handle_timeout(now);
        side.poll_timeout(now)
    }

    /// The next fragment for the MainDevice, for a mailbox of so many bytes.
    pub(super) fn poll_fragment(
        &mut self,
        mailbox: usize,
        software_faults: &mut SoftwareFaults,
    ) -> Option<Vec<u8>> {
        while self.fragments.is_empty() {
            let frame = self.side.as_mut()?.poll_transmit()?;
            let room = mailbox.saturating_sub(HEADER_LEN);
            let pieces = fragments(&frame, 0, self.number, room);
            let pieces = pieces.map(|piece| write(&Message::Fragment(piece)));
            self.fragments = spoiled(pieces, software_faults, &mut self.left_out.from_device);
            self.number = (self.number + 1) & 0x0F;
        }
        self.fragments.pop_front()
    }

    /// Answers a message, if it asks for an answer.
    pub(super) fn answer(
        &mut self,
        request: &[u8],
        now: Instant,
        software_faults: &mut SoftwareFaults,
    ) -> Result<Answers, ErrorReplyCode> {
        match Message::parse(request) {
            Ok(Message::Fragment(_)) if software_faults.has(SoftwareFault::EoeBufferFull) => {
                self.assembly = Assembly::default();
                Err(ErrorReplyCode::NoMemory)
            }
            Ok(Message::Fragment(_))
                if software_faults.spoils_fragment(FragmentWay::ToDevice).is_some() =>
            {
                self.left_out.to_device += 1;
                Ok(Vec::new())
            }
            Ok(Message::Fragment(fragment)) => Ok(self.take(&fragment, now)),
            Ok(Message::Request { port, about, parameters }) => {
                Ok(vec![self.set_or_get(port, about, parameters)])
            }
            // What a device sends, nobody sends to a device.
            Ok(Message::Response { .. } | Message::TimeStamp { .. }) => {
                Err(ErrorReplyCode::ServiceNotSupported)
            }
            Err(EoeError::CutOff { .. }) => Err(ErrorReplyCode::SizeTooShort),
            Err(EoeError::UnknownType(_)) => Err(ErrorReplyCode::InvalidHeader),
        }
    }

    /// A frame of which a piece is missing is forgotten without a word, as on any Ethernet.
    fn take(&mut self, fragment: &Fragment<'_>, now: Instant) -> Answers {
        let Ok(Some(frame)) = self.assembly.take(fragment) else { return Vec::new() };
        if let Some(side) = &mut self.side {
            side.handle_frame(&frame);
        }
        if !fragment.time_requested {
            return Vec::new();
        }
        let time = now.as_nanos() as u32;
        let stamp = Message::TimeStamp { port: fragment.port, frame: fragment.frame, time };
        vec![write(&stamp)]
    }

    fn set_or_get(&mut self, port: u8, about: Setting, parameters: &[u8]) -> Vec<u8> {
        let mut bytes = [0; ADDRESS_LEN];
        let (result, len) = match about {
            Setting::SetIp => match IpParameters::parse(parameters) {
                Some(newer) => {
                    self.addresses = self.addresses.merged(newer);
                    if let Some(side) = &mut self.side {
                        side.set_addresses(&self.addresses);
                    }
                    (EoeResult::SUCCESS, 0)
                }
                None => (EoeResult::UNSPECIFIED, 0),
            },
            Setting::GetIp => match self.addresses.write(&mut bytes) {
                Ok(len) => (EoeResult::SUCCESS, len),
                Err(_) => (EoeResult::UNSPECIFIED, 0),
            },
            Setting::SetFilter | Setting::GetFilter => (EoeResult::NO_FILTER, 0),
        };
        write(&Message::Response { port, about, result, parameters: &bytes[..len] })
    }
}

/// The fragments of a frame as they leave: all of them in order, or not.
fn spoiled(
    pieces: impl Iterator<Item = Vec<u8>>,
    software_faults: &mut SoftwareFaults,
    left_out: &mut u64,
) -> VecDeque<Vec<u8>> {
    let mut leaving = VecDeque::new();
    let mut late = None;
    for piece in pieces {
        let overtaken = late.take();
        match software_faults.spoils_fragment(FragmentWay::FromDevice) {
            Some(FragmentTrouble::Lost) => *left_out += 1,
            Some(FragmentTrouble::OutOfOrder) if overtaken.is_none() => late = Some(piece),
            Some(FragmentTrouble::Doubled) => leaving.extend([piece.clone(), piece]),
            Some(FragmentTrouble::OutOfOrder) | None => leaving.push_back(piece),
        }
        leaving.extend(overtaken);
    }
    leaving.extend(late);
    leaving
}

fn write(message: &Message<'_>) -> Vec<u8> {
    let body = match message {
        Message::Fragment(fragment) => fragment.data.len(),
        Message::TimeStamp { .. } | Message::Request { .. } | Message::Response { .. } => {
            ADDRESS_LEN
        }
    };
    let mut buffer = vec![0; EOE_HEADER_LEN + body];
    let len = message.write(&mut buffer).unwrap_or(0);
    buffer.truncate(len);
    buffer
}

#[cfg(test)]
mod tests {
    use linesman_proto::mailbox::eoe::fragments;

    use super::*;
    use crate::device::software_fault::SpoiledFragments;
    use crate::seed::Seed;

    fn ask(port: &mut EoePort, message: &Message<'_>) -> Vec<Vec<u8>> {
        let mut buffer = [0; 2_000];
        let len = message.write(&mut buffer).unwrap();
        port.answer(&buffer[..len], Instant::from_nanos(77), &mut SoftwareFaults::default())
            .unwrap()
    }

    #[test]
    fn addresses_that_were_set_are_read() {
        let mut port = EoePort::default();
        let get = Message::Request { port: 0, about: Setting::GetIp, parameters: &[] };
        assert_eq!(ask(&mut port, &get), [vec![0x07, 0x01, 0, 0, 0, 0, 0, 0]]);
        let ip = Some([192, 168, 1, 11]);
        let mut bytes = [0; ADDRESS_LEN];
        let len = IpParameters { ip, ..IpParameters::default() }.write(&mut bytes).unwrap();
        let set = Message::Request { port: 0, about: Setting::SetIp, parameters: &bytes[..len] };
        assert_eq!(ask(&mut port, &set), [vec![0x03, 0x01, 0, 0]]);
        let answer = &ask(&mut port, &get)[0];
        let Ok(Message::Response { result, parameters, .. }) = Message::parse(answer) else {
            panic!("{answer:02X?}")
        };
        assert_eq!((result, IpParameters::parse(parameters).unwrap().ip), (EoeResult::SUCCESS, ip));
        let cut_off =
            Message::Request { port: 0, about: Setting::SetIp, parameters: &[2, 0, 0, 0] };
        assert_eq!(ask(&mut port, &cut_off), [vec![0x03, 0x01, 0x01, 0x00]]);
        let filter = Message::Request { port: 0, about: Setting::SetFilter, parameters: &[] };
        assert_eq!(ask(&mut port, &filter), [vec![0x05, 0x01, 0x01, 0x04]]);
        let err = port
            .answer(&[0x0F, 0, 0, 0], Instant::ZERO, &mut SoftwareFaults::default())
            .unwrap_err();
        assert_eq!(err, ErrorReplyCode::InvalidHeader);
    }

    #[test]
    fn fragments_are_lost_doubled_or_overtaken_and_a_full_buffer_refuses_them() {
        let pieces = || (0..6_u8).map(|at| vec![at]);
        let leave = |trouble, share_ppm| {
            let mut faults = SoftwareFaults::default();
            let seed = Seed(3);
            let spoils = SpoiledFragments { way: None, trouble, share_ppm, seed };
            faults.begin(SoftwareFault::SpoilsFragments(spoils));
            let mut left_out = 0;
            let left = spoiled(pieces(), &mut faults, &mut left_out);
            assert_eq!(left_out, 6_u64.saturating_sub(left.len() as u64));
            left.into_iter().flatten().collect::<Vec<u8>>()
        };
        let all = 1_000_000;
        assert_eq!(leave(FragmentTrouble::Lost, 0), [0, 1, 2, 3, 4, 5]);
        assert_eq!(leave(FragmentTrouble::Lost, all), [0_u8; 0]);
        assert_eq!(leave(FragmentTrouble::Doubled, all), [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]);
        assert_eq!(leave(FragmentTrouble::OutOfOrder, all), [1, 0, 3, 2, 5, 4]);
        let mut faults = SoftwareFaults::default();
        faults.begin(SoftwareFault::EoeBufferFull);
        let piece = fragments(&[0x55; 60], 0, 0, 132).next().unwrap();
        let mut buffer = [0; 200];
        let len = Message::Fragment(piece).write(&mut buffer).unwrap();
        let refused = EoePort::default().answer(&buffer[..len], Instant::ZERO, &mut faults);
        assert_eq!(refused, Err(ErrorReplyCode::NoMemory));
    }

    #[test]
    fn frames_leave_and_tell_when_if_asked() {
        let mut port = EoePort::default();
        let frame = [0x55; 300];
        for asked in [false, true] {
            let pieces: Vec<_> = fragments(&frame, 1, 4, 132).collect();
            let mut answers = Vec::new();
            for mut piece in pieces {
                piece.time_requested = asked;
                answers.extend(ask(&mut port, &Message::Fragment(piece)));
            }
            let stamp = vec![0x11, 0x00, 0x00, 0x40, 77, 0, 0, 0];
            assert_eq!(answers, if asked { vec![stamp] } else { Vec::new() });
        }
    }
}
