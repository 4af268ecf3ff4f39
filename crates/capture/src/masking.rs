//! Masking of process data, so that a capture can be given away without what the machine does.

use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;

/// Sets the data of all datagrams with process data to 0; addresses, lengths and working counters stay. `false` where a
/// frame cannot be taken apart: what is in it is not known then, and stays.
pub fn mask_process_data(frame: &mut [u8]) -> bool {
    let start = frame.as_ptr() as usize;
    let Ok(view) = FrameView::parse(frame) else { return false };
    let mut is_whole = true;
    let mut ranges = Vec::new();
    for datagram in view.datagrams() {
        let Ok(datagram) = datagram else {
            is_whole = false;
            break;
        };
        if datagram.command().map(Command::addressing) == Some(Addressing::Logical) {
            let at = datagram.data().as_ptr() as usize - start;
            ranges.push(at..at + datagram.data().len());
        }
    }
    for range in ranges {
        frame[range].fill(0);
    }
    is_whole
}

#[cfg(test)]
mod tests {
    use linesman_proto::address::{LogicalAddress, RegisterAddress};
    use linesman_proto::ethernet::MacAddress;
    use linesman_proto::frame::FrameBuilder;
    use linesman_proto::frame::builder::DatagramAddress;

    use super::*;

    #[test]
    fn process_data_become_zero_and_all_else_stays() {
        let mut buffer = [0; 1514];
        let mut builder = FrameBuilder::new(&mut buffer, MacAddress([0, 1, 2, 3, 4, 5]));
        let station = DatagramAddress::Physical(0x1001, RegisterAddress(0x0130));
        builder.push(Command::Fprd, 1, station, 2).unwrap().copy_from_slice(&[8, 0]);
        let logical = DatagramAddress::Logical(LogicalAddress(0x0100_0000));
        builder.push(Command::Lrw, 2, logical, 6).unwrap().copy_from_slice(&[1, 2, 3, 4, 5, 6]);
        let len = builder.finish();
        let before = buffer[..len].to_vec();
        let mut after = before.clone();
        assert!(mask_process_data(&mut after));
        let changed: Vec<usize> = (0..len).filter(|at| before[*at] != after[*at]).collect();
        assert_eq!(changed.len(), 6, "{changed:?}");
        let view = FrameView::parse(&after).unwrap();
        let data: Vec<Vec<u8>> =
            view.datagrams().map(|datagram| datagram.unwrap().data().to_vec()).collect();
        assert_eq!(data, [vec![8, 0], vec![0; 6]]);
    }

    #[test]
    fn frame_that_is_cut_off_is_masked_as_far_as_it_is_known() {
        let mut nothing = [0_u8; 12];
        assert!(!mask_process_data(&mut nothing));
    }
}
