//! Serving the SubDevices of a line without driving them.

use std::sync::{Arc, Mutex};

use linesman_config::plan::Plan;
use linesman_proto::address::Network;

use crate::executor::Wire;
use crate::mailbox::{Queues, serve_mailbox};
use crate::options::Options;
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
            bad_rounds: Arc::default(),
        };
        for device in with_mailbox {
            wire.spawn(serve_mailbox(context.clone(), device.id));
        }
        attended
    }
}
