//! Numbers that SubDevices tell, compared with those that are planned at their places: two equal drives that
//! were exchanged are found out, and neither moves (HC-04, HC-14).

use std::collections::BTreeMap;
use std::sync::Arc;

use linesman_config::identity::mismatch;
use linesman_config::plan::{IdentificationCheck, IdentificationSource, Plan};
use linesman_proto::address::DeviceId;
use linesman_proto::sii::Identity;

use super::Context;
use super::group_table::NotTaken;
use super::hot_connect::leave_alone;
use super::locate::FoundController;
use crate::event::Event;
use crate::executor::lock;
use crate::procedure::identification;

/// What each controller of a stretch tells, by the way it was asked.
pub(super) struct Numbers {
    plan: Arc<Plan>,
    told: Vec<BTreeMap<IdentificationSource, Option<u32>>>,
}

impl Numbers {
    /// Asks those that may be a planned SubDevice with a number.
    pub(super) async fn read(
        context: &Context,
        seen: &[FoundController],
        planned: &[DeviceId],
    ) -> Self {
        let plan = Arc::clone(&context.plan);
        let mut reading = Vec::with_capacity(seen.len());
        for one in seen {
            let identity = one.identity.unwrap_or_default();
            let mut sources: Vec<_> = (planned.iter())
                .filter(|id| may_be(&plan, **id, &identity))
                .filter_map(|id| Some(check_of(&plan, *id)?.source))
                .collect();
            sources.sort_unstable();
            sources.dedup();
            let (wire, place) = (context.wire.clone(), one.place);
            let asking = async move {
                let mut told = BTreeMap::new();
                for source in sources {
                    let number = identification::read(&wire, place, source, &identity).await;
                    told.insert(source, number);
                }
                told
            };
            reading.push(context.wire.spawn(asking));
        }
        let mut told = Vec::with_capacity(reading.len());
        for reading in reading {
            told.push(reading.await);
        }
        Self { plan, told }
    }

    /// The number that a controller tells, if it is not the one that is planned: `Some(None)` for none at all.
    pub(super) fn wrong(&self, at: usize, id: DeviceId) -> Option<Option<u32>> {
        let check = check_of(&self.plan, id)?;
        let told = self.told.get(at)?.get(&check.source).copied().flatten();
        (told != Some(check.value)).then_some(told)
    }

    /// True if one that is left over tells the number of a planned SubDevice: then places and numbers contradict
    /// each other.
    pub(super) fn contradict(&self, pairs: &[(usize, usize)], planned: &[DeviceId]) -> bool {
        let is_left_over = |at: &usize| pairs.iter().all(|(paired, _)| paired != at);
        let tells_one = |at: usize| {
            let checks = planned.iter().filter_map(|id| check_of(&self.plan, *id));
            checks.into_iter().any(|check| {
                self.told[at].get(&check.source).copied().flatten() == Some(check.value)
            })
        };
        (0..self.told.len()).filter(is_left_over).any(tells_one)
    }

    /// Whether a controller must not be taken for a planned SubDevice, because it tells another number. That is
    /// told, and it is brought to INIT.
    pub(super) async fn refuses(
        &self,
        context: &Context,
        seen: &FoundController,
        at: usize,
        id: DeviceId,
    ) -> bool {
        let Some(check) = check_of(&self.plan, id) else { return false };
        let Some(found) = self.wrong(at, id) else {
            lock(&context.device_table).groups.accept(id);
            return false;
        };
        if lock(&context.device_table).groups.refuse(id, NotTaken::Number(found)) {
            let identity = seen.identity.unwrap_or_default();
            let owner = found.and_then(|found| {
                self.plan.device_with(&identity, check.source, found).map(|device| device.id)
            });
            context.wire.emit(Event::WrongIdentification { id, check, found, belongs_to: owner });
        }
        if check.compulsory {
            leave_alone(context, std::slice::from_ref(seen)).await;
        }
        check.compulsory
    }
}

fn check_of(plan: &Plan, id: DeviceId) -> Option<IdentificationCheck> {
    // A serial number is part of the identity, and compared with it.
    let check = plan.device(id)?.settings.identification?;
    (check.source != IdentificationSource::Serial).then_some(check)
}

/// Whether a controller is of the type of a planned SubDevice.
fn may_be(plan: &Plan, id: DeviceId, found: &Identity) -> bool {
    let fits = |device: &linesman_config::plan::DevicePlan| {
        mismatch(&device.identity, found, device.revision_rule).is_none()
    };
    plan.device(id).is_some_and(fits)
}
