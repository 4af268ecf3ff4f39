//! Frames that a MainDevice sends by the second card of a ring for no other reason than to see which way they come back.
//!
//! SOEM does so: for each frame of the first card the second one sends a broadcast read of register 0x0000 with the same
//! index and with a source address of its own (`ecx_outframe_red`, `secMAC` in SOEM's `nicdrv.c`). While the ring is whole
//! nobody processes it, since it goes round backwards. It asks for nothing, and is no MainDevice of its own.

use linesman_proto::address::RegisterAddress;
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameView;

/// The source address of SOEM's second card, as it leaves the card.
const SOEM_SECOND: MacAddress = MacAddress([0x01, 0x01, 0x04, 0x04, 0x01, 0x01]);

/// Controllers that have processed such a frame; `None` for any other frame.
pub(crate) fn processed(view: &FrameView<'_>) -> Option<u16> {
    let source = view.source();
    if source.marked() != SOEM_SECOND.marked() {
        return None;
    }
    let mut datagrams = view.datagrams();
    let (Some(Ok(only)), None) = (datagrams.next(), datagrams.next()) else { return None };
    let is_look = only.command() == Some(Command::Brd) && only.ado() == RegisterAddress(0);
    is_look.then(|| only.wkc().0)
}
