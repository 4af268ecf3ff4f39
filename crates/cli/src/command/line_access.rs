//! Access to a line that is to be driven: check for another MainDevice, the segment of a file, the
//! stop signal.

use std::path::Path;

use linesman_link::input::is_capture_name;
use linesman_runtime::listen::{ObservedTraffic, is_driven};
use linesman_runtime::selector::Selector;
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::{Pace, SegmentTransport};
use linesman_runtime::wiring::Wiring;

use crate::failure::Failure;
use crate::files;
use crate::text::quantity::{count, time};

/// Refuses a line on which EtherCAT frames are heard, or whose card another process has locked.
pub(crate) fn refuse(names: &[String]) -> Result<(), Failure> {
    let name = names.join("+");
    match is_driven(names)? {
        None => Ok(()),
        Some(ObservedTraffic { frames, within, source }) => {
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

/// Refuses a name that can be nothing but a socket where none is: else it were taken for that of a network card.
pub(crate) fn refuse_missing_socket(word: &str) -> Result<(), Failure> {
    let path = Path::new(word);
    if path.extension().is_none_or(|ending| ending != "sock") || path.exists() {
        return Ok(());
    }
    let reason =
        format!("{word}: there is no such socket: the run has ended, or the path is another one");
    Err(Failure::new(reason, format!("`linesman run --on NIC --control {word}` opens one")))
}

/// Refuses what frames cannot be sent to: `word` is what was named.
pub(crate) fn not_drivable(word: &str, selector: &Selector) -> Failure {
    let path = match selector {
        Selector::File(path) => path.as_path(),
        Selector::Cards(_) | Selector::Listen(_) | Selector::Segment(_) => {
            let reason = format!("`{word}`: nothing can be driven there, it is only listened to");
            let card = word.trim_start_matches("listen:");
            let advice =
                format!("`linesman diagnose {word}` listens; to send, name it as `{card}`");
            return Failure::new(reason, advice);
        }
    };
    let is_recording = word.starts_with("capture:") || is_capture_name(word);
    let is_toml = path.extension().is_some_and(|end| end == "toml");
    if !path.exists() && !is_recording && !is_toml {
        let reason = format!("`{word}`: nothing can be driven there: no such file, socket or card");
        let advice = "check the path; cards are listed by `linesman interfaces`; the socket of \
                      `linesman run --control` is there while that runs";
        return Failure::new(reason, advice);
    }
    let reason = format!("`{word}`: nothing can be driven there, it is a file");
    let advice = match is_toml {
        true => format!("name a network card; if it is a virtual segment say `sim:{word}`"),
        false => {
            format!("name a network card; a recording is judged by `linesman diagnose {word}`")
        }
    };
    Failure::new(reason, advice)
}

/// Why nobody answers, with what to check.
pub(crate) fn nobody(error: &dyn std::error::Error) -> Failure {
    nobody_since(&error.to_string())
}

/// The same from the words of an error.
pub(crate) fn nobody_since(why: &str) -> Failure {
    let mut failure = Failure::from_text(why);
    if failure.next_step.is_empty() {
        "check that the first SubDevice is on, that its IN port is wired to this card, and that \
         the card has a link (`linesman interfaces`)"
            .clone_into(&mut failure.next_step);
    }
    failure
}

/// The virtual segment of a file.
pub(crate) fn virtual_line(path: &Path, pace: Pace) -> Result<SegmentTransport, Failure> {
    let ring = files::segment_file(path)?.ring.is_some();
    let plant = files::Plant::open(path)?;
    let wiring = Wiring::of(&plant.segment, &plant.project);
    SegmentTransport::new(plant.segment, wiring, ring, pace).map_err(no_wake_handle)
}

/// The wish to stop.
pub(crate) fn stop() -> Result<Stop, Failure> {
    Stop::on_signals().map_err(no_wake_handle)
}

/// There is no way to be woken.
pub(crate) fn no_wake_handle(error: std::io::Error) -> Failure {
    Failure::new(format!("listening for Ctrl-C: {error}"), "")
}
