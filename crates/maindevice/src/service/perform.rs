//! Doing a service.

use std::sync::{Arc, Mutex};

use linesman_config::plan::{DevicePlan, Plan};
use linesman_proto::address::DeviceId;

use super::failure::ServiceFailure;
use super::{Service, ServiceAnswer, state};
use crate::exchange::Target;
use crate::executor::Wire;
use crate::mailbox::MailboxQueues;
use crate::procedure;
use crate::supervisor::{self, DeviceTable};

/// Whoever does services.
#[derive(Clone)]
pub(crate) struct ServiceContext {
    pub(crate) wire: Wire,
    pub(crate) plan: Arc<Plan>,
    pub(crate) device_table: Arc<Mutex<DeviceTable>>,
    pub(crate) mailboxes: MailboxQueues,
    /// A plan runs: SubDevices are kept where they shall be, and what is known of them is known to
    /// those who do so.
    pub(crate) driven: bool,
    pub(crate) options: Arc<crate::options::Options>,
}

/// Does a service for a SubDevice.
pub(crate) async fn perform(
    context: &ServiceContext,
    id: DeviceId,
    service: Service,
) -> Result<ServiceAnswer, ServiceFailure> {
    let Some(device) = context.plan.device(id) else {
        return Err(ServiceFailure::Unknown { id });
    };
    let (wire, target) = (&context.wire, Target::Station(device.station));
    match service {
        Service::Mailbox(request) => {
            state::learn(context, device).await;
            Ok(ServiceAnswer::Data(context.mailboxes.ask(id, request).await?))
        }
        Service::State => state::read_state(context, device).await,
        Service::Enter(to) => state::enter(context, device, to).await,
        Service::Acknowledge => state::acknowledge(context, device).await,
        Service::ClearCounters => clear_counters(context, id, target).await,
        Service::ReadRegister { address, len } => {
            let reply = wire.read_one(target, address, len).await;
            reply
                .map(|reply| ServiceAnswer::Data(reply.data.into_vec()))
                .map_err(|error| register(id, error))
        }
        Service::WriteRegister { address, data } => {
            let reply = wire.write_one(target, address, &data).await;
            reply.map(|_| ServiceAnswer::Done).map_err(|error| register(id, error))
        }
        Service::ReadSii { whole } => {
            let bytes = procedure::sii::read_bytes(wire, target, whole).await;
            bytes.map(ServiceAnswer::Data).map_err(|error| ServiceFailure::Sii { id, error })
        }
        Service::WriteSii { at, data } => write_sii(wire, device, at, &data).await,
    }
}

async fn clear_counters(
    context: &ServiceContext,
    id: DeviceId,
    target: Target,
) -> Result<ServiceAnswer, ServiceFailure> {
    let result =
        supervisor::counters::clear(&context.wire, &context.device_table, id, target).await;
    let counters = result.map_err(|error| register(id, error))?;
    Ok(ServiceAnswer::Data(counters.to_bytes().to_vec()))
}

fn register(id: DeviceId, error: crate::exchange::ExchangeError) -> ServiceFailure {
    ServiceFailure::Register { id, error }
}

async fn write_sii(
    wire: &Wire,
    device: &DevicePlan,
    at: linesman_proto::sii::WordAddress,
    data: &[u8],
) -> Result<ServiceAnswer, ServiceFailure> {
    let target = Target::Station(device.station);
    match procedure::sii_write::write(wire, target, at, data).await {
        Ok(words) => Ok(ServiceAnswer::Written { words }),
        Err(error) => Err(ServiceFailure::Sii { id: device.id, error }),
    }
}
