//! Serving the SubDevices of a line without driving them.

use std::sync::{Arc, Mutex};

use linesman_config::plan::Plan;
use linesman_proto::address::Network;
use linesman_proto::state::{AlState, StateValue};

use crate::exchange::Target;
use crate::executor::{Wire, lock};
use crate::mailbox::{Queues, serve_mailbox};
use crate::options::Options;
use crate::procedure::state;
use crate::supervisor::{Context, Line};

/// SubDevices that are served, and left in their states.
#[derive(Clone, Debug)]
pub(crate) struct Attended {
    pub(crate) plan: Arc<Plan>,
    pub(crate) line: Arc<Mutex<Line>>,
    pub(crate) mailboxes: Queues,
}

impl Attended {
    pub(crate) fn new(wire: &Wire, network: Network, plan: Plan, options: &Arc<Options>) -> Self {
        let plan = Arc::new(plan);
        let with_mailbox = plan.devices.iter().filter(|device| device.mailbox.is_some());
        let attended = Self {
            line: Arc::new(Mutex::new(Line::new(&plan))),
            mailboxes: Queues::of(with_mailbox.clone().map(|device| device.id)),
            plan: Arc::clone(&plan),
        };
        let context = Context {
            wire: wire.clone(),
            network,
            plan: Arc::clone(&plan),
            line: Arc::clone(&attended.line),
            options: Arc::clone(options),
            mailboxes: attended.mailboxes.clone(),
        };
        for device in with_mailbox {
            wire.spawn(serve_mailbox(context.clone(), device.id));
        }
        attended
    }

    /// Looks in which state a SubDevice is: that opens or closes its mailbox.
    pub(crate) async fn look(
        &self,
        wire: &Wire,
        device: &linesman_config::plan::DevicePlan,
    ) -> Option<AlState> {
        let looked = state::read(wire, Target::Station(device.station)).await;
        let found = match looked.map(|(status, _)| status.state()) {
            Ok(StateValue::Known(found)) => Some(found),
            Ok(StateValue::Unknown(_)) | Err(_) => None,
        };
        lock(&self.line).set_moving(device.id, found);
        found
    }
}
