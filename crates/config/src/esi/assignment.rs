//! PDO assignment of each SyncManager: by default, in an alternative mapping, in an operation mode.
//!
//! Reference: ETG.2000: attribute `Sm` of a PDO, elements `AlternativeSmMapping` and `OpMode/Sm`.

use super::clock::{EsiModePdo, EsiOpMode};
use super::device::{EsiAlternative, EsiDevice};
use super::pdo::EsiPdo;

/// A SyncManager and the PDOs it carries.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Assigned<'a> {
    /// The SyncManager.
    pub sync_manager: u8,
    /// Its PDOs in order, each with how often it is there in each cycle.
    pub pdos: Vec<(&'a EsiPdo, u16)>,
}

impl Assigned<'_> {
    /// What it carries, in bits.
    #[must_use]
    pub fn bits(&self) -> u32 {
        self.pdos.iter().map(|(pdo, times)| pdo.bits() * u32::from(*times)).sum()
    }

    /// The same in whole bytes, as its SyncManager is long.
    #[must_use]
    pub fn bytes(&self) -> u32 {
        self.bits().div_ceil(8)
    }
}

impl EsiDevice {
    /// What each SyncManager carries, by its number. An alternative stands for what the PDOs
    /// themselves say, and an operation mode for both, but each for the SyncManagers only that it
    /// names; a PDO that the device does not have is left out.
    #[must_use]
    pub fn assigned(
        &self,
        alternative: Option<&EsiAlternative>,
        mode: Option<&EsiOpMode>,
    ) -> Vec<Assigned<'_>> {
        let numbers = 0u8..=255;
        let known = |index: u16| self.pdos.iter().find(|pdo| pdo.index == index);
        let listed = |pdos: &mut dyn Iterator<Item = EsiModePdo>| -> Vec<(&EsiPdo, u16)> {
            pdos.filter_map(|one| Some((known(one.index)?, one.times))).collect()
        };
        let of = |number: u8| {
            let by_mode = mode
                .and_then(|mode| mode.sync_managers.iter().find(|one| one.number == number))
                .filter(|one| !one.pdos.is_empty());
            if let Some(named) = by_mode {
                return listed(&mut named.pdos.iter().copied());
            }
            let by_mapping = alternative
                .and_then(|mapping| mapping.assignments.iter().find(|one| one.0 == number));
            if let Some((_, indices)) = by_mapping {
                let once = |index: &u16| EsiModePdo { index: *index, times: 1 };
                return listed(&mut indices.iter().map(once));
            }
            let mine = self.pdos.iter().filter(|pdo| pdo.sync_manager == Some(number));
            mine.map(|pdo| (pdo, 1)).collect()
        };
        numbers
            .map(|sync_manager| Assigned { sync_manager, pdos: of(sync_manager) })
            .filter(|assigned| !assigned.pdos.is_empty())
            .collect()
    }

    /// Its operation mode of this name; its first one without a name.
    #[must_use]
    pub fn op_mode(&self, name: Option<&str>) -> Option<&EsiOpMode> {
        match name {
            Some(name) => self.op_modes.iter().find(|mode| mode.name == name),
            None => self.op_modes.first(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Esi;

    /// Samples of one channel behind a count, and a mapping with a status instead.
    const SAMPLER: &str = r##"<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices>
<Device Physics="YY"><Type ProductCode="1" RevisionNo="1">S</Type><Name>S</Name>
 <Info><VendorSpecific><TwinCAT>
  <AlternativeSmMapping Default="1"><Name>Samples</Name><Sm No="0"><Pdo>#x1B00</Pdo><Pdo>#x1A00</Pdo></Sm></AlternativeSmMapping>
  <AlternativeSmMapping><Name>Status</Name><Sm No="0"><Pdo>#x1A10</Pdo><Pdo>#x1AFF</Pdo></Sm></AlternativeSmMapping>
 </TwinCAT></VendorSpecific></Info>
 <Sm StartAddress="#x1000" ControlByte="#x20" Enable="1">Inputs</Sm>
 <TxPdo Fixed="1" Sm="0"><Index>#x1B00</Index><Name>Count</Name>
  <Entry><Index>#x6800</Index><SubIndex>1</SubIndex><BitLen>16</BitLen><Name>Count</Name><DataType>UINT</DataType></Entry></TxPdo>
 <TxPdo Fixed="1" Sm="0" OSFac="10" OSMin="1" OSMax="100" OSIndexInc="8"><Index>#x1A00</Index><Name>Sample</Name>
  <Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><Name>Value</Name><DataType>BOOL</DataType></Entry></TxPdo>
 <TxPdo Fixed="1"><Index>#x1A10</Index><Name>Status</Name>
  <Entry><Index>#x6100</Index><SubIndex>1</SubIndex><BitLen>8</BitLen><Name>Status</Name><DataType>USINT</DataType></Entry></TxPdo>
 <Dc><OpMode><Name>Free</Name><AssignActivate>0</AssignActivate></OpMode>
  <OpMode><Name>Sync20</Name><AssignActivate>#x0730</AssignActivate><CycleTimeSync0 Factor="-20">0</CycleTimeSync0>
   <Sm No="0"><SyncType>2</SyncType><CycleTime>50000</CycleTime><ShiftTime>-7</ShiftTime><Pdo>#x1B00</Pdo><Pdo OSFac="20">#x1A00</Pdo></Sm></OpMode></Dc>
 <Eeprom><ByteSize>2048</ByteSize><ConfigData>0601</ConfigData></Eeprom></Device>
</Devices></Descriptions></EtherCATInfo>"##;

    #[test]
    fn a_mode_or_a_mapping_says_what_a_sync_manager_carries() {
        let esi = Esi::parse(SAMPLER.as_bytes()).unwrap();
        let device = esi.usable().next().unwrap();
        let sampling = device.pdos[1].oversampling.unwrap();
        assert_eq!((sampling.factor, sampling.least, sampling.most), (10, 1, 100));
        assert_eq!(sampling.index_increment, 8);
        assert_eq!(device.pdos[0].oversampling, None);
        let indices = |alternative: Option<usize>, mode: Option<&str>| {
            let alternative = alternative.map(|at| &device.alternatives[at]);
            let mode = mode.and_then(|name| device.op_mode(Some(name)));
            let assigned = device.assigned(alternative, mode);
            let [only] = &assigned[..] else { panic!("{assigned:?}") };
            assert_eq!(only.sync_manager, 0);
            let pdos: Vec<_> = only.pdos.iter().map(|(pdo, times)| (pdo.index, *times)).collect();
            (pdos, only.bits(), only.bytes())
        };
        let once = vec![(0x1B00, 1), (0x1A00, 1)];
        assert_eq!(indices(None, None), (once.clone(), 17, 3));
        assert_eq!(indices(Some(0), Some("Free")), (once, 17, 3));
        assert_eq!(indices(Some(1), None), (vec![(0x1A10, 1)], 8, 1), "0x1AFF is not there");
        let twenty = vec![(0x1B00, 1), (0x1A00, 20)];
        assert_eq!(indices(Some(1), Some("Sync20")), (twenty, 36, 5));
        let mode = &device.op_modes[1].sync_managers[0];
        assert_eq!(
            (mode.sync_type, mode.cycle_time_ns, mode.shift_time_ns),
            (Some(2), Some(50_000), Some(-7))
        );
        assert_eq!(device.op_mode(None).unwrap().name, "Free");
    }

    #[test]
    fn more_samples_than_there_can_be_are_refused() {
        let text = SAMPLER.replace("OSFac=\"10\"", "OSFac=\"101\"");
        let esi = Esi::parse(text.as_bytes()).unwrap();
        let error = esi.devices[0].as_ref().unwrap_err().to_string();
        assert!(error.contains("OSFac is 101, expected OSMin to OSMax, 1 to 100"), "{error}");
    }
}
