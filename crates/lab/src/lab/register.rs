//! Registers of SubDevices, read and written by the MainDevice of the lab beside its cycle.

use linesman_maindevice::{Event, ProbeRequest, Target};
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::time::Span;

use super::Lab;

/// Longer than any frame takes, with its repeats.
const PATIENCE: Span = Span::s(1);
const LOOK: Span = Span::us(10);

impl Lab {
    /// Reads registers of a SubDevice of the project.
    ///
    /// # Errors
    /// In words: it is not of the plan, or did not answer.
    pub fn read_register(
        &mut self,
        id: DeviceId,
        register: RegisterAddress,
        len: u16,
    ) -> Result<Vec<u8>, String> {
        self.access(id, register, len, None)
    }

    /// Writes registers of a SubDevice of the project.
    ///
    /// # Errors
    /// In words: it is not of the plan, or did not answer.
    pub fn write_register(
        &mut self,
        id: DeviceId,
        register: RegisterAddress,
        data: &[u8],
    ) -> Result<(), String> {
        self.access(id, register, data.len() as u16, Some(data.to_vec())).map(drop)
    }

    fn access(
        &mut self,
        id: DeviceId,
        register: RegisterAddress,
        len: u16,
        write: Option<Vec<u8>>,
    ) -> Result<Vec<u8>, String> {
        let device = self.plan.as_ref().and_then(|plan| plan.device(self.in_plan(id)));
        let station = device.map(|device| device.station);
        let station = station.ok_or_else(|| {
            format!("{}: it is not of the plan, and has no address", self.state_of(id))
        })?;
        let request = ProbeRequest { target: Target::Station(station), register, len, write };
        let mark = self.event_mark();
        self.probe(request.clone());
        let answer = |lab: &Self| {
            lab.events_since(mark).find_map(|event| {
                let Event::Probed { request: about, result } = event else { return None };
                (*about == request).then(|| result.clone())
            })
        };
        self.run_while(PATIENCE, LOOK, |lab| answer(lab).is_some())
            .map_err(|error| error.to_string())?;
        match answer(self) {
            Some(Ok(reply)) => Ok(reply.data.into_vec()),
            Some(Err(error)) => Err(format!("{}: {register}: {error}", self.state_of(id))),
            None => Err(format!("{}: {register}: no answer within {PATIENCE}", self.state_of(id))),
        }
    }
}
