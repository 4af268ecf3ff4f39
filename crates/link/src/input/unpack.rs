//! Packed inputs: gzip, xz, zstd, told by their first bytes.

use std::io::{self, Read};

#[cfg(feature = "packed-input")]
#[path = "unpack/decoder.rs"]
mod decoder;
#[cfg(not(feature = "packed-input"))]
#[path = "unpack/no_decoder.rs"]
mod decoder;

const GZIP: &[u8] = b"\x1F\x8B";
const XZ: &[u8] = b"\xFD7zXZ\0";
const ZSTD: &[u8] = b"\x28\xB5\x2F\xFD";

/// So many first bytes tell what an input is, however slowly the others come.
const ENOUGH: usize = 8;

/// The first bytes of a source once it is unpacked, at least `len` where it has so many, and all of it
/// from the first byte on.
pub(super) fn begin(source: Box<dyn Read + Send>, len: usize) -> (Vec<u8>, Box<dyn Read + Send>) {
    let (head, stream) = peek(source, len);
    match unpacked(&head, stream) {
        // It is packed once at most: what is packed twice is told as that.
        Packing::Was(stream) => peek(stream, len),
        Packing::None(stream) => (head, stream),
    }
}

enum Packing {
    Was(Box<dyn Read + Send>),
    None(Box<dyn Read + Send>),
}

fn unpacked(head: &[u8], stream: Box<dyn Read + Send>) -> Packing {
    let opened = if head.starts_with(GZIP) {
        decoder::gzip(stream)
    } else if head.starts_with(XZ) {
        decoder::xz(stream)
    } else if head.starts_with(ZSTD) {
        decoder::zstd(stream)
    } else {
        return Packing::None(stream);
    };
    Packing::Was(opened.unwrap_or_else(|error| Box::new(Failing(Some(error)))))
}

/// Looks at the first `len` bytes.
fn peek(mut source: Box<dyn Read + Send>, len: usize) -> (Vec<u8>, Box<dyn Read + Send>) {
    let mut head = vec![0; len];
    let mut filled = 0;
    let mut fault = None;
    // What tells is in the first bytes: who writes slowly is not waited for.
    while filled < len.min(ENOUGH) {
        match source.read(&mut head[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => {
                fault = Some(error);
                break;
            }
        }
    }
    head.truncate(filled);
    let again = io::Cursor::new(head.clone());
    let stream: Box<dyn Read + Send> = match fault {
        None => Box::new(again.chain(source)),
        Some(fault) => Box::new(again.chain(Failing(Some(fault)))),
    };
    (head, stream)
}

/// Fails once, then ends.
struct Failing(Option<io::Error>);

impl Read for Failing {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        self.0.take().map_or(Ok(0), Err)
    }
}
