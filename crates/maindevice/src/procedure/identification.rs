//! Reading the number by which a SubDevice is told apart from its equals (HC-04 to HC-07).
//!
//! Reference: ETG.1020, explicit device identification; S0 L1161-1213.

use linesman_config::plan::IdentificationSource;
use linesman_proto::register::{self, AlControl};
use linesman_proto::sii::Identity;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use super::read_only_scan::{AL_LEN, al_of};
use super::state::{self, Step};
use crate::exchange::Target;
use crate::executor::Wire;

/// How long a SubDevice may take to tell its number, or to enter INIT for that.
const LIMIT: Span = Span::ms(1_000);
/// Between two looks whether it has told it.
const POLL: Span = Span::ms(1);

/// The number that a SubDevice tells; `None` when it does not tell one. To be asked through AL control it is
/// brought to INIT.
pub(crate) async fn read(
    wire: &Wire,
    place: Target,
    source: IdentificationSource,
    identity: &Identity,
) -> Option<u32> {
    let word = match source {
        IdentificationSource::Serial => return Some(identity.serial_number),
        IdentificationSource::AlStatus => return ask(wire, place).await,
        IdentificationSource::Alias => register::STATION_ALIAS.address,
        IdentificationSource::Memory(address) => address,
    };
    let reply = wire.read_one(place, word, 2).await.ok()?;
    reply.answered().then(|| u32::from(reply.word(0)))
}

/// Brings a SubDevice to INIT, where it moves nothing. False when it does not get there.
pub(crate) async fn calm_down(wire: &Wire, place: Target) -> bool {
    let step = Step { to: AlState::Init, limit: LIMIT, emulated: false };
    state::request(wire, place, step).await.is_ok()
}

/// Asks by bit 5 of AL control: the number stands in 0x0134 while bit 5 of AL status is set.
async fn ask(wire: &Wire, place: Target) -> Option<u32> {
    if !calm_down(wire, place).await {
        return None;
    }
    let init = AlControl::request(AlState::Init);
    let asking = init.with_identification_request(true).to_bytes();
    wire.write_one(place, register::AL_CONTROL.address, &asking).await.ok()?;
    let until = wire.now() + LIMIT;
    let number = loop {
        let reply = wire.read_one(place, register::AL_STATUS.address, AL_LEN).await.ok()?;
        let (status, code) = al_of(&reply);
        if status.identification_loaded() && !status.error() {
            break Some(u32::from(code.0));
        }
        if wire.now() >= until {
            break None;
        }
        wire.sleep(POLL).await;
    };
    // Without the bit it goes on as usual; the next request for a state would take it away, too.
    let _ = wire.write_one(place, register::AL_CONTROL.address, &init.to_bytes()).await;
    number
}
