//! Reading a SubDevice's EEPROM through its controller, 0x0500 to 0x050F.
//!
//! A command takes the controller some hundred microseconds; all SubDevices are read at once, so
//! that the line is not idle meanwhile. A lost frame may have been executed: what was asked for is
//! told by the address register, which is read along with the data.
//! Reference: S2 2.11; S1 chapter 11.

use linesman_proto::register::{
    SII_ACCESS_ECAT, SII_ADDRESS, SII_CONTROL_STATUS, SII_DATA, SiiCommand, SiiControl,
};
use linesman_proto::sii::word::{
    BOOTSTRAP_MAILBOX, CHECKSUM, LEGACY_DELAYS, PRODUCT_CODE, SERIAL_NUMBER, SIZE, STATION_ALIAS,
    VENDOR_ID,
};
use linesman_proto::sii::{Identity, Image, Reader, SiiError, Size, WordAddress};
use linesman_proto::time::{Instant, Span};

use crate::exchange::{ExchangeError, Reply, Target};
use crate::executor::Wire;

/// Control, address and data lie behind each other: one read brings all.
const ALL_LEN: u16 = SII_DATA.end().0 - SII_CONTROL_STATUS.address.0;
const ADDRESS_AT: usize = (SII_ADDRESS.address.0 - SII_CONTROL_STATUS.address.0) as usize;
const DATA_AT: usize = (SII_DATA.address.0 - SII_CONTROL_STATUS.address.0) as usize;

/// The largest EEPROM that controllers address with two bytes holds 512 KiB.
const LARGEST: usize = 512 << 10;

/// How long a controller may be busy: it may be loading the first words after power-on.
const BUSY_LIMIT: Span = Span::ms(500);
/// Between two looks whether a command is done, at first.
const POLL_AFTER: Span = Span::us(20);
/// Later.
const SLOWEST_POLL: Span = Span::ms(1);
/// How long the SubDevice's processor may keep the EEPROM once it was asked for.
const RELEASE_LIMIT: Span = Span::ms(20);
pub(super) const ATTEMPTS: u32 = 5;
/// An EEPROM that writes does not answer for some milliseconds.
pub(super) const RETRY_AFTER: Span = Span::ms(5);

/// An EEPROM could not be read.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SiiAccessError {
    /// The controller does not answer.
    #[error("EEPROM of {target}: {error}")]
    Exchange {
        /// Whose.
        target: Target,
        /// What failed.
        error: ExchangeError,
    },
    /// The controller stays busy.
    #[error(
        "EEPROM of {target}: still busy at word {word} after {BUSY_LIMIT} (0x0502 = 0x{status:04X}); \
         switch the SubDevice off and on, else replace it"
    )]
    Busy {
        /// Whose.
        target: Target,
        /// Which word was asked for.
        word: WordAddress,
        /// What 0x0502 says.
        status: u16,
    },
    /// The EEPROM does not answer the controller.
    #[error(
        "EEPROM of {target}: word {word} was refused {ATTEMPTS} times (0x0502 = 0x{status:04X}); the \
         EEPROM is missing or damaged"
    )]
    Refused {
        /// Whose.
        target: Target,
        /// Which word was asked for.
        word: WordAddress,
        /// What 0x0502 says.
        status: u16,
    },
    /// A word does not stay as it was written.
    #[error(
        "EEPROM of {target}: word {word} was written {ATTEMPTS} times and is not as it should be \
         (0x0502 = 0x{status:04X}); the EEPROM is protected or damaged"
    )]
    NotWritten {
        /// Whose.
        target: Target,
        /// Which word.
        word: WordAddress,
        /// What 0x0502 says.
        status: u16,
    },
    /// What was read is no image.
    #[error("EEPROM of {target}: {error}")]
    Image {
        /// Whose.
        target: Target,
        /// What is wrong.
        error: SiiError,
    },
}

/// What tells whether two EEPROMs are alike: configuration, identity, size. Read of every SubDevice.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Head {
    /// Words 0 to 15.
    first: Vec<u8>,
    /// Words 0x3C to 0x3F, with size and version.
    size: Vec<u8>,
}

const HEAD_WORDS: u32 = 16;
/// Both mailboxes and the protocols, 0x14 to 0x1F: of what lies between the two parts of the head nothing
/// else means anything to a MainDevice.
const MAILBOX_WORDS: u32 = 12;
/// Of those four words of 16 bits, size is the third.
const SIZE_GROUP: WordAddress = WordAddress(SIZE.0 - 2);

impl Head {
    /// What is equal in the EEPROMs of equal SubDevices: all of it but alias, serial number and the
    /// checksum, which follows from the alias. `None` where vendor or product code is 0: whoever has
    /// no identity is nobody's equal.
    #[must_use]
    pub fn kind(&self) -> Option<Vec<u8>> {
        let number = |word: WordAddress| self.first.get(word.byte()..word.byte() + 4);
        if [VENDOR_ID, PRODUCT_CODE].into_iter().any(|word| number(word) == Some(&[0; 4])) {
            return None;
        }
        let mut kind = self.first.clone();
        for (word, words) in [(STATION_ALIAS, 1), (CHECKSUM, 1), (SERIAL_NUMBER, 2)] {
            if let Some(own) = kind.get_mut(word.byte()..word.byte() + 2 * words) {
                own.fill(0);
            }
        }
        kind.extend_from_slice(&self.size);
        Some(kind)
    }

