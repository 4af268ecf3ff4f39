//! Process data of a SubDevice as a struct whose fields are variables, found by name.
//!
//! [`inputs!`](crate::inputs) and [`outputs!`](crate::outputs) define one. A macro by rules does: the fields and
//! their names are all there is to know, and a program that uses it compiles no macro crate.

use crate::handle::DeviceHandle;
use crate::io::Io;
use crate::{Error, Plan};

/// InputsOf of a SubDevice, a struct of [`inputs!`](crate::inputs).
pub trait InputRecord: Sized {
    /// A handle for each field.
    type Handles: Copy;

    /// Finds the variables of all fields.
    ///
    /// # Errors
    /// When the SubDevice has no such variable, or it is of another type.
    fn find(plan: &Plan, device: DeviceHandle) -> Result<Self::Handles, Error>;

    /// The values as they are.
    fn read(io: &Io<'_>, handles: Self::Handles) -> Self;
}

/// OutputsOf of a SubDevice, a struct of [`outputs!`](crate::outputs).
pub trait OutputRecord: Sized {
    /// A handle for each field.
    type Handles: Copy;

    /// Finds the variables of all fields.
    ///
    /// # Errors
    /// As [`InputRecord::find`].
    fn find(plan: &Plan, device: DeviceHandle) -> Result<Self::Handles, Error>;

    /// Sets the values.
    fn write(self, io: &mut Io<'_>, handles: Self::Handles);
}

/// Handle of the inputs that an [`InputRecord`] names: [`Plan::inputs`].
#[derive(Debug)]
pub struct InputsOf<R: InputRecord> {
    pub(crate) handles: R::Handles,
}

/// Handle of the outputs that an [`OutputRecord`] names: [`Plan::outputs`].
#[derive(Debug)]
pub struct OutputsOf<R: OutputRecord> {
    pub(crate) handles: R::Handles,
}

impl<R: InputRecord> Clone for InputsOf<R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<R: InputRecord> Copy for InputsOf<R> {}

impl<R: OutputRecord> Clone for OutputsOf<R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<R: OutputRecord> Copy for OutputsOf<R> {}

/// Defines a struct of inputs: each field with its type and the name of its variable in the SubDevice.
///
/// ```
/// linesman::inputs! {
///     /// Feedback of a drive.
///     #[derive(Clone, Copy, Debug)]
///     pub struct Feedback {
///         /// Statusword of CiA 402.
///         pub status: u16 = "Drive inputs/Statusword",
///         pub position: i32 = "Drive inputs/Position actual value",
///     }
/// }
/// ```
#[macro_export]
macro_rules! inputs {
    (
        $(#[$meta:meta])* $see:vis struct $record:ident {
            $($(#[$field_meta:meta])* $field_see:vis $field:ident : $type:ty = $name:expr),+ $(,)?
        }
    ) => {
        $(#[$meta])* $see struct $record {
            $($(#[$field_meta])* $field_see $field: $type),+
        }

        impl $crate::InputRecord for $record {
            type Handles = ($($crate::Input<$type>,)+);

            fn find(
                plan: &$crate::Plan,
                device: $crate::DeviceHandle,
            ) -> ::std::result::Result<Self::Handles, $crate::Error> {
                ::std::result::Result::Ok(($(plan.input_of::<$type>(device, $name)?,)+))
            }

            fn read(io: &$crate::Io<'_>, handles: Self::Handles) -> Self {
                let ($($field,)+) = handles;
                Self { $($field: io.get($field)),+ }
            }
        }
    };
}

/// Defines a struct of outputs: each field with its type and the name of its variable in the SubDevice.
///
/// ```
/// linesman::outputs! {
///     /// Commands to a drive.
///     #[derive(Clone, Copy, Default, Debug)]
///     pub struct Command {
///         pub control: u16 = "Drive outputs/Controlword",
///         pub velocity: i32 = "Drive outputs/Target velocity",
///     }
/// }
/// ```
#[macro_export]
macro_rules! outputs {
    (
        $(#[$meta:meta])* $see:vis struct $record:ident {
            $($(#[$field_meta:meta])* $field_see:vis $field:ident : $type:ty = $name:expr),+ $(,)?
        }
    ) => {
        $(#[$meta])* $see struct $record {
            $($(#[$field_meta])* $field_see $field: $type),+
        }

        impl $crate::OutputRecord for $record {
            type Handles = ($($crate::Output<$type>,)+);

            fn find(
                plan: &$crate::Plan,
                device: $crate::DeviceHandle,
            ) -> ::std::result::Result<Self::Handles, $crate::Error> {
                ::std::result::Result::Ok(($(plan.output_of::<$type>(device, $name)?,)+))
            }

            fn write(self, io: &mut $crate::Io<'_>, handles: Self::Handles) {
                let ($($field,)+) = handles;
                $(io.set($field, self.$field);)+
            }
        }
    };
}
