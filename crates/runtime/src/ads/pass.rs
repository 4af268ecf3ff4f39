//! Requests to SubDevices that have a NetId of their own, passed on through their mailbox (AoE).

use linesman_proto::ads::{AdsAnswer, AdsCode, AdsCommand, AdsRequest, AmsHeader, AmsNetId};

use super::services::{AdsNetwork, AdsOutcome, AdsServices};
use crate::online::report::{OnlineDevice, OnlineReport};
use crate::service::message::{Asked, to_hex};

impl<N: AdsNetwork> AdsServices<'_, N> {
    /// The answer of a SubDevice that has a NetId of its own, asked through its mailbox (AoE).
    ///
    /// # Errors
    /// The code for the AMS header, when nobody has this NetId.
    pub(super) fn pass(
        &self,
        header: &AmsHeader,
        request: &AdsRequest<'_>,
    ) -> AdsOutcome<AdsAnswer> {
        let report = self.network.report().ok_or(AdsCode::MACHINE_NOT_FOUND)?;
        let net_id = header.target.net_id;
        let device = by_net_id(&report, net_id).ok_or(AdsCode::MACHINE_NOT_FOUND)?;
        Ok(self.passed(device, header, request).unwrap_or_else(AdsAnswer::Refused))
    }

    fn passed(
        &self,
        device: &OnlineDevice,
        header: &AmsHeader,
        request: &AdsRequest<'_>,
    ) -> AdsOutcome<AdsAnswer> {
        match request {
            AdsRequest::DeviceInfo | AdsRequest::State | AdsRequest::Read { .. } => {}
            AdsRequest::Write { .. } | AdsRequest::ReadWrite { .. } => self.may_write()?,
            // A notification comes unasked, and nobody would take it to the client.
            AdsRequest::Other(_) => return Err(AdsCode::SERVICE_NOT_SUPPORTED),
        }
        let (command, data) = request.to_bytes();
        let source = header.source;
        let ads = Asked::Ads {
            net_id: Some(header.target.net_id.to_string()),
            port: header.target.port,
            source: Some((source.net_id.to_string(), source.port)),
            command,
            data: to_hex(&data),
        };
        let given = self.mailbox(device, ads)?;
        let command = AdsCommand::from_number(command).ok_or(AdsCode::UNKNOWN_COMMAND)?;
        match command {
            AdsCommand::Read | AdsCommand::ReadWrite => Ok(AdsAnswer::Read(given)),
            AdsCommand::ReadDeviceInfo
            | AdsCommand::Write
            | AdsCommand::ReadState
            | AdsCommand::WriteControl
            | AdsCommand::AddNotification
            | AdsCommand::DeleteNotification
            | AdsCommand::Notification => {
                let whole = [&AdsCode::OK.0.to_le_bytes(), &given[..]].concat();
                AdsAnswer::parse(command, &whole).map_err(|_| AdsCode::GENERAL)
            }
        }
    }
}

/// The SubDevice with this NetId.
pub(super) fn by_net_id(report: &OnlineReport, net_id: AmsNetId) -> Option<&OnlineDevice> {
    let net_id = net_id.to_string();
    report.devices.iter().find(|device| device.net_id.as_ref() == Some(&net_id))
}