    /// The image of a SubDevice whose equal has this one.
    ///
    /// # Errors
    /// As [`Image::parse`].
    pub fn image_like(&self, other: &[u8]) -> Result<Image, SiiError> {
        let rest = other.get(self.first.len()..).unwrap_or_default();
        Image::parse(&[self.first.as_slice(), rest].concat())
    }
}

/// Reads what tells of which kind an EEPROM is.
///
/// # Errors
/// [`SiiAccessError`].
pub async fn read_head(wire: &Wire, target: Target) -> Result<Head, SiiAccessError> {
    let mut session = EepromAccess::open(wire, target).await?;
    let read = async {
        let first = session.words(WordAddress(0), HEAD_WORDS).await?;
        let size = session.words(SIZE_GROUP, 4).await?;
        Ok(Head { first, size })
    };
    let outcome = read.await;
    session.close().await;
    outcome
}

/// Reads of an EEPROM behind its head what a plan is made of; gives all of it. What is reserved or its
/// maker's own among the fixed words is left out, and given as zeros: each read takes a controller some
/// 0.7 ms, and a whole line waits for the last.
///
/// The right to the EEPROM is taken from the SubDevice's processor if it has it, and given back.
///
/// # Errors
/// [`SiiAccessError`].
pub async fn read_rest(
    wire: &Wire,
    target: Target,
    head: &Head,
) -> Result<Vec<u8>, SiiAccessError> {
    let mut session = EepromAccess::open(wire, target).await?;
    let mut reader = Reader::new();
    reader.supply(&head.first);
    reader.supply(&[0; BOOTSTRAP_MAILBOX.byte() - LEGACY_DELAYS.byte()]);
    let read = async {
        reader.supply(&session.words(BOOTSTRAP_MAILBOX, MAILBOX_WORDS).await?);
        let has = reader.bytes().len();
        reader.supply(&vec![0; SIZE_GROUP.byte().saturating_sub(has)]);
        reader.supply(&head.size);
        while let Some(words) = reader.needs() {
            let chunk = session.read(words.start).await?;
            reader.supply(&chunk);
        }
        Ok(())
    };
    let outcome: Result<(), SiiAccessError> = read.await;
    session.close().await;
    outcome?;
    Ok(reader.bytes().to_vec())
}

/// Reads an EEPROM as it is: its used part, or as much as its size word says there is.
///
/// # Errors
/// [`SiiAccessError`].
pub async fn read_bytes(
    wire: &Wire,
    target: Target,
    whole: bool,
) -> Result<Vec<u8>, SiiAccessError> {
    let mut session = EepromAccess::open(wire, target).await?;
    let mut reader = Reader::new();
    let read = async {
        while let Some(words) = reader.needs() {
            let chunk = session.read(words.start).await?;
            reader.supply(&chunk);
        }
        let mut bytes = reader.bytes().to_vec();
        let size = bytes.get(SIZE.byte()..SIZE.byte() + 2).and_then(|word| word.first_chunk());
        let all = size.map_or(0, |size| Size(u16::from_le_bytes(*size)).bytes());
        while whole && bytes.len() < all.min(LARGEST) {
            bytes.extend(session.read(WordAddress(bytes.len() as u32 / 2)).await?);
        }
        Ok(bytes)
    };
    let outcome = read.await;
    session.close().await;
    outcome
}

/// Reads who a SubDevice is: words 8 to 15.
///
/// # Errors
/// [`SiiAccessError`].
pub async fn read_identity(wire: &Wire, target: Target) -> Result<Identity, SiiAccessError> {
    let mut session = EepromAccess::open(wire, target).await?;
    let outcome = session.identity().await;
    session.close().await;
    outcome
}

pub(super) struct EepromAccess<'a> {
    pub(super) wire: &'a Wire,
    pub(super) target: Target,
    /// It was the SubDevice's before and is to be given back.
    give_back: bool,
    /// So long a command surely takes, by the one before: it is not asked for earlier.
    sure: Span,
    /// The last command is known to be done, without error.
    pub(super) idle: bool,
}

