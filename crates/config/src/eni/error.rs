//! Errors of a network configuration, with their places.

use crate::esi::EsiError;

/// A network configuration that cannot be used.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum EniError {
    /// Only the tool that wrote it can read it.
    #[error(
        "the network configuration is encrypted: only its tool can read it. Do: export it again without \
         encryption or password"
    )]
    Encrypted,
    /// Something else.
    #[error(
        "line {line}, {root}: no network configuration, expected the outermost element EtherCATConfig \
         (ETG.2100). Do: export the ENI of the network, not the project or a device description"
    )]
    NoEni {
        /// Where it begins.
        line: u32,
        /// Its outermost element.
        root: String,
    },
    /// Nothing in it.
    #[error("the network configuration has no SubDevices (no element Slave). Do: export it again")]
    Empty,
    /// Something in it cannot be read, or contradicts another part of it.
    #[error(transparent)]
    Place(#[from] EsiError),
}
