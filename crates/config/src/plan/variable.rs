//! Variables of the process image: what the bits are called, and of which type they are.

use linesman_proto::address::DeviceId;
use linesman_proto::sii::Direction;

/// A variable.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Variable {
    /// Whose.
    pub device: DeviceId,
    /// In the outputs or in the inputs.
    pub direction: Direction,
    /// `PDO.Entry`, such as `Channel 1.Value`; unique within the SubDevice and direction only where its
    /// description is careful.
    pub name: String,
    /// Type by its name in ETG.2000 (`BOOL`, `INT`, `UDINT`, …); empty where nothing is said.
    pub data_type: String,
    /// First bit, counted from the begin of the outputs or inputs of the process image.
    pub bit_at: usize,
    /// Bits.
    pub bits: usize,
}
