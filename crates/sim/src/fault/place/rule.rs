//! Places that a kind of fault allows, and what has to be written for each.

/// Where a kind of fault can be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PlaceRule {
    /// `at`: one link, both directions.
    Link,
    /// `at`: one link, one direction or both.
    Directions,
    /// `at`: one link or a list of links, one direction or both of each.
    ManyDirections,
    /// `at`: one direction of a link.
    Direction,
    /// `device`: one device.
    Device,
    /// `device` or `devices`: what feeds one device or several, and with a coupler the terminals
    /// that it feeds over the E-bus.
    Devices,
    /// `device`: one device that feeds the E-bus, and all that it feeds.
    Feed,
    /// `devices`: two devices.
    Pair,
    /// `device`: one device with a processor.
    Processor,
    /// `device`: one device with a mailbox.
    Mailbox,
    /// `device`: one device; or `at`: a card of the MainDevice, `maindevice` unless said.
    DeviceOrCard,
    /// `at`: a card of the MainDevice, `maindevice` unless said.
    Card,
    /// `at`: one link of a ring, the one that closes it unless said.
    RingLink,
    /// `at`: one direction of a link, the one that leaves card A unless said.
    Entrance,
}

impl PlaceRule {
    /// The keys that say so.
    #[must_use]
    pub const fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Link
            | Self::Directions
            | Self::ManyDirections
            | Self::Direction
            | Self::Card
            | Self::RingLink
            | Self::Entrance => &["at"],
            Self::Device | Self::Feed | Self::Processor | Self::Mailbox => &["device"],
            Self::Pair => &["devices"],
            Self::DeviceOrCard => &["device", "at"],
            Self::Devices => &["device", "devices", "supply"],
        }
    }

    /// Whether something has to be written.
    #[must_use]
    pub const fn needs_place(self) -> bool {
        !matches!(self, Self::Card | Self::DeviceOrCard | Self::RingLink | Self::Entrance)
    }

    /// What has to be written.
    #[must_use]
    pub const fn allowed(self) -> &'static str {
        match self {
            Self::Link => "`at = \"K1.C-B3.A\"`, a link (or one end of it, `K1.C`)",
            Self::Directions => {
                "`at = \"K1.C>B3.A\"`, one direction of a link, or `K1.C-B3.A`, both"
            }
            Self::ManyDirections => {
                "`at = \"K1.C-B3.A\"`, a link (`K1.C>B3.A` for one direction), or a list of them"
            }
            Self::Direction => "`at = \"K1.C>B3.A\"`, one direction of a link",
            Self::Device => "`device = \"B3\"`, a device",
            Self::Feed => "`device = \"K1\"`, a device that feeds the E-bus",
            Self::Pair => "`devices = [\"B3\", \"B4\"]`, two devices",
            Self::Processor => "`device = \"B3\"`, a device with a processor",
            Self::Mailbox => "`device = \"B3\"`, a device with a mailbox",
            Self::DeviceOrCard => "`device = \"B3\"`, a device, or `at = \"maindevice\"`, a card",
            Self::Devices => {
                "`device = \"B3\"`, `devices = [\"B3\", \"B4\"]` or `supply = \"PS1\"`, a `[[supply]]`"
            }
            Self::Card => "`at = \"maindevice\"` (unless said) or `\"maindevice.B\"`, a card",
            Self::RingLink => {
                "`at = \"K1.C-B3.A\"`, a link of a ring; the one that closes it unless said"
            }
            Self::Entrance => {
                "`at = \"K1.C>B3.A\"`, one direction of a link; the one that leaves card A unless said"
            }
        }
    }
}
