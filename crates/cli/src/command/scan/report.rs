//! A scan as JSON, `linesman.scan/1`.

use linesman_config::inventory::{FoundDevice, Inventory};
use linesman_config::plan::reference;
use linesman_diagnosis::report::EndReport;
use linesman_proto::address::DeviceId;
use linesman_proto::port::Port;
use linesman_proto::topology::End;
use serde::Serialize;

use super::against::Against;
use crate::command::ebus::{self, EbusReport};
use crate::version;

/// A scan.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Scan {
    /// `linesman.scan/1`.
    schema: String,
    /// Name and version of the program.
    tool: String,
    /// When it began, RFC 3339; `null` in virtual time.
    start: Option<String>,
    /// How many networks were scanned.
    networks: u32,
    /// The SubDevices, by number.
    devices: Vec<Device>,
    /// Who is fed by whom on the E-bus, and how much is left, as the SII of each says.
    ebus: Vec<EbusReport>,
    /// How that compares with what was planned; `null` without `--against`.
    against: Option<Against>,
}

/// A SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Device {
    /// Its network.
    network: u8,
    /// Its number, from 1.
    no: u32,
    /// Its place in the order of processing, from 0.
    position: u16,
    /// Its station address.
    station: u16,
    /// Its alias; 0 for none.
    alias: u16,
    /// Its name in full, as its SII says.
    name: String,
    /// Its order designation, as its SII says.
    r#type: String,
    /// Vendor; `null` when the SII could not be read.
    vendor_id: Option<u32>,
    /// Product code.
    product_code: Option<u32>,
    /// Revision.
    revision: Option<u32>,
    /// Serial number; 0 for none.
    serial: Option<u32>,
    /// State: `INIT`, `BOOT`, `PREOP`, `SAFEOP`, `OP`.
    al_state: String,
    /// Whether it reports an error.
    al_error: bool,
    /// The AL status code; 0 for none.
    al_code: u16,
    /// Whether it has distributed clocks.
    dc: bool,
    /// Whether its clock can be the reference clock: it has one, and its revision is one from which on its type
    /// can be that.
    reference_clock: bool,
    /// Its ports.
    ports: Vec<PortReport>,
}

/// A port.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct PortReport {
    /// A to D.
    port: char,
    /// Whether there is a link.
    link: bool,
    /// Whether frames leave through it.
    open: bool,
    /// What is at its other end; `null` when nothing is.
    to: Option<EndReport>,
}

/// The report of an inventory.
pub(super) fn report(
    inventory: &Inventory,
    start: Option<String>,
    against: Option<Against>,
) -> Scan {
    Scan {
        schema: "linesman.scan/1".to_owned(),
        tool: version::tool(),
        start,
        networks: 1,
        devices: inventory.devices.iter().map(|found| device(inventory, found)).collect(),
        ebus: ebus::of(inventory.ebus_groups(), |id| inventory.label(id)),
        against,
    }
}

fn device(inventory: &Inventory, found: &FoundDevice) -> Device {
    let identity = found.identity;
    Device {
        network: 0,
        no: found.id.no(),
        position: found.position.value(),
        station: found.station.value(),
        alias: found.alias.value(),
        name: found.profile.name.clone(),
        r#type: found.profile.type_name.clone(),
        vendor_id: identity.map(|identity| identity.vendor_id),
        product_code: identity.map(|identity| identity.product_code),
        revision: identity.map(|identity| identity.revision),
        serial: identity.map(|identity| identity.serial_number),
        al_state: state_name(found),
        al_error: found.al_status.error(),
        // Without the error bit the register may hold what is long over.
        al_code: if found.al_status.error() { found.al_code.value() } else { 0 },
        dc: found.information.features.distributed_clocks(),
        reference_clock: can_be_reference(found),
        ports: ports(found).map(|port| port_report(inventory, found, port)).collect(),
    }
}

/// Whether its clock can be the one that all others follow.
pub(super) fn can_be_reference(found: &FoundDevice) -> bool {
    let revision = found.identity.map_or(0, |identity| identity.revision);
    found.information.features.distributed_clocks()
        && reference::is_possible(&found.profile.type_name, revision)
}

/// The state by name; of a value that is none, the number.
pub(crate) fn state_name(found: &FoundDevice) -> String {
    let value = found.al_status.state();
    value.state().map_or_else(|| format!("0x{:X}", value.bits()), |state| state.name().to_owned())
}

/// The ports that the controller has.
pub(super) fn ports(found: &FoundDevice) -> impl Iterator<Item = Port> {
    found.information.ports.implemented()
}

fn port_report(inventory: &Inventory, found: &FoundDevice, port: Port) -> PortReport {
    let state = found.dl_status.port_state(port);
    PortReport {
        port: port.letter(),
        link: state.link,
        open: !state.closed,
        to: opposite(inventory, found, port),
    }
}

/// What the tree says is at the other end of a port.
fn opposite(inventory: &Inventory, found: &FoundDevice, port: Port) -> Option<EndReport> {
    let end = inventory.tree().opposite(End::Controller(found.id.index(), port))?;
    Some(match end {
        End::MainDevice(path) => EndReport { no: 0, port: path.to_string().chars().next()? },
        End::Controller(node, port) => {
            EndReport { no: DeviceId(node as u32).no(), port: port.letter() }
        }
    })
}
