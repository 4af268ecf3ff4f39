//! Services for single SubDevices of a line that is scanned and not run.

use std::sync::mpsc::Receiver;

use linesman_config::inventory::Inventory;
use linesman_link::error::LinkError;
use linesman_proto::time::Span;
use linesman_runtime::run::scan::{PATIENCE, scan_with};
use linesman_runtime::service_session::{ServiceSession, service_plan};
use linesman_runtime::stop::Stop;
use linesman_runtime::transport::Transport;

use crate::services::ServiceOrder;
use crate::{DeviceHandle, Error, PendingAnswer, Plan, RequestError, Services};

/// Every step of a service has a limit of its own; a large file takes many of them.
const SERVICE_PATIENCE: Span = Span::s(24 * 3_600);

/// A line whose SubDevices are asked without a run: [`Segment::serve`](crate::Segment::serve).
///
/// SubDevices keep their states, and nothing is written to them that is not asked for but what reading itself takes: their
/// station addresses, the EEPROM interface, their mailboxes. An object needs a mailbox, which a SubDevice has from
/// PREOP on: [`Services::enter`] takes it there.
///
/// ```
/// use linesman::prelude::*;
/// use linesman::{AlState, register};
///
/// # fn ask() -> Result<(), linesman::Error> {
/// let devices = [("K1", "EK1100"), ("Sensor", "EL3104")];
/// let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &devices))?;
/// let mut line = segment.serve()?; // scanned, and left in INIT
/// let sensor = line.device("EL3104")?;
/// let station: u16 =
///     line.ask(|services| services.register_read(sensor, register::STATION_ADDRESS.address))?;
/// assert_eq!(station, 0x1002);
/// line.ask(|services| services.enter(sensor, AlState::PreOp))?;
/// let name: String = line.ask(|services| services.sdo_read(sensor, 0x1008, 0))?;
/// assert_eq!(name, "EL3104");
/// # Ok(())
/// # }
/// # ask().unwrap();
/// ```
pub struct ServedLine<'a> {
    session: ServiceSession<&'a mut dyn Transport<Error = LinkError>>,
    services: Services,
    orders: &'a Receiver<ServiceOrder>,
    stop: &'a Stop,
    inventory: Inventory,
    plan: Plan,
}

impl<'a> ServedLine<'a> {
    pub(crate) fn open(
        transport: &'a mut dyn Transport<Error = LinkError>,
        services: Services,
        orders: &'a Receiver<ServiceOrder>,
        stop: &'a Stop,
    ) -> Result<Self, Error> {
        let mut session = ServiceSession::new(transport, None);
        let inventory = scan_with(&mut session, PATIENCE, stop)?;
        let served = service_plan(&inventory);
        session.serve_only(served.clone());
        Ok(Self { session, services, orders, stop, inventory, plan: served.into() })
    }

    /// The SubDevices that are there.
    #[must_use]
    pub const fn inventory(&self) -> &Inventory {
        &self.inventory
    }

    /// A SubDevice by its name or number, as in [`Plan::device`].
    ///
    /// # Errors
    /// When there is none, or several; the error lists those that there are.
    pub fn device(&self, name: &str) -> Result<DeviceHandle, Error> {
        self.plan.device(name)
    }

    /// All SubDevices with their names, in the order in which frames pass.
    pub fn devices(&self) -> impl Iterator<Item = (DeviceHandle, &str)> {
        self.plan.devices()
    }

    /// Asks for one service and waits for its answer. Requests of other copies of [`Services`] that wait are answered
    /// before it.
    ///
    /// # Errors
    /// When the SubDevice refuses or does not answer, the value has another size, the line is stopped, or its
    /// interface fails.
    pub fn ask<T>(
        &mut self,
        request: impl FnOnce(&Services) -> PendingAnswer<T>,
    ) -> Result<T, Error> {
        let mut pending = request(&self.services);
        for ServiceOrder { device, service, answer } in self.orders.try_iter() {
            let result = if device.plan == self.plan.id() {
                let served = self.session.ask(device.id, service, SERVICE_PATIENCE, self.stop)?;
                served.map_or(Err(RequestError::Ended), |result| Ok(result?))
            } else {
                let (found, running) = (device.plan, self.plan.id());
                Err(RequestError::OtherPlan { found, running })
            };
            // Nobody may wait for it any more.
            let _ = answer.send(result);
        }
        Ok(pending.poll().unwrap_or(Err(RequestError::Ended))?)
    }
}
