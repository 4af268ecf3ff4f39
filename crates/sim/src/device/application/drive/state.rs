//! The state machine of a drive: CiA 402 (ETG.6010), finite state automaton of power drive systems.

/// A state of the automaton. "Not ready to switch on" passes before anything can be seen of it.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) enum State {
    /// No power may be switched on.
    #[default]
    SwitchOnDisabled,
    /// Power may be switched on.
    ReadyToSwitchOn,
    /// Power is on, the axis is not driven.
    SwitchedOn,
    /// The axis is driven.
    OperationEnabled,
    /// The axis is being stopped, or was.
    QuickStopActive,
    /// An error was found, the axis is being stopped.
    FaultReactionActive,
    /// An error was found, the axis is not driven.
    Fault,
}

/// What a controlword asks for, but for the reset of a fault.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Request {
    /// Bit 1 is 0.
    DisableVoltage,
    /// Bit 2 is 0.
    QuickStop,
    /// Bit 0 is 0.
    Shutdown,
    /// Bit 3 is 0.
    SwitchOn,
    /// All four are 1.
    EnableOperation,
}

impl Request {
    /// What the lowest bits of a controlword ask for.
    pub(super) const fn of(controlword: u16) -> Self {
        if controlword & 0x02 == 0 {
            Self::DisableVoltage
        } else if controlword & 0x04 == 0 {
            Self::QuickStop
        } else if controlword & 0x01 == 0 {
            Self::Shutdown
        } else if controlword & 0x08 == 0 {
            Self::SwitchOn
        } else {
            Self::EnableOperation
        }
    }
}

impl State {
    /// The state after a request. Faults are left by a reset alone.
    pub(super) const fn after(self, request: Request) -> Self {
        use Request::{DisableVoltage, EnableOperation, QuickStop, Shutdown, SwitchOn};
        match (self, request) {
            (Self::SwitchOnDisabled, Shutdown) => Self::ReadyToSwitchOn,
            (Self::SwitchOnDisabled, DisableVoltage | QuickStop | SwitchOn | EnableOperation) => {
                Self::SwitchOnDisabled
            }
            (Self::ReadyToSwitchOn | Self::SwitchedOn, DisableVoltage | QuickStop)
            | (Self::OperationEnabled | Self::QuickStopActive, DisableVoltage) => {
                Self::SwitchOnDisabled
            }
            (Self::ReadyToSwitchOn | Self::SwitchedOn | Self::OperationEnabled, Shutdown) => {
                Self::ReadyToSwitchOn
            }
            // Both bits at once lead through both states.
            (Self::ReadyToSwitchOn | Self::SwitchedOn | Self::OperationEnabled, SwitchOn)
            | (Self::ReadyToSwitchOn, EnableOperation) => Self::SwitchedOn,
            (Self::SwitchedOn | Self::OperationEnabled, EnableOperation) => Self::OperationEnabled,
            (Self::OperationEnabled | Self::QuickStopActive, QuickStop)
            | (Self::QuickStopActive, Shutdown | SwitchOn) => Self::QuickStopActive,
            (Self::QuickStopActive, EnableOperation) => Self::OperationEnabled,
            (
                Self::FaultReactionActive | Self::Fault,
                DisableVoltage | QuickStop | Shutdown | SwitchOn | EnableOperation,
            ) => self,
        }
    }

    /// Its bits of the statusword.
    pub(super) const fn statusword(self) -> u16 {
        match self {
            Self::SwitchOnDisabled => 0x0040,
            Self::ReadyToSwitchOn => 0x0021,
            Self::SwitchedOn => 0x0023,
            Self::OperationEnabled => 0x0027,
            Self::QuickStopActive => 0x0007,
            Self::FaultReactionActive => 0x000F,
            Self::Fault => 0x0008,
        }
    }

    /// Whether the axis is under power.
    pub(super) const fn is_driven(self) -> bool {
        match self {
            Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive => true,
            Self::SwitchOnDisabled | Self::ReadyToSwitchOn | Self::SwitchedOn | Self::Fault => {
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Request::*;
    use super::State::*;
    use super::*;

    #[test]
    fn every_state_answers_every_request_as_the_profile_has_it() {
        // State; after disable voltage, quick stop, shutdown, switch on, enable operation.
        let table = [
            (
                SwitchOnDisabled,
                [
                    SwitchOnDisabled,
                    SwitchOnDisabled,
                    ReadyToSwitchOn,
                    SwitchOnDisabled,
                    SwitchOnDisabled,
                ],
            ),
            (
                ReadyToSwitchOn,
                [SwitchOnDisabled, SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, SwitchedOn],
            ),
            (
                SwitchedOn,
                [SwitchOnDisabled, SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled],
            ),
            (
                OperationEnabled,
                [SwitchOnDisabled, QuickStopActive, ReadyToSwitchOn, SwitchedOn, OperationEnabled],
            ),
            (
                QuickStopActive,
                [
                    SwitchOnDisabled,
                    QuickStopActive,
                    QuickStopActive,
                    QuickStopActive,
                    OperationEnabled,
                ],
            ),
            (FaultReactionActive, [FaultReactionActive; 5]),
            (Fault, [Fault; 5]),
        ];
        for (state, expected) in table {
            let requests = [DisableVoltage, QuickStop, Shutdown, SwitchOn, EnableOperation];
            assert_eq!(requests.map(|request| state.after(request)), expected, "{state:?}");
        }
    }

    #[test]
    fn controlwords_are_read_as_the_profile_has_it() {
        for (word, request) in [
            (0x0000, DisableVoltage),
            (0x000D, DisableVoltage),
            (0x0002, QuickStop),
            (0x000B, QuickStop),
            (0x0006, Shutdown),
            (0x0007, SwitchOn),
            (0x000F, EnableOperation),
            (0x010F, EnableOperation),
        ] {
            assert_eq!(Request::of(word), request, "{word:#06X}");
        }
    }
}
