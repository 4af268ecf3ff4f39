//! Failure of a command to judge anything, and what to do next.

use linesman_link::capture::CaptureError;
use linesman_link::error::LinkError;
use linesman_runtime::bundle::BundleError;
use linesman_runtime::event_log::EventLogError;
use linesman_runtime::part::PartFailure;
use linesman_runtime::selector::SelectorError;
use serde::Serialize;

use crate::version;

/// A command that could not give an answer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Failure {
    /// What went wrong: who, where, doing what, expected, received.
    pub(crate) reason: String,
    /// What to do; empty where there is nothing to advise.
    pub(crate) next_step: String,
}

/// The same as JSON.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ErrorReport {
    /// `linesman.error/1`.
    pub(crate) schema: String,
    /// Name and version of the program.
    pub(crate) tool: String,
    /// What went wrong.
    pub(crate) reason: String,
    /// What to do next; `null` where there is nothing to advise.
    pub(crate) next_step: Option<String>,
}

impl Failure {
    /// A failure with advice.
    pub(crate) fn new(reason: impl Into<String>, next_step: impl Into<String>) -> Self {
        Self { reason: reason.into(), next_step: next_step.into() }
    }

    /// From a text that ends with its advice, as those of all errors of this workspace do: `what is
    /// wrong. Do: what to do`.
    pub(crate) fn from_text(text: &str) -> Self {
        match text.rsplit_once(". Do: ") {
            Some((reason, next_step)) => Self::new(reason, next_step),
            None => Self::new(text, ""),
        }
    }

    /// From an error, by its text.
    pub(crate) fn from_error(error: &dyn std::error::Error) -> Self {
        Self::from_text(&error.to_string())
    }

    /// The same with where it happened in front, unless it is there already.
    pub(crate) fn at(mut self, place: &str) -> Self {
        if !self.reason.starts_with(place) {
            self.reason = format!("{place}: {}", self.reason);
        }
        self
    }

    /// As JSON.
    pub(crate) fn report(&self) -> ErrorReport {
        ErrorReport {
            schema: "linesman.error/1".to_owned(),
            tool: version::tool(),
            reason: self.reason.clone(),
            next_step: (!self.next_step.is_empty()).then(|| self.next_step.clone()),
        }
    }
}

/// Declares which errors become failures by their texts.
macro_rules! failures {
    ($($error:ty),+ $(,)?) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::from_error(&error)
            }
        })+
    };
}

failures!(BundleError, CaptureError, EventLogError, LinkError, PartFailure, SelectorError);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_splits_into_reason_and_advice() {
        let error = LinkError::Down { interface: "eth0".to_owned() };
        let failure = Failure::from(error);
        assert_eq!(failure.reason, "eth0: the interface is down");
        assert_eq!(failure.next_step, "`sudo ip link set eth0 up`");
        let report = serde_json::to_value(failure.report()).unwrap();
        assert_eq!(report["schema"], "linesman.error/1");
        assert_eq!(report["next_step"], "`sudo ip link set eth0 up`");
    }
}
