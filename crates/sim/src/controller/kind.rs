//! Properties that all controllers of one kind share: hardware and register rights. A line of
//! thousands holds them once.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use super::implemented::ClockUnits;
use super::memory::Rights;
use crate::hardware::Hardware;

/// A type of controller, ready to be used by any number of controllers. Cloning it shares it.
#[derive(Clone, Debug)]
pub struct ControllerKind(Arc<KindData>);

#[derive(Debug)]
struct KindData {
    hardware: Hardware,
    /// By the units of distributed clocks that are on.
    rights: [OnceLock<Arc<Rights>>; 8],
}

impl ControllerKind {
    /// The rights, while these units are on.
    pub(super) fn rights(&self, units: ClockUnits) -> Arc<Rights> {
        let ClockUnits { time_loop, sync, latch } = units;
        let of_units =
            [time_loop, sync, latch].into_iter().fold(0, |at, on| at << 1 | usize::from(on));
        let rights = || Arc::new(Rights::of(&self.0.hardware, units));
        Arc::clone(self.0.rights[of_units].get_or_init(rights))
    }
}

impl From<Hardware> for ControllerKind {
    fn from(hardware: Hardware) -> Self {
        Self(Arc::new(KindData { hardware, rights: Default::default() }))
    }
}

impl Deref for ControllerKind {
    type Target = Hardware;

    fn deref(&self) -> &Hardware {
        &self.0.hardware
    }
}

/// Kinds that are known already.
#[derive(Clone, Default, Debug)]
pub struct ControllerKinds(Vec<ControllerKind>);

impl ControllerKinds {
    /// The kind that is made of `hardware`: one that was asked for before, if there is one.
    pub fn get(&mut self, hardware: Hardware) -> ControllerKind {
        if let Some(known) = self.0.iter().find(|known| ***known == hardware) {
            return known.clone();
        }
        let kind = ControllerKind::from(hardware);
        self.0.push(kind.clone());
        kind
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::rig;
    use super::*;

    #[test]
    fn what_is_made_of_the_same_is_shared() {
        let mut kinds = ControllerKinds::default();
        let one = kinds.get(rig::hardware());
        let mut other = rig::hardware();
        other.fmmus = 3;
        let other = kinds.get(other);
        assert!(Arc::ptr_eq(&one.0, &kinds.get(rig::hardware()).0));
        assert!(!Arc::ptr_eq(&one.0, &other.0));
        assert_eq!((one.fmmus, other.fmmus), (8, 3));
    }
}
