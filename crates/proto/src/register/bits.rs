//! Accessors for the single bits of a register type.

/// For each name a getter and a setter of one bit of the type's number.
macro_rules! bits {
    ($inner:ty; $($(#[doc = $doc:literal])+ $bit:literal $get:ident $with:ident;)+) => {
        $(
            $(#[doc = $doc])+
            #[must_use]
            pub const fn $get(self) -> bool {
                self.0 & (1 << $bit) != 0
            }

            #[doc = concat!("This value with another state of `", stringify!($get), "`.")]
            #[must_use]
            pub const fn $with(self, on: bool) -> Self {
                let bit: $inner = 1 << $bit;
                Self(if on { self.0 | bit } else { self.0 & !bit })
            }
        )+
    };
}

pub(super) use bits;
