//! Questions beside another MainDevice: refused before anything is sent where that may do harm, and told of.

use linesman_diagnosis::Engine;
use linesman_diagnosis::ask::{AskRefusal, AskSetup, EndReason, News};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_runtime::question_socket::QuestionSocket;

use crate::failure::Failure;
use crate::output::Output;

/// Questions in a second, unless the user says otherwise.
pub(super) const PER_S: u64 = 20;

/// Makes ready to ask on the one card that is listened on.
pub(super) fn open(
    names: &[String],
    clock: HostClock,
    setup: AskSetup,
) -> Result<QuestionSocket, Failure> {
    match names {
        [name] => Ok(QuestionSocket::open(name, clock, setup)?),
        _ => Err(refused(names, AskRefusal::Ring)),
    }
}

/// Sends what is due, and tells what there is to tell. A refusal ends the command.
pub(super) fn turn(
    asking: &mut QuestionSocket,
    engine: &mut Engine,
    names: &[String],
    output: &Output,
) -> Result<Option<Failure>, LinkError> {
    asking.turn(engine)?;
    let name = names.join("+");
    match asking.poll_news() {
        None | Some(News::Begun(_)) => {}
        Some(News::Again(disturbance)) => {
            output.warn(&format!(
                "listen:{name}: the MainDevice is in trouble that no question was near: {disturbance}; it is asked again \
                 once it has run steadily for a while"
            ));
        }
        Some(News::Ended(EndReason::Refused(refusal))) => return Ok(Some(refused(names, refusal))),
        Some(News::Ended(over)) => {
            output.warn(&format!(
                "listen:{name}: nothing is asked any more: {}; listening goes on",
                over.reason()
            ));
        }
    }
    Ok(None)
}

fn refused(names: &[String], refusal: AskRefusal) -> Failure {
    let name = names.join("+");
    let reason = format!("listen:{name}: nothing is asked: {refusal}");
    Failure::new(reason, refusal.next_step())
}
