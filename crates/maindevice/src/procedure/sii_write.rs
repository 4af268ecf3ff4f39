//! Writing a SubDevice's EEPROM through its controller, word by word.
//!
//! A command writes one word and takes some milliseconds. Words that are so already are left alone:
//! that is quicker, and an EEPROM wears out. What was written is read back.
//! Reference: S2 2.11 (write access), S1 chapter 11.

use linesman_proto::register::{SII_DATA, SiiCommand, SiiControl};
use linesman_proto::sii::WordAddress;

use super::sii::{ATTEMPTS, EepromAccess, RETRY_AFTER, SiiAccessError};
use crate::exchange::Target;
use crate::executor::Wire;

/// Writes `data`, two bytes a word, from a word on. Says how many words had been different.
///
/// The right to the EEPROM is taken from the SubDevice's processor if it has it, and given back.
///
/// # Errors
/// [`SiiAccessError`]; words before the one that it names are written.
pub async fn write(
    wire: &Wire,
    target: Target,
    at: WordAddress,
    data: &[u8],
) -> Result<u32, SiiAccessError> {
    let mut session = EepromAccess::open(wire, target).await?;
    let outcome = write_all(&mut session, at, data).await;
    session.close().await;
    outcome
}

async fn write_all(
    session: &mut EepromAccess<'_>,
    at: WordAddress,
    data: &[u8],
) -> Result<u32, SiiAccessError> {
    let mut changed = 0;
    let (words, _) = data.as_chunks::<2>();
    let mut done = 0_usize;
    while let Some(rest) = words.get(done..).filter(|rest| !rest.is_empty()) {
        let first = WordAddress(at.value() + done as u32);
        let there = session.read(first).await?;
        let (there, _) = there.as_chunks::<2>();
        for ((wanted, found), word) in rest.iter().zip(there).zip(first.value()..) {
            if wanted != found {
                session.write(WordAddress(word), *wanted).await?;
                changed += 1;
            }
        }
        done += there.len().clamp(1, rest.len());
    }
    Ok(changed)
}

impl EepromAccess<'_> {
    /// Writes one word, and reads it back.
    async fn write(&mut self, word: WordAddress, value: [u8; 2]) -> Result<(), SiiAccessError> {
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
            let target = self.target;
            self.wire
                .write_one(target, SII_DATA.address, &value)
                .await
                .map_err(|error| SiiAccessError::Exchange { target, error })?;
            self.command(SiiCommand::Write, word).await?;
            let (after, _) = self.idle(word).await?;
            status = SiiControl(after.word(0));
            if !status.command_failed() && self.read(word).await?.first_chunk() == Some(&value) {
                return Ok(());
            }
        }
        Err(SiiAccessError::NotWritten { target: self.target, word, status: status.0 })
    }
}
