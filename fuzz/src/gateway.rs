//! Frames of the mailbox gateway, whole and as a stream.

use linesman_proto::frame::ETHERCAT_HEADER_LEN;
use linesman_proto::mailbox::gateway::{self, MAX_LEN};

/// Any bytes may come in a datagram or over a connection. What is read and written again is the same, and a stream is
/// cut into frames that end where they say.
pub fn gateway(data: &[u8]) {
    if let Ok(message) = gateway::parse(data) {
        let mut buffer = [0_u8; MAX_LEN];
        let len = gateway::write(message.header, message.data, &mut buffer)
            .expect("no longer than it was");
        assert!(len <= data.len());
        assert_eq!(gateway::parse(&buffer[..len]), Ok(message));
    }
    let mut rest = data;
    while let Some(header) = rest.first_chunk::<ETHERCAT_HEADER_LEN>() {
        let Ok(len) = gateway::frame_len(*header) else { return };
        assert!((ETHERCAT_HEADER_LEN + 6..=MAX_LEN).contains(&len));
        let Some((frame, behind)) = rest.split_at_checked(len) else { return };
        // The mailbox header may announce more than the frame has; nothing else can be wrong with it.
        let _ = gateway::parse(frame);
        rest = behind;
    }
}
