//! Messages of EoE for the corpus.

use std::error::Error;

use linesman_proto::mailbox::eoe::{Message as EoeMessage, fragments};

use super::Made;

/// Ethernet frames in fragments: whole, and with one that is missing, comes twice, or comes behind the next.
pub(crate) fn ethernet_messages() -> Result<Made, Box<dyn Error>> {
    let mut frame = [0_u8; 300];
    frame[..14].copy_from_slice(&[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 2, 0, 0, 0, 0, 1, 8, 6]);
    let mut messages = Vec::new();
    for number in 0..2 {
        for fragment in fragments(&frame, 0, number, 132) {
            let mut bytes = vec![0; 200];
            let len = EoeMessage::Fragment(fragment).write(&mut bytes)?;
            bytes.truncate(len);
            messages.push(bytes);
        }
    }
    let series = |order: &[usize]| {
        let mut bytes = Vec::new();
        for (counter, at) in (1..8_u8).cycle().zip(order) {
            let [low, high] = (messages[*at].len() as u16).to_le_bytes();
            bytes.extend([0, low, high, counter]);
            bytes.extend(&messages[*at]);
        }
        bytes
    };
    Ok(vec![
        ("whole", series(&[0, 1, 2, 3, 4, 5])),
        ("missing", series(&[0, 2, 3, 4, 5])),
        ("doubled", series(&[0, 1, 1, 2, 3, 4, 5])),
        ("overtaken", series(&[0, 2, 1, 3, 4, 5])),
    ])
}
