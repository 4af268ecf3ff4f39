//! Mailbox gateway of a run, as a project wants it: table `[gateway]`.
//!
//! Reference: ETG.8200. Addresses are text here: whoever opens sockets reads them.

use serde::{Deserialize, Serialize};

/// The gateway by which programs of others reach the mailboxes of SubDevices.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProjectGateway {
    /// Where it listens, by UDP and TCP: an address of the computer that runs the project, with a port or without
    /// (34980 then).
    pub listen: String,
    /// Computers that are served beside that one: `192.168.1.7`, `192.168.1.0/24`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub allow: Vec<String>,
    /// Only uploads of objects and questions about dictionaries are passed on.
    #[serde(default)]
    pub read_only: bool,
}
