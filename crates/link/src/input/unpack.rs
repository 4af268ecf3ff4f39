//! Packed inputs: gzip, xz, zstd, told by their first bytes.

use std::io::{self, BufReader, Read};

use flate2::bufread::MultiGzDecoder;
use liblzma::bufread::XzDecoder;
use liblzma::stream::{CONCATENATED, Stream};

const GZIP: &[u8] = b"\x1F\x8B";
const XZ: &[u8] = b"\xFD7zXZ\0";
const ZSTD: &[u8] = b"\x28\xB5\x2F\xFD";

/// Most memory for unpacking xz, in bytes; `xz -9` needs 65 MiB.
const XZ_MEMORY: u64 = 128 * 1024 * 1024;
/// Largest window for unpacking zstd, as a power of 2; `zstd --long` takes 27.
const ZSTD_WINDOW_LOG: u32 = 27;
/// So many first bytes tell what an input is, however slowly the others come.
const ENOUGH: usize = 8;
/// Packed bytes that are fetched in one go.
const FETCHED: usize = 64 * 1024;

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
    let packed = |stream| BufReader::with_capacity(FETCHED, stream);
    let opened: io::Result<Box<dyn Read + Send>> = if head.starts_with(GZIP) {
        Ok(Box::new(MultiGzDecoder::new(packed(stream))))
    } else if head.starts_with(XZ) {
        Stream::new_stream_decoder(XZ_MEMORY, CONCATENATED)
            .map(|decoder| Box::new(XzDecoder::new_stream(packed(stream), decoder)) as _)
            .map_err(io::Error::from)
    } else if head.starts_with(ZSTD) {
        zstd::Decoder::with_buffer(packed(stream)).and_then(|mut decoder| {
            decoder.window_log_max(ZSTD_WINDOW_LOG)?;
            Ok(Box::new(decoder) as _)
        })
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
