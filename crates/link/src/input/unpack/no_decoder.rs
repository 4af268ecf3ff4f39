//! Packed streams in a build without the feature `packed-input`: refused, with what to do.

use std::io::{self, Read};

fn refused(format: &str) -> io::Result<Box<dyn Read + Send>> {
    let why = format!(
        "it is packed by {format}, and this program was built without the feature `packed-input`: unpack it first"
    );
    Err(io::Error::new(io::ErrorKind::Unsupported, why))
}

pub(super) fn gzip(_: Box<dyn Read + Send>) -> io::Result<Box<dyn Read + Send>> {
    refused("gzip")
}

pub(super) fn xz(_: Box<dyn Read + Send>) -> io::Result<Box<dyn Read + Send>> {
    refused("xz")
}

pub(super) fn zstd(_: Box<dyn Read + Send>) -> io::Result<Box<dyn Read + Send>> {
    refused("zstd")
}
