//! Exit status of a command, as scripts see it.

use std::process::ExitCode;

/// The exit status of every command.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Status {
    /// 0: healthy; of other commands: done, expectations held.
    Good,
    /// 1: there is, or was, an error or warning finding; an expectation did not hold.
    Findings,
    /// 2: nothing could be judged.
    NotJudged,
    /// 3: too little was seen to say whether the line is healthy.
    Inconclusive,
}

impl From<Status> for ExitCode {
    fn from(status: Status) -> Self {
        Self::from(match status {
            Status::Good => 0,
            Status::Findings => 1,
            Status::NotJudged => 2,
            Status::Inconclusive => 3,
        })
    }
}
