//! Counts of the ADS server: what was asked, answered and refused.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use linesman_proto::ads::AdsCode;
use serde::{Deserialize, Serialize};

/// Counts since the server was opened.
#[derive(Default, Debug)]
pub(super) struct AdsCounts {
    inner: Mutex<CountedAds>,
}

/// The counts themselves.
#[derive(Clone, Default, Debug)]
pub(super) struct CountedAds {
    pub(super) clients: u64,
    pub(super) requests: u64,
    pub(super) answers: u64,
    /// By reason. The reasons are few: codes that this program gives, and those of connections.
    pub(super) refused: BTreeMap<String, u64>,
}

impl AdsCounts {
    fn change(&self, change: impl FnOnce(&mut CountedAds)) {
        change(&mut self.inner.lock().unwrap_or_else(PoisonError::into_inner));
    }

    pub(super) fn client(&self) {
        self.change(|counts| counts.clients += 1);
    }

    pub(super) fn request(&self) {
        self.change(|counts| counts.requests += 1);
    }

    /// An answer went out, with this code.
    pub(super) fn answer(&self, code: AdsCode) {
        self.change(|counts| counts.answers += 1);
        if code != AdsCode::OK {
            self.refuse(&code.to_string());
        }
    }

    pub(super) fn refuse(&self, why: &str) {
        self.change(|counts| *counts.refused.entry(why.to_owned()).or_default() += 1);
    }

    pub(super) fn now(&self) -> CountedAds {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Messages that went through the ADS server.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AdsReport {
    /// Address at which it listens: `127.0.0.1:48898`.
    pub listen: String,
    /// NetId of the MainDevice: `127.0.0.1.2.1`.
    pub net_id: String,
    /// True if only reading is allowed.
    pub read_only: bool,
    /// Connections so far.
    pub clients: u64,
    /// Messages that came in.
    pub requests: u64,
    /// Messages that went out.
    pub answers: u64,
    /// Answers that say no, by their code (`0x702 invalid index group`), and connections and messages that were not
    /// answered: `not-allowed`, `too-many-connections`, `malformed`. Reasons that did not occur are left out.
    #[serde(default)]
    pub refused: BTreeMap<String, u64>,
}
