//! Services for the SubDevices of a line that is not driven.

use std::sync::{Arc, Mutex};

use linesman_config::plan::Plan;
use linesman_proto::address::Network;

use crate::executor::Wire;
use crate::mailbox::{MailboxQueues, serve_mailbox};
use crate::options::Options;
use crate::supervisor::{Context, DeviceTable};

/// SubDevices that are served, and left in their states.
#[derive(Clone, Debug)]
pub(crate) struct ServiceOnly {
    pub(crate) plan: Arc<Plan>,
    pub(crate) device_table: Arc<Mutex<DeviceTable>>,
    pub(crate) mailboxes: MailboxQueues,
}

impl ServiceOnly {
    pub(crate) fn new(wire: &Wire, network: Network, plan: Plan, options: &Arc<Options>) -> Self {
        let plan = Arc::new(plan);
        let with_mailbox = plan.devices.iter().filter(|device| device.mailbox.is_some());
        let service_only = Self {
            device_table: Arc::new(Mutex::new(DeviceTable::new(&plan))),
            mailboxes: MailboxQueues::of(with_mailbox.clone().map(|device| device.id)),
            plan: Arc::clone(&plan),
        };
        let context = Context {
            wire: wire.clone(),
            network,
            plan: Arc::clone(&plan),
            device_table: Arc::clone(&service_only.device_table),
            options: Arc::clone(options),
            mailboxes: service_only.mailboxes.clone(),
            bad_rounds: Arc::default(),
            follows: None,
        };
        for device in with_mailbox {
            wire.spawn(serve_mailbox(context.clone(), device.id));
        }
        service_only
    }
}
