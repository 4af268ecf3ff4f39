//! SDO information: which objects a SubDevice has, and what each of them is.
//!
//! Questions fit into one message. Answers may come in fragments, whatever they are about, and only
//! the first of them says what it is: so a [`Message`] carries the bytes of its fragment, and the
//! bytes of all fragments together are an [`ObjectList`], an [`ObjectDescription`] or an
//! [`EntryDescription`]. The other way round, [`Fragments`] cuts an answer. Reference: ETG.1000.6,
//! SDO information.

pub mod description;
pub mod list;
pub mod message;

pub use description::{Access, EntryDescription, ObjectCode, ObjectDescription, ValueInfo};
pub use list::{ListKind, ObjectList};
pub use message::{Answer, Body, Fragments, Message};
