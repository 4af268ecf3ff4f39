//! CoE, the CAN application protocol over EtherCAT: objects, SDO transfer, SDO information,
//! emergencies.
//!
//! [`Message`] is what follows the mailbox header; the codecs serve both ends, MainDevice and
//! SubDevice. Read first: ETG.1000.6, CoE; for object types and entries ETG.1020.

pub mod data_type;
pub mod diagnosis;
pub mod emergency;
pub mod information;
pub mod message;
pub mod object;
pub mod sdo;
pub mod standard_object;
pub mod sync_parameters;
pub mod sync_types;

pub use data_type::DataType;
pub use diagnosis::{DiagnosisMessage, Severity};
pub use emergency::{Emergency, EmergencyClass, ErrorRegister};
pub use message::{COE_HEADER_LEN, CoeError, Header, Message, Service};
pub use object::{ObjectAddress, ObjectIndex};
pub use sync_types::SyncTypes;
