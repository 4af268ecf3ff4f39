//! Addresses that a SubDevice with Ethernet ports of its own gets by EoE: `eoe = { ip = "…" }` of a start-up
//! command.

use linesman_proto::ethernet::MacAddress;
use linesman_proto::mailbox::eoe::{ADDRESS_LEN, IpParameters};
use serde::{Deserialize, Serialize};

/// Addresses; what is not said stays as the device has it.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct EthernetChoice {
    /// Which port of the device, from 0.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(range(max = 15)))]
    pub port: u8,
    /// IP address, such as `192.168.1.11`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ip: Option<String>,
    /// Subnet mask.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<String>,
    /// Where everything else is sent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gateway: Option<String>,
    /// Who knows names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dns: Option<String>,
    /// Hardware address, such as `02:00:00:00:00:11`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mac: Option<String>,
    /// Its own name, at most 31 letters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

impl EthernetChoice {
    /// The addresses as a message carries them.
    ///
    /// # Errors
    /// What makes no sense, in words.
    pub fn parameters(&self) -> Result<Vec<u8>, String> {
        let address = |what: &str, text: &Option<String>| {
            let Some(text) = text else { return Ok(None) };
            let parsed: Result<std::net::Ipv4Addr, _> = text.parse();
            let address = parsed.map_err(|_| {
                format!("eoe: {what} \"{text}\", expected an IPv4 address such as 192.168.1.11")
            })?;
            Ok::<_, String>(Some(address.octets()))
        };
        let parameters = IpParameters {
            mac: self.mac.as_deref().map(mac).transpose()?,
            ip: address("ip", &self.ip)?,
            mask: address("mask", &self.mask)?,
            gateway: address("gateway", &self.gateway)?,
            dns: address("dns", &self.dns)?,
            name: self.name.as_deref().map(name).transpose()?,
        };
        if parameters == IpParameters::default() {
            return Err(
                "eoe: expected at least one of ip, mask, gateway, dns, mac, name".to_owned()
            );
        }
        if let Some(why) = doubt(&parameters) {
            return Err(format!("eoe: {why}"));
        }
        let mut bytes = [0; ADDRESS_LEN];
        let len = parameters.write(&mut bytes).map_err(|error| error.to_string())?;
        Ok(bytes[..len].to_vec())
    }
}

/// Why addresses cannot be meant so (SW-12; S0 L2481-2483); `None` when they can.
#[must_use]
pub fn doubt(parameters: &IpParameters) -> Option<String> {
    let [a, b, c, d] = parameters.ip?;
    let shown = format!("{a}.{b}.{c}.{d}");
    (d == 0).then(|| {
        format!(
            "IP address {shown} ends in .0, which names a network and no device: choose 1 to 254"
        )
    })
}

fn mac(text: &str) -> Result<MacAddress, String> {
    let wrong = || format!("eoe: mac \"{text}\", expected six bytes such as 02:00:00:00:00:11");
    let mut address = [0; 6];
    let mut parts = text.split([':', '-']);
    for byte in &mut address {
        let part = parts.next().filter(|part| part.len() == 2).ok_or_else(wrong)?;
        *byte = u8::from_str_radix(part, 16).map_err(|_| wrong())?;
    }
    match parts.next() {
        None => Ok(MacAddress(address)),
        Some(_) => Err(wrong()),
    }
}

fn name(text: &str) -> Result<[u8; 32], String> {
    let mut name = [0; 32];
    if text.len() >= name.len() {
        return Err(format!("eoe: name \"{text}\" has {} bytes, expected at most 31", text.len()));
    }
    name[..text.len()].copy_from_slice(text.as_bytes());
    Ok(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choice(ip: &str) -> EthernetChoice {
        EthernetChoice { ip: Some(ip.to_owned()), ..EthernetChoice::default() }
    }

    // S0 L2481-2483.
    // proves: SW-12
    #[test]
    fn an_address_that_ends_in_0_is_refused() {
        assert_eq!(choice("192.168.1.11").parameters(), Ok(vec![2, 0, 0, 0, 11, 1, 168, 192]));
        let error = choice("192.168.1.0").parameters().unwrap_err();
        assert!(error.contains("192.168.1.0 ends in .0"), "{error}");
        for wrong in ["", "1.2.3", "1.2.3.256", "host"] {
            assert!(
                choice(wrong).parameters().unwrap_err().contains("expected an IPv4"),
                "{wrong}"
            );
        }
        assert!(EthernetChoice::default().parameters().unwrap_err().contains("at least one"));
        let mac = |mac: &str| EthernetChoice { mac: Some(mac.to_owned()), ..choice("10.0.0.1") };
        assert!(mac("02:00:00:00:00:11").parameters().is_ok());
        for wrong in ["", "02:00", "02:00:00:00:00:11:22", "0x:00:00:00:00:11"] {
            assert!(mac(wrong).parameters().is_err(), "{wrong}");
        }
    }
}
