//! Decoders of packed streams, in bounded memory.

use std::io::{self, BufReader, Read};

use flate2::bufread::MultiGzDecoder;
use liblzma::bufread::XzDecoder;
use liblzma::stream::{CONCATENATED, Stream};

/// Most memory for unpacking xz, in bytes; `xz -9` needs 65 MiB.
const XZ_MEMORY: u64 = 128 * 1024 * 1024;
/// Largest window for unpacking zstd, as a power of 2; `zstd --long` takes 27.
const ZSTD_WINDOW_LOG: u32 = 27;
/// Packed bytes that are fetched in one go.
const FETCHED: usize = 64 * 1024;

type Packed = BufReader<Box<dyn Read + Send>>;

fn packed(stream: Box<dyn Read + Send>) -> Packed {
    BufReader::with_capacity(FETCHED, stream)
}

pub(super) fn gzip(stream: Box<dyn Read + Send>) -> io::Result<Box<dyn Read + Send>> {
    Ok(Box::new(MultiGzDecoder::new(packed(stream))))
}

pub(super) fn xz(stream: Box<dyn Read + Send>) -> io::Result<Box<dyn Read + Send>> {
    let decoder = Stream::new_stream_decoder(XZ_MEMORY, CONCATENATED)?;
    Ok(Box::new(XzDecoder::new_stream(packed(stream), decoder)))
}

pub(super) fn zstd(stream: Box<dyn Read + Send>) -> io::Result<Box<dyn Read + Send>> {
    let mut decoder = zstd::Decoder::with_buffer(packed(stream))?;
    decoder.window_log_max(ZSTD_WINDOW_LOG)?;
    Ok(Box::new(decoder))
}
