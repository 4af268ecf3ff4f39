//! A real terminal with CoE, as it was recorded, beside the one of the library.

use linesman_proto::command::Command;
use linesman_proto::frame::FrameView;
use linesman_proto::mailbox::{HEADER_LEN, Header};

use super::Device;
use crate::controller::tests::recorded::packets;

/// Where the real one had its mailbox.
const REQUESTS: u16 = 0x1000;
const ANSWERS: u16 = 0x1080;
/// Its station.
const STATION: u16 = 0x1001;

/// Messages written to the terminal's mailbox and those read from it, in order.
fn messages(file: &[u8]) -> Vec<(bool, Vec<u8>)> {
    let mut messages = Vec::new();
    for (_, frame) in packets(file) {
        let came_back = frame[6] & 0x02 != 0;
        let Ok(view) = FrameView::parse(&frame) else { continue };
        for datagram in view.datagrams().flatten() {
            let taken = came_back && datagram.wkc().value() == 1;
            if !taken || datagram.adp() != STATION || datagram.data().len() < HEADER_LEN {
                continue;
            }
            let written = datagram.code() == Command::Fpwr.code();
            if datagram.ado().0 == if written { REQUESTS } else { ANSWERS } {
                let len = usize::from(Header::parse(datagram.data()).unwrap().length);
                // Behind the message the mailbox holds whatever was in it before.
                let message = datagram.data()[..HEADER_LEN + len].to_vec();
                messages.push((written, message));
            }
        }
    }
    messages
}

/// The message without what may differ: the software version, and the reserved bytes of the answer to
/// a download, where the real terminal left the data of the request.
fn comparable(message: &[u8]) -> &[u8] {
    const DOWNLOADED: u8 = 0x60;
    let version = message[9..11] == [0x0A, 0x10];
    let len = if message[8] == DOWNLOADED || version { 12 } else { message.len() };
    &message[..len]
}

#[test]
#[allow(clippy::disallowed_methods, clippy::disallowed_macros)]
fn a_real_terminal_gave_the_same_answers() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let data = std::env::var("LINESMAN_DATA").unwrap_or(format!("{root}/../shared/data"));
    for name in [
        "ec-replay-ek1914-el3004-mailbox",
        "ec-replay-ek1914-el3004-configure",
        "echist-replay-mailbox-el3004",
    ] {
        let Ok(file) = std::fs::read(format!("{data}/pcap/{name}.pcapng")) else {
            eprintln!("SKIPPED: no {name}.pcapng in {data}/pcap; set LINESMAN_DATA");
            continue;
        };
        let mut device = Device::of("EL3004");
        device.enter_preop();
        let mut compared = 0;
        for (written, message) in messages(&file) {
            if written {
                assert!(device.post(&message), "{name}");
                continue;
            }
            let ours = device.fetch_soon().unwrap_or_else(|| panic!("{name}: {message:02X?}"));
            assert_eq!(comparable(&ours[..message.len()]), comparable(&message), "{name}");
            compared += 1;
        }
        assert!(compared >= 3, "{name}: {compared} answers compared");
    }
}