impl<'a> EepromAccess<'a> {
    pub(super) async fn open(
        wire: &'a Wire,
        target: Target,
    ) -> Result<EepromAccess<'a>, SiiAccessError> {
        let access = SII_ACCESS_ECAT.address;
        let failed = |error| SiiAccessError::Exchange { target, error };
        let owner = wire.read_one(target, access, 2).await.map_err(failed)?;
        let give_back = owner.bytes::<2>(0)[0] & 1 != 0;
        let session = Self { wire, target, give_back, sure: Span::ZERO, idle: false };
        if give_back {
            wire.write_one(target, access, &[0]).await.map_err(failed)?;
        }
        let limit = wire.now() + RELEASE_LIMIT;
        let mut taken = owner;
        while taken.bytes::<2>(0)[1] & 1 != 0 {
            if wire.now() >= limit {
                // Its processor does not let go: bit 1 takes it away.
                wire.write_one(target, access, &[2]).await.map_err(failed)?;
                wire.write_one(target, access, &[0]).await.map_err(failed)?;
                break;
            }
            wire.sleep(POLL_AFTER).await;
            taken = wire.read_one(target, access, 2).await.map_err(failed)?;
        }
        Ok(session)
    }

    pub(super) async fn close(self) {
        if self.give_back {
            // Whoever does not answer now has nothing to be given.
            let _ = self.wire.write_one(self.target, SII_ACCESS_ECAT.address, &[1]).await;
        }
    }

    /// So many words from `start` on.
    async fn words(&mut self, start: WordAddress, count: u32) -> Result<Vec<u8>, SiiAccessError> {
        let len = count as usize * 2;
        let mut bytes = Vec::with_capacity(len);
        while bytes.len() < len {
            let word = WordAddress(start.0 + bytes.len() as u32 / 2);
            let chunk = self.read(word).await?;
            bytes.extend(chunk);
        }
        bytes.truncate(len);
        Ok(bytes)
    }

    async fn identity(&mut self) -> Result<Identity, SiiAccessError> {
        let bytes = self.words(VENDOR_ID, 8).await?;
        let long = |at: usize| {
            let four = bytes.get(at..at + 4).and_then(|slice| slice.first_chunk());
            u32::from_le_bytes(four.copied().unwrap_or_default())
        };
        Ok(Identity {
            vendor_id: long(0),
            product_code: long(4),
            revision: long(8),
            serial_number: long(12),
        })
    }

    /// Four or eight bytes from `word` on.
    pub(super) async fn read(&mut self, word: WordAddress) -> Result<Vec<u8>, SiiAccessError> {
        let mut status = SiiControl::default();
        for attempt in 0..ATTEMPTS {
            if attempt > 0 {
                self.wire.sleep(RETRY_AFTER).await;
            }
            if !std::mem::take(&mut self.idle) {
                let (before, _) = self.idle(word).await?;
                if SiiControl(before.word(0)).command_failed() {
                    self.command(SiiCommand::None, word).await?;
                }
            }
            self.command(SiiCommand::Read, word).await?;
            let began = self.wire.now();
            if self.sure >= POLL_AFTER {
                self.wire.sleep(self.sure).await;
            }
            let (reply, busy_at) = self.idle(word).await?;
            status = SiiControl(reply.word(0));
            let answered = u32::from_le_bytes(reply.bytes(ADDRESS_AT)) == word.value();
            if answered && !status.command_failed() {
                self.sure = match busy_at {
                    Some(at) => at.since(began).min(SLOWEST_POLL),
                    // It was done at the first look: how long ago is not known.
                    None => Span::ns(self.sure.as_nanos() / 8 * 7),
                };
                self.idle = true;
                let end = DATA_AT + status.read_len();
                return Ok(reply.data.get(DATA_AT..end).unwrap_or_default().to_vec());
            }
        }
        let target = self.target;
        Err(SiiAccessError::Refused { target, word, status: status.0 })
    }

    /// Command and address in one datagram. The working counter is not looked at: when the frame
    /// before was lost on its way back, the controller is busy with the command already.
    pub(super) async fn command(
        &self,
        command: SiiCommand,
        word: WordAddress,
    ) -> Result<(), SiiAccessError> {
        let [low, high] = SiiControl::start(command).to_bytes();
        let [a, b, c, d] = word.value().to_le_bytes();
        let bytes = [low, high, a, b, c, d];
        let sent = self.wire.write(self.target, SII_CONTROL_STATUS.address, &bytes).await;
        match sent {
            Ok(_) => Ok(()),
            Err(error) => Err(SiiAccessError::Exchange { target: self.target, error }),
        }
    }

    /// Control, address and data once the controller is no longer busy, and when it was last asked while it
    /// still was.
    pub(super) async fn idle(
        &self,
        word: WordAddress,
    ) -> Result<(Reply, Option<Instant>), SiiAccessError> {
        let target = self.target;
        let limit = self.wire.now() + BUSY_LIMIT;
        let mut pause = POLL_AFTER;
        let mut busy_at = None;
        loop {
            let asked_at = self.wire.now();
            let reply = self
                .wire
                .read_one(target, SII_CONTROL_STATUS.address, ALL_LEN)
                .await
                .map_err(|error| SiiAccessError::Exchange { target, error })?;
            let status = SiiControl(reply.word(0));
            if !status.busy() {
                return Ok((reply, busy_at));
            }
            busy_at = Some(asked_at);
            if self.wire.now() >= limit {
                return Err(SiiAccessError::Busy { target, word, status: status.0 });
            }
            self.wire.sleep(pause).await;
            pause = (pause + Span::ns(pause.as_nanos() / 4)).min(SLOWEST_POLL);
        }
    }
}
