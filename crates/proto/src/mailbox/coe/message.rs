//! The CoE header and the message behind it.
//!
//! Reference: ETG.1000.6, CoE header. The header is one word: number of the PDO (bits 0..=8, 0 for
//! SDOs) and service (bits 12..=15).

use super::emergency::Emergency;
use super::information;
use super::sdo::{self, Abort};
use crate::mailbox::header::BufferTooSmall;

/// Length of the CoE header in bytes.
pub const COE_HEADER_LEN: usize = 2;

/// The word in front of every CoE message.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Header {
    /// Number of the PDO, 0..=511; 0 for everything else.
    pub number: u16,
    /// What follows.
    pub service: Service,
}

impl Header {
    /// The header in one word.
    #[must_use]
    pub const fn from_word(word: u16) -> Self {
        Self { number: word & 0x01FF, service: Service::from_code((word >> 12) as u8) }
    }

    /// The word. Bits of the number beyond the ninth are cut off.
    #[must_use]
    pub const fn to_word(self) -> u16 {
        self.number & 0x01FF | (self.service.code() as u16) << 12
    }
}

/// What a CoE message is.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Service {
    /// 1: emergency.
    Emergency,
    /// 2: SDO request; also an abort of either side.
    SdoRequest,
    /// 3: SDO response.
    SdoResponse,
    /// 4: TxPDO through the mailbox; rarely implemented.
    TxPdo,
    /// 5: RxPDO through the mailbox; rarely implemented.
    RxPdo,
    /// 6: remote request of a TxPDO; rarely implemented.
    TxPdoRemoteRequest,
    /// 7: remote request of an RxPDO; rarely implemented.
    RxPdoRemoteRequest,
    /// 8: SDO information.
    SdoInformation,
    /// A reserved code: 0, 9..=15.
    Reserved(u8),
}

impl Service {
    /// The service with this code, of which four bits count.
    #[must_use]
    pub const fn from_code(code: u8) -> Self {
        match code & 0x0F {
            1 => Self::Emergency,
            2 => Self::SdoRequest,
            3 => Self::SdoResponse,
            4 => Self::TxPdo,
            5 => Self::RxPdo,
            6 => Self::TxPdoRemoteRequest,
            7 => Self::RxPdoRemoteRequest,
            8 => Self::SdoInformation,
            other => Self::Reserved(other),
        }
    }

    /// The code, 0..=15.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Emergency => 1,
            Self::SdoRequest => 2,
            Self::SdoResponse => 3,
            Self::TxPdo => 4,
            Self::RxPdo => 5,
            Self::TxPdoRemoteRequest => 6,
            Self::RxPdoRemoteRequest => 7,
            Self::SdoInformation => 8,
            Self::Reserved(code) => code & 0x0F,
        }
    }

    /// The name of the specification.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Emergency => "Emergency",
            Self::SdoRequest => "SDO Request",
            Self::SdoResponse => "SDO Response",
            Self::TxPdo => "TxPDO",
            Self::RxPdo => "RxPDO",
            Self::TxPdoRemoteRequest => "TxPDO remote request",
            Self::RxPdoRemoteRequest => "RxPDO remote request",
            Self::SdoInformation => "SDO Information",
            Self::Reserved(_) => "reserved",
        }
    }
}

