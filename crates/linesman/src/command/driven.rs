//! Before a line is driven: does somebody else drive it?

use linesman_runtime::listen::{Driven, is_driven};
use linesman_runtime::stop::Stop;

use crate::failure::Failure;
use crate::text::quantity::{count, time};

/// Refuses a line on which EtherCAT frames are heard.
pub(crate) fn refuse(names: &[String]) -> Result<(), Failure> {
    let name = names.join("+");
    match is_driven(names)? {
        None => Ok(()),
        Some(Driven { frames, within, source }) => {
            let from = source.map(|source| format!(" from {source}")).unwrap_or_default();
            let reason = format!(
                "{name}: another MainDevice drives this line: {}{from} in {}",
                count(frames, "EtherCAT frame"),
                time(within.as_nanos())
            );
            let advice = format!(
                "watch it without sending, `linesman diagnose listen:{name}`, or stop the other \
                 MainDevice first"
            );
            Err(Failure::new(reason, advice))
        }
    }
}

/// Why nobody answers, with what to check.
pub(crate) fn nobody(error: &dyn std::error::Error) -> Failure {
    let mut failure = Failure::from_error(error);
    if failure.next_step.is_empty() {
        "check that the first SubDevice is on, that its IN port is wired to this card, and that \
         the card has a link (`linesman interfaces`)"
            .clone_into(&mut failure.next_step);
    }
    failure
}

/// The wish to stop.
pub(crate) fn stop() -> Result<Stop, Failure> {
    Stop::on_signals().map_err(|error| Failure::new(format!("listening for Ctrl-C: {error}"), ""))
}
