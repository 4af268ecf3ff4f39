//! Access to what the engine knows of its networks.

use super::Engine;
use super::network_watch::NetworkWatch;
use crate::model::NetworkModel;
use crate::observe::LatestFrame;
use crate::observe::capture_probe::PortOrder;
use linesman_proto::address::Network;

impl Engine {
    /// Knowledge of a network; `None` before its first frame.
    #[must_use]
    pub fn model(&self, network: Network) -> Option<&NetworkModel> {
        self.watch_of(network).map(|watched| &watched.model)
    }

    /// Latest frame of a network, as far as it was understood; `None` before its first frame.
    #[must_use]
    pub fn latest_frame(&self, network: Network) -> Option<&LatestFrame> {
        self.watch_of(network).map(|watched| &watched.latest)
    }

    /// Ports of the capture probe of a network, as the copies so far tell; `None` before the first one.
    #[must_use]
    pub fn probe_ports(&self, network: Network) -> Option<&PortOrder> {
        self.watch_of(network).map(|watched| watched.capture_probe.order())
    }

    fn watch_of(&self, network: Network) -> Option<&NetworkWatch> {
        self.networks.iter().find(|watched| watched.model.network == network)
    }
}