/// A CoE message: what follows the mailbox header of a message of type CoE.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Message<'a> {
    /// A SubDevice reports an error on its own account.
    Emergency(Emergency),
    /// The MainDevice asks for, or brings, an object's data.
    SdoRequest(sdo::Request<'a>),
    /// The SubDevice answers.
    SdoResponse(sdo::Response<'a>),
    /// Either side ends an SDO transfer.
    Abort(Abort),
    /// Questions about the dictionary, and answers.
    Information(information::Message<'a>),
    /// A PDO through the mailbox, or the request for one.
    Pdo {
        /// Which of the four services.
        service: PdoService,
        /// Number of the PDO, 0..=511.
        number: u16,
        /// Its data; empty in a request.
        data: &'a [u8],
    },
}

/// The services that carry PDOs through the mailbox.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum PdoService {
    /// Inputs.
    Tx,
    /// Outputs.
    Rx,
    /// Request for inputs.
    TxRemoteRequest,
    /// Request for outputs.
    RxRemoteRequest,
}

impl PdoService {
    const fn service(self) -> Service {
        match self {
            Self::Tx => Service::TxPdo,
            Self::Rx => Service::RxPdo,
            Self::TxRemoteRequest => Service::TxPdoRemoteRequest,
            Self::RxRemoteRequest => Service::RxPdoRemoteRequest,
        }
    }
}

impl<'a> Message<'a> {
    /// Reads the data of a mailbox message of type CoE.
    ///
    /// # Errors
    /// [`CoeError`] when they are cut off or of a kind that is not defined.
    pub fn parse(data: &'a [u8]) -> Result<Self, CoeError> {
        let Some((word, body)) = data.split_first_chunk() else {
            let what = "CoE header";
            return Err(CoeError::CutOff { what, needed: COE_HEADER_LEN, len: data.len() });
        };
        let Header { number, service } = Header::from_word(u16::from_le_bytes(*word));
        let pdo = |service| Self::Pdo { service, number, data: body };
        match service {
            Service::Emergency => Emergency::parse(body).map(Self::Emergency),
            // SubDevices abort with the service of a request, as the specification has it; some
            // use that of a response.
            Service::SdoRequest | Service::SdoResponse if Abort::is_meant(body) => {
                Abort::parse(body).map(Self::Abort)
            }
            Service::SdoRequest => sdo::Request::parse(body).map(Self::SdoRequest),
            Service::SdoResponse => sdo::Response::parse(body).map(Self::SdoResponse),
            Service::SdoInformation => information::Message::parse(body).map(Self::Information),
            Service::TxPdo => Ok(pdo(PdoService::Tx)),
            Service::RxPdo => Ok(pdo(PdoService::Rx)),
            Service::TxPdoRemoteRequest => Ok(pdo(PdoService::TxRemoteRequest)),
            Service::RxPdoRemoteRequest => Ok(pdo(PdoService::RxRemoteRequest)),
            Service::Reserved(code) => Err(CoeError::ReservedService { code }),
        }
    }

    /// Writes the data of a mailbox message of type CoE and tells how many bytes that were.
    ///
    /// # Errors
    /// [`BufferTooSmall`] when they do not fit.
    pub fn write(&self, buffer: &mut [u8]) -> Result<usize, BufferTooSmall> {
        let needed = COE_HEADER_LEN;
        let available = buffer.len();
        let Some((word, body)) = buffer.split_first_chunk_mut() else {
            return Err(BufferTooSmall { needed, available });
        };
        *word = self.header().to_word().to_le_bytes();
        let len = match self {
            Self::Emergency(emergency) => emergency.write(body),
            Self::SdoRequest(request) => request.write(body),
            Self::SdoResponse(response) => response.write(body),
            Self::Abort(abort) => abort.write(body),
            Self::Information(message) => message.write(body),
            Self::Pdo { data, .. } => {
                BufferTooSmall::check(body, data.len()).map(|slot| slot.copy_from_slice(data))?;
                Ok(data.len())
            }
        }?;
        Ok(COE_HEADER_LEN + len)
    }

    const fn header(&self) -> Header {
        let (number, service) = match self {
            Self::Emergency(_) => (0, Service::Emergency),
            Self::SdoRequest(_) | Self::Abort(_) => (0, Service::SdoRequest),
            Self::SdoResponse(_) => (0, Service::SdoResponse),
            Self::Information(_) => (0, Service::SdoInformation),
            Self::Pdo { service, number, .. } => (*number, service.service()),
        };
        Header { number, service }
    }
}

/// Why bytes are no CoE message.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum CoeError {
    /// They end too early.
    #[error("{what} needs {needed} bytes, {len} are left")]
    CutOff {
        /// What was being read.
        what: &'static str,
        /// Bytes it needs.
        needed: usize,
        /// Bytes there were.
        len: usize,
    },
    /// The CoE header names a service that is not defined.
    #[error("CoE service {code} is reserved, expected 1..=8")]
    ReservedService {
        /// The code found.
        code: u8,
    },
    /// An SDO command that EtherCAT does not use.
    #[error("SDO {what} with command specifier {specifier}, which EtherCAT does not use")]
    UnknownSpecifier {
        /// "request" or "response".
        what: &'static str,
        /// The three bits found.
        specifier: u8,
    },
    /// An SDO information service that is not defined.
    #[error("SDO information with opcode {opcode}, expected 1..=7")]
    UnknownOpcode {
        /// The seven bits found.
        opcode: u8,
    },
}

impl CoeError {
    /// The first bytes of something that is being read.
    pub(super) fn first<'a, const LEN: usize>(
        bytes: &'a [u8],
        what: &'static str,
    ) -> Result<(&'a [u8; LEN], &'a [u8]), Self> {
        bytes.split_first_chunk().ok_or(Self::CutOff { what, needed: LEN, len: bytes.len() })
    }
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod captures;
