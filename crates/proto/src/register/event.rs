//! Events: ECAT event request and mask (0x0210, 0x0200), AL event request and masks (0x0220,
//! 0x0204).
//!
//! Reference: S2 2.8. Request and mask have the same bits; what a mask lets through is the AND of
//! the two.

/// Declares a set of event bits over an unsigned integer.
macro_rules! events {
    (
        $(#[$doc:meta])*
        $name:ident($inner:ty), $count:literal SyncManagers from bit $first:literal
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
        pub struct $name(pub $inner);

        impl $name {
            /// No event.
            pub const NONE: Self = Self(0);

            /// The event of SyncManager `index`; none for those that have no bit.
            #[must_use]
            pub const fn sync_manager(index: u16) -> Self {
                Self(if index < $count { 1 << ($first + index) } else { 0 })
            }

            /// From the bytes of the register.
            #[must_use]
            pub const fn from_bytes(bytes: [u8; size_of::<$inner>()]) -> Self {
                Self(<$inner>::from_le_bytes(bytes))
            }

            /// The bytes of the register.
            #[must_use]
            pub const fn to_bytes(self) -> [u8; size_of::<$inner>()] {
                self.0.to_le_bytes()
            }

            /// The register value.
            #[must_use]
            pub const fn value(self) -> $inner {
                self.0
            }

            /// Whether nothing happened.
            #[must_use]
            pub const fn is_empty(self) -> bool {
                self.0 == 0
            }

            /// Whether all of `events` are among these.
            #[must_use]
            pub const fn contains(self, events: Self) -> bool {
                self.0 & events.0 == events.0
            }

            /// These and `events`.
            #[must_use]
            pub const fn with(self, events: Self) -> Self {
                Self(self.0 | events.0)
            }

            /// These without `events`.
            #[must_use]
            pub const fn without(self, events: Self) -> Self {
                Self(self.0 & !events.0)
            }

            /// Those of these that `mask` lets through.
            #[must_use]
            pub const fn masked(self, mask: Self) -> Self {
                Self(self.0 & mask.0)
            }
        }
    };
}

events! {
    /// What a controller reports to the MainDevice, in the event field of passing datagrams and in
    /// 0x0210. In the field of a frame that passed many controllers the bits of all are ORed.
    EcatEvents(u16), 8 SyncManagers from bit 4
}

impl EcatEvents {
    /// A latch input changed. Cleared by reading the latch times.
    pub const DC_LATCH: Self = Self(1 << 0);
    /// DL status changed: a link came or went. Cleared by reading DL status.
    pub const DL_STATUS: Self = Self(1 << 2);
    /// AL status changed. Cleared by reading AL status.
    pub const AL_STATUS: Self = Self(1 << 3);
}

events! {
    /// What a controller reports to the SubDevice's processor, in 0x0220.
    AlEvents(u32), 16 SyncManagers from bit 8
}

impl AlEvents {
    /// The MainDevice wrote AL control. Cleared when the processor reads it.
    pub const AL_CONTROL: Self = Self(1 << 0);
    /// A latch input changed.
    pub const DC_LATCH: Self = Self(1 << 1);
    /// SYNC0 is active.
    pub const SYNC0: Self = Self(1 << 2);
    /// SYNC1 is active.
    pub const SYNC1: Self = Self(1 << 3);
    /// A SyncManager was switched on or off, or a repeat was requested.
    pub const SYNC_MANAGER_ACTIVATION: Self = Self(1 << 4);
    /// An SII command waits for the processor that plays the EEPROM.
    pub const EEPROM_EMULATION: Self = Self(1 << 5);
    /// The process data watchdog expired.
    pub const PROCESS_DATA_WATCHDOG: Self = Self(1 << 6);
    /// SYNC2 is active.
    pub const SYNC2: Self = Self(1 << 24);
    /// SYNC3 is active.
    pub const SYNC3: Self = Self(1 << 25);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::{AL_EVENT_REQUEST, ECAT_EVENT_REQUEST};

    /// The register table and these types number the bits alike.
    // proves: HW-21 partial
    #[test]
    fn bits_agree_with_the_register_table() {
        let ecat = |name: &str| 1u16 << ECAT_EVENT_REQUEST.field(name).unwrap().low;
        let al = |name: &str| 1u32 << AL_EVENT_REQUEST.field(name).unwrap().low;
        assert_eq!(EcatEvents::DC_LATCH.value(), ecat("DC latch"));
        assert_eq!(EcatEvents::DL_STATUS.value(), ecat("DL status"));
        assert_eq!(EcatEvents::AL_STATUS.value(), ecat("AL status"));
        for index in 0..8 {
            let name = format!("SyncManager {index}");
            assert_eq!(EcatEvents::sync_manager(index).value(), ecat(&name));
        }
        let named = [
            (AlEvents::AL_CONTROL, "AL control"),
            (AlEvents::DC_LATCH, "DC latch"),
            (AlEvents::SYNC0, "SYNC0"),
            (AlEvents::SYNC1, "SYNC1"),
            (AlEvents::SYNC_MANAGER_ACTIVATION, "SyncManager activation"),
            (AlEvents::EEPROM_EMULATION, "EEPROM emulation"),
            (AlEvents::PROCESS_DATA_WATCHDOG, "process data watchdog"),
            (AlEvents::SYNC2, "SYNC2"),
            (AlEvents::SYNC3, "SYNC3"),
        ];
        for (event, name) in named {
            assert_eq!(event.value(), al(name), "{name}");
        }
        for index in 0..16 {
            let name = format!("SyncManager {index}");
            assert_eq!(AlEvents::sync_manager(index).value(), al(&name));
        }
    }

    #[test]
    fn a_mask_lets_through_what_it_names() {
        let request = EcatEvents::DL_STATUS.with(EcatEvents::sync_manager(1));
        assert_eq!(request.masked(EcatEvents::DL_STATUS), EcatEvents::DL_STATUS);
        assert_eq!(request.without(EcatEvents::DL_STATUS).value(), 0x0020);
        assert!(request.masked(EcatEvents::AL_STATUS).is_empty());
        assert!(EcatEvents::sync_manager(8).is_empty() && AlEvents::sync_manager(16).is_empty());
        assert_eq!(EcatEvents::from_bytes([0x04, 0x00]), EcatEvents::DL_STATUS);
    }
}
