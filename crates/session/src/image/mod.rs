//! Variables of the process image by name and type.
//!
//! `EL2008/1` is the first channel of the SubDevice called EL2008, or of the only one of that type;
//! `Drive/Status` and `EL3204/1/Value` name a PDO, or its number, and an entry of it. A name is
//! resolved once, against the plan, and its type is checked then; in the cycle it is a place.

mod name;
mod value;

use std::marker::PhantomData;

use linesman_config::plan::Plan;
use linesman_proto::sii::Direction;

pub use name::{VariableError, find_device};
pub use value::Value;

/// Where a variable lies.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Place {
    /// First bit, counted from the begin of the outputs or inputs.
    pub(crate) bit_at: usize,
    /// Bits.
    pub(crate) bits: usize,
}

/// An input with the type in which the application sees it.
#[derive(Debug)]
pub struct Input<T> {
    place: Place,
    of: PhantomData<T>,
}

/// An output with the type in which the application sees it.
#[derive(Debug)]
pub struct Output<T> {
    place: Place,
    of: PhantomData<T>,
}

impl<T> Clone for Input<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Input<T> {}

impl<T> Clone for Output<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Output<T> {}

impl<T: Value> Input<T> {
    /// Finds an input by its name.
    ///
    /// # Errors
    /// When the plan has none, or several, or it is of another type.
    pub fn find(plan: &Plan, name: &str) -> Result<Self, VariableError> {
        let place = name::resolve::<T>(plan, Direction::Inputs, name)?;
        Ok(Self { place, of: PhantomData })
    }

    /// Its value.
    #[must_use]
    pub fn get(self, inputs: &[u8]) -> T {
        T::read(inputs, self.place.bit_at, self.place.bits)
    }
}

impl<T: Value> Output<T> {
    /// Finds an output by its name.
    ///
    /// # Errors
    /// When the plan has none, or several, or it is of another type.
    pub fn find(plan: &Plan, name: &str) -> Result<Self, VariableError> {
        let place = name::resolve::<T>(plan, Direction::Outputs, name)?;
        Ok(Self { place, of: PhantomData })
    }

    /// The value that it has in the image.
    #[must_use]
    pub fn get(self, outputs: &[u8]) -> T {
        T::read(outputs, self.place.bit_at, self.place.bits)
    }

    /// Sets it.
    pub fn set(self, outputs: &mut [u8], value: T) {
        value.write(outputs, self.place.bit_at, self.place.bits);
    }
}
