//! Frames of a MainDevice and of a line, made by hand.

use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{FrameBuilder, FrameView};

/// A datagram: command, ADP, ADO, data, working counter.
pub(crate) type Made<'a> = (Command, u16, u16, &'a [u8], u16);

/// A frame in a buffer of its own.
#[derive(Clone, Debug)]
pub(crate) struct Frame(pub(crate) Vec<u8>);

const ZEROES: [u8; 64] = [0; 64];

pub(crate) fn lrw(wkc: u16, data: &[u8]) -> Made<'_> {
    (Command::Lrw, 0, 0, data, wkc)
}

pub(crate) fn fprd(station: u16, register: u16, len: usize) -> Made<'static> {
    (Command::Fprd, station, register, &ZEROES[..len], 0)
}

impl Frame {
    /// A frame of SOEM with these datagrams, index 3.
    pub(crate) fn of(datagrams: &[Made<'_>]) -> Self {
        Self::from(MacAddress([1; 6]), 3, datagrams)
    }

    pub(crate) fn from(source: MacAddress, index: u8, datagrams: &[Made<'_>]) -> Self {
        let mut buffer = vec![0; 1514];
        let mut builder = FrameBuilder::new(&mut buffer, source);
        for (command, adp, ado, data, _) in datagrams {
            let address = match *command == Command::Lrw {
                true => DatagramAddress::Logical(LogicalAddress(
                    u32::from(*ado) << 16 | u32::from(*adp),
                )),
                false => DatagramAddress::Physical(*adp, RegisterAddress(*ado)),
            };
            builder.push(*command, index, address, data.len()).unwrap().copy_from_slice(data);
        }
        let len = builder.finish();
        buffer.truncate(len);
        let mut frame = Self(buffer);
        let wkcs: Vec<u16> = datagrams.iter().map(|made| made.4).collect();
        frame.count(&wkcs);
        frame
    }

    /// The frame on its way back, with these working counters.
    pub(crate) fn returned(mut self, wkcs: &[u16]) -> Self {
        self.0[6] |= 0x02;
        self.count(wkcs);
        self
    }

    fn count(&mut self, wkcs: &[u16]) {
        let ends: Vec<usize> = self
            .view()
            .datagrams()
            .map_while(Result::ok)
            .map(|datagram| datagram.data_range().end)
            .collect();
        for (end, wkc) in ends.into_iter().zip(wkcs) {
            self.0[end..end + 2].copy_from_slice(&wkc.to_le_bytes());
        }
    }

    pub(crate) fn view(&self) -> FrameView<'_> {
        FrameView::parse(&self.0).unwrap()
    }
}
