//! The kernel's filter for EtherCAT frames: what `proto::ethernet::locate` finds, as a program of
//! the classic packet filter.
//!
//! Reference: `Documentation/networking/filter.rst` of Linux. A load beyond the end of the frame
//! refuses it. The kernel takes one VLAN tag off before filtering; frames sent by raw sockets keep
//! theirs.

use libc::sock_filter;
use linesman_proto::ethernet::{
    ETHERTYPE_ETHERCAT, ETHERTYPE_IPV4, ETHERTYPE_QINQ, ETHERTYPE_VLAN, UDP_PORT,
};

/// Load 16 bits at an absolute offset.
const LOAD_16: u16 = 0x28;
/// Load 8 bits at an absolute offset.
const LOAD_8: u16 = 0x30;
/// Jump by one distance if equal, by the other if not.
const JUMP_EQUAL: u16 = 0x15;
/// Return how many bytes to keep.
const RETURN: u16 = 0x06;

/// Most VLAN tags that are looked past.
const TAGS: usize = 2;
/// The instruction that accepts, and behind it the one that refuses.
const ACCEPT: usize = TAGS * TYPE_LEN + TYPE_LEN_LAST + (TAGS + 1) * UDP_LEN;
const REFUSE: usize = ACCEPT + 1;
/// Instructions that look at an EtherType, where a tag may follow and where none may.
const TYPE_LEN: usize = 5;
const TYPE_LEN_LAST: usize = 3;
/// Instructions that look for EtherCAT in UDP.
const UDP_LEN: usize = 6;

/// The program: first the EtherTypes at each depth of tags, then UDP at each depth.
pub(super) fn program() -> Vec<sock_filter> {
    let mut code = Assembler(Vec::with_capacity(REFUSE + 1));
    for tags in 0..=TAGS {
        let next = code.0.len() + TYPE_LEN;
        code.load(LOAD_16, 12 + 4 * tags);
        code.jump(ETHERTYPE_ETHERCAT, ACCEPT, None);
        if tags < TAGS {
            code.jump(ETHERTYPE_IPV4, udp_at(tags), None);
            code.jump(ETHERTYPE_VLAN, next, None);
            code.jump(ETHERTYPE_QINQ, next, Some(REFUSE));
        } else {
            code.jump(ETHERTYPE_IPV4, udp_at(tags), Some(REFUSE));
        }
    }
    for tags in 0..=TAGS {
        let ip = 14 + 4 * tags;
        for (load, at, value) in
            [(LOAD_8, ip, 0x45), (LOAD_8, ip + 9, 17), (LOAD_16, ip + 22, UDP_PORT)]
        {
            code.load(load, at);
            let next = if at == ip + 22 { ACCEPT } else { code.0.len() + 1 };
            code.jump(value, next, Some(REFUSE));
        }
    }
    code.push(RETURN, u32::MAX);
    code.push(RETURN, 0);
    code.0
}

/// Where the look for UDP behind `tags` tags begins.
fn udp_at(tags: usize) -> usize {
    TAGS * TYPE_LEN + TYPE_LEN_LAST + tags * UDP_LEN
}

struct Assembler(Vec<sock_filter>);

impl Assembler {
    fn push(&mut self, code: u16, k: u32) {
        self.0.push(sock_filter { code, jt: 0, jf: 0, k });
    }

    fn load(&mut self, code: u16, at: usize) {
        self.push(code, at as u32);
    }

    /// Jumps to `equal` when the loaded value is `value`, else to `other`, which is the next
    /// instruction unless given.
    fn jump(&mut self, value: u16, equal: usize, other: Option<usize>) {
        let next = self.0.len() + 1;
        let distance = |to: usize| (to - next) as u8;
        let (jt, jf) = (distance(equal), other.map_or(0, distance));
        self.0.push(sock_filter { code: JUMP_EQUAL, jt, jf, k: value.into() });
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::ethernet::locate;
    use proptest::prelude::*;

    use super::*;

    /// Runs the program as the kernel would; a program that never returns is a failure.
    fn accepts(program: &[sock_filter], frame: &[u8]) -> bool {
        let (mut at, mut loaded) = (0, 0_u32);
        for _ in 0..program.len() {
            let instruction = &program[at];
            at += 1;
            let k = instruction.k as usize;
            match instruction.code {
                LOAD_16 => match frame.get(k..k + 2) {
                    Some(bytes) => loaded = u16::from_be_bytes([bytes[0], bytes[1]]).into(),
                    None => return false,
                },
                LOAD_8 => match frame.get(k) {
                    Some(byte) => loaded = (*byte).into(),
                    None => return false,
                },
                JUMP_EQUAL => {
                    let equal = loaded == instruction.k;
                    at += usize::from(if equal { instruction.jt } else { instruction.jf });
                }
                RETURN => return instruction.k != 0,
                other => panic!("instruction 0x{other:02X}"),
            }
        }
        panic!("the program does not return");
    }

    #[test]
    fn the_program_is_as_long_as_its_jumps_assume() {
        assert_eq!(program().len(), REFUSE + 1);
    }

    proptest! {
        /// Pieces that matter, in any order and cut anywhere, are judged as `locate` judges them.
        // proves: FRM-01 partial
        #[test]
        fn the_kernel_keeps_what_locate_finds(
            pieces in proptest::collection::vec(0..8_usize, 0..6),
            cut in 0..80_usize,
        ) {
            let mut udp = vec![0; 28];
            udp[0] = 0x45;
            udp[9] = 17;
            udp[22..24].copy_from_slice(&UDP_PORT.to_be_bytes());
            let mut other_protocol = udp.clone();
            other_protocol[9] = 6;
            let table: [&[u8]; 8] = [
                &[0x88, 0xA4],
                &[0x08, 0x00],
                &[0x81, 0x00],
                &[0x88, 0xA8],
                &[0x20, 0x05],
                &udp,
                &other_protocol,
                &[0x45, 0x00, 0x00],
            ];
            let mut frame = vec![0xFF; 12];
            for piece in pieces {
                frame.extend(table[piece]);
            }
            frame.truncate(cut);
            prop_assert_eq!(accepts(&program(), &frame), locate(&frame).is_some());
        }
    }
}
