//! Choice of whose time the network has, and of the time stamps that bridges and clock terminals exchange.

use linesman_proto::address::DeviceId;
use serde::{Deserialize, Serialize};

use super::{Project, ProjectDevice, ProjectError};
use crate::plan::time_source::{PORT_MULTIPLIER, PTP_TERMINAL, TELL_TIME, TimeSource, is_type};
use crate::profile::DeviceProfile;

/// Whose time the network has.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TimeChoice {
    /// Its reference clock's, which is left to itself.
    ReferenceClock,
    /// That of this computer.
    Host,
    /// One that a program tells.
    Program,
    /// One that a device tells: a bridge to another network, or a terminal for IEEE 1588.
    Device,
    /// That of the network that leads the others of the same run: the start waits for it.
    UpperNetwork,
}

/// The form of the time stamps of a bridge or of a terminal for IEEE 1588.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TimeStampForm {
    /// No time stamps, the status word only.
    None,
    /// 32 bits each.
    Bits32,
    /// 64 bits each.
    Bits64,
}

/// The side of a bridge whose network leads the other.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum SyncLeader {
    /// The side on the E-bus.
    Primary,
    /// The side with sockets for cables.
    Secondary,
}

impl SyncLeader {
    /// What is written to 0x10F5:01.
    #[must_use]
    pub(super) const fn code(self) -> u8 {
        match self {
            Self::Primary => 0,
            Self::Secondary => 1,
        }
    }
}

impl TimeStampForm {
    const fn bits(self) -> u16 {
        match self {
            Self::None => 0,
            Self::Bits32 => 32,
            Self::Bits64 => 64,
        }
    }
}

fn tells_time(device: &ProjectDevice) -> bool {
    TELL_TIME.iter().any(|one| is_type(&device.type_name, one))
}

fn is_port_multiplier(device: &ProjectDevice) -> bool {
    let (name, product) = PORT_MULTIPLIER;
    is_type(&device.type_name, name) || device.product_code == Some(product)
}

impl Project {
    /// The device whose clock outside the network follows, by its place in the project: the one that is named, the only
    /// one that tells a time, or a terminal for IEEE 1588 where nothing else is chosen (DC-19).
    ///
    /// # Errors
    /// In words, where what is chosen is not there or leaves a doubt.
    pub(super) fn time_device(&self) -> Result<Option<usize>, String> {
        let with_time = || self.devices.iter().enumerate().filter(|(_, one)| tells_time(one));
        match (self.network.time_source, &self.network.time_device) {
            (Some(TimeChoice::Device), Some(name)) => {
                let found = self.devices.iter().position(|device| device.name == *name);
                let at = found.ok_or_else(|| {
                    format!("time_device is `{name}`, but no device is called so. Do: write the name of a [[device]]")
                })?;
                Ok(Some(at))
            }
            (Some(TimeChoice::Device), None) => match with_time().collect::<Vec<_>>().as_slice() {
                [(at, _)] => Ok(Some(*at)),
                [] => Err(format!(
                    "time_source is `device`, but none of the devices tells a time outside ({}). Do: name it with \
                     `time_device`, or leave out time_source",
                    TELL_TIME.join(", ")
                )),
                [(_, one), (_, other), ..] => Err(format!(
                    "time_source is `device`, and `{}` and `{}` tell one. Do: name one of them with `time_device`",
                    one.name, other.name
                )),
            },
            (Some(_) | None, Some(_)) => Err(
                "time_device is of no use unless time_source is `device`. Do: write `time_source = \"device\"`"
                    .to_owned(),
            ),
            (Some(_), None) => Ok(None),
            (None, None) => {
                let found = with_time().find(|(_, one)| is_type(&one.type_name, PTP_TERMINAL));
                Ok(found.map(|(at, _)| at))
            }
        }
    }

    /// Whether what is chosen for clocks can work together.
    pub(super) fn check_time(&self) -> Result<(), ProjectError> {
        let refuse = |whose: String, reason: String| Err(ProjectError::Value { whose, reason });
        let outside = match self.time_device() {
            Ok(outside) => outside.and_then(|at| self.devices.get(at)),
            Err(reason) => return refuse("network".to_owned(), reason),
        };
        for device in self.devices.iter().filter(|one| !tells_time(one)) {
            let key = match (device.time_stamps, device.sync_leader) {
                (Some(_), _) => "time_stamps",
                (None, Some(_)) => "sync_leader",
                (None, None) => continue,
            };
            let reason = format!(
                "{key} is for {} only. Do: leave it out, or write its type",
                TELL_TIME.join(", ")
            );
            return refuse(format!("device `{}`", device.name), reason);
        }
        let Some(multiplier) = self.devices.iter().find(|one| is_port_multiplier(one)) else {
            return Ok(());
        };
        if let Some(outside) = outside {
            let reason = format!(
                "its time is to come from outside through `{}`, but the port multiplier `{}` keeps the time of all its \
                 networks: outside synchronisation does not work on top of it. Do: write `time_source = \
                 \"reference-clock\"` in [network] and use `{}` for data only, or synchronise port multipliers with \
                 each other",
                outside.name, multiplier.name, outside.name
            );
            return refuse("network".to_owned(), reason);
        }
        let clocked = self.devices.iter().filter(|one| one.clock.is_some());
        let leads = |one: &ProjectDevice| one.clock.as_ref().is_some_and(|clock| clock.reference);
        if clocked.count() > 0 && !leads(multiplier) {
            let reason = format!(
                "the clock of a port multiplier is the reference clock in each network behind it, and that of `{}` is \
                 not here. Do: write `clock = {{ assign_activate = 0, reference = true }}` at it",
                multiplier.name
            );
            return refuse("network".to_owned(), reason);
        }
        Ok(())
    }

    /// Whose time the network has, for the planner; `places` are those of the devices in processing order.
    pub(super) fn planned_time(&self, places: &[usize]) -> Option<TimeSource> {
        let outside = self.time_device().ok().flatten().and_then(|at| places.get(at));
        match (self.network.time_source, outside) {
            (_, Some(place)) => Some(TimeSource::Device(DeviceId(*place as u32))),
            (Some(TimeChoice::ReferenceClock), None) => Some(TimeSource::ReferenceClock),
            (Some(TimeChoice::Host), None) => Some(TimeSource::Host),
            (Some(TimeChoice::Program), None) => Some(TimeSource::Program),
            (Some(TimeChoice::UpperNetwork), None) => Some(TimeSource::UpperNetwork),
            (Some(TimeChoice::Device) | None, None) => None,
        }
    }

    /// Whether a device whose clock the network follows has what is needed, once its PDOs are chosen.
    ///
    /// # Errors
    /// In words, where it exchanges no time stamps.
    pub(super) fn check_time_stamps(
        &self,
        device: &ProjectDevice,
        profile: &DeviceProfile,
    ) -> Result<(), String> {
        let outside = self.time_device().ok().flatten().and_then(|at| self.devices.get(at));
        if outside == Some(device) && profile.time_stamp_bits().is_none() {
            return Err("the network takes its time from it, but none of its PDOs has time stamps (0x10F4:11 and :12). \
                        Do: leave out `pdos`, or write another time_source in [network]"
                .to_owned());
        }
        Ok(())
    }

    /// The PDOs of a device with the time stamps that are chosen, or that the network needs of it; `None` where they
    /// stay as they are.
    ///
    /// # Errors
    /// In words, where its description has no such PDO.
    pub(super) fn pdos_for_time(
        &self,
        device: &ProjectDevice,
        profile: &DeviceProfile,
    ) -> Result<Option<Vec<u16>>, String> {
        let outside = self.time_device().ok().flatten();
        let is_source = outside.and_then(|at| self.devices.get(at)) == Some(device);
        let has = profile.time_stamp_bits();
        let bits = match device.time_stamps {
            Some(TimeStampForm::None) if is_source => {
                return Err("time_stamps: the network takes its time from it, and needs time stamps. Do: write \
                            `time_stamps = \"bits64\"`, or another time_source in [network]"
                    .to_owned());
            }
            Some(form) => form.bits(),
            None if is_source && device.pdos.is_none() => has.unwrap_or(64),
            None => return Ok(None),
        };
        if has.unwrap_or(0) == bits {
            return Ok(None);
        }
        let wanted = profile.pdos_with_time_stamps(bits);
        let wanted = wanted.ok_or_else(|| {
            format!(
                "time stamps: its description has no PDO with time stamps of {bits} bits (0x10F4:11 and :12). Do: \
                 use another description of it, or another form of `time_stamps`"
            )
        })?;
        Ok(Some(wanted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A project of these devices in a row behind a coupler, with these lines in `[network]`.
    fn project(network: &str, devices: &[(&str, &str, &str)]) -> Result<Project, String> {
        let mut text = format!("[network]\n{network}\n");
        let mut on = "maindevice".to_owned();
        for (name, type_name, more) in devices {
            text += &format!(
                "[[device]]\nname = \"{name}\"\ntype = \"{type_name}\"\non = \"{on}\"\n{more}\n"
            );
            on = format!("{name}.B");
        }
        Project::parse(&text).map_err(|error| error.to_string())
    }

    const COUPLER: (&str, &str, &str) = ("K1", "EK1100", "");
    const MULTIPLIER: (&str, &str, &str) =
        ("M1", "CU2508", "clock = { assign_activate = 0, reference = true }");

    // proves: DC-20
    #[test]
    fn outside_synchronisation_on_top_of_a_port_multiplier_is_refused_with_its_reason() {
        for (network, outside) in [
            ("time_source = \"device\"", "EL6692"),
            ("time_source = \"device\"", "EL6695-0002"),
            // This one sets the mode by being there.
            ("", "EL6688"),
        ] {
            let devices = [MULTIPLIER, COUPLER, ("T1", outside, "")];
            let refused = project(network, &devices).expect_err(outside);
            for part in [
                "network: its time is to come from outside through `T1`",
                "the port multiplier `M1` keeps the time of all its networks",
                "does not work on top of it",
                "Do: write `time_source = \"reference-clock\"`",
            ] {
                assert!(refused.contains(part), "{outside}: {refused}");
            }
            // For data alone it is welcome, and without the port multiplier for its time.
            let for_data = project("time_source = \"reference-clock\"", &devices);
            assert!(for_data.is_ok(), "{for_data:?}");
            assert!(project(network, &devices[1..]).is_ok(), "{outside}");
        }
        // By its product code, whatever it is called.
        let by_code = ("M1", "switch", "product_code = 0x09CC5432");
        let refused = project("", &[by_code, COUPLER, ("T1", "EL6688", "")]);
        assert!(refused.is_err_and(|told| told.contains("port multiplier `M1`")));
    }

    #[test]
    fn port_multiplier_that_is_not_the_reference_clock_is_refused_where_clocks_are_used() {
        let drive = ("D1", "EL7211", "clock = {}");
        let bare = ("M1", "CU2508", "");
        let refused = project("", &[bare, COUPLER, drive]).expect_err("it is not chosen");
        assert!(refused.contains("the reference clock in each network behind it"), "{refused}");
        assert!(
            refused.contains("`clock = { assign_activate = 0, reference = true }`"),
            "{refused}"
        );
        assert!(project("", &[MULTIPLIER, COUPLER, drive]).is_ok());
        assert!(project("", &[bare, COUPLER]).is_ok(), "no clocks, no reference");
    }

    #[test]
    fn device_that_tells_the_time_is_found_by_name_alone_or_by_its_kind() {
        let at = |network: &str, devices: &[(&str, &str, &str)]| {
            project(network, devices).map(|project| project.time_device())
        };
        let (bridge, other, ptp) =
            (("B1", "EL6692", ""), ("B2", "EL6695-0002", ""), ("P1", "EL6688", ""));
        assert_eq!(at("", &[COUPLER, bridge]), Ok(Ok(None)), "a bridge may be there for data");
        assert_eq!(at("", &[COUPLER, bridge, ptp]), Ok(Ok(Some(2))), "it is there for its time");
        assert_eq!(at("time_source = \"host\"", &[COUPLER, ptp]), Ok(Ok(None)));
        let device = "time_source = \"device\"";
        assert_eq!(at(device, &[COUPLER, bridge]), Ok(Ok(Some(1))));
        let named = format!("{device}\ntime_device = \"B2\"");
        assert_eq!(at(&named, &[COUPLER, bridge, other]), Ok(Ok(Some(2))));
        for (network, devices, told) in [
            (device, &[COUPLER][..], "none of the devices tells a time outside"),
            (device, &[COUPLER, bridge, other], "`B1` and `B2` tell one. Do: name one"),
            (&named, &[COUPLER, bridge], "no device is called so. Do: write the name"),
            ("time_device = \"B1\"", &[COUPLER, bridge], "unless time_source is `device`"),
        ] {
            let refused = at(network, devices).expect_err(told);
            assert!(refused.contains(told), "{refused}");
        }
        let misplaced = ("K1", "EK1100", "time_stamps = \"bits64\"");
        let refused = project("", &[misplaced]).expect_err("it has none");
        assert!(refused.contains("device `K1`: time_stamps is for EL6688, EL6692, EL6695 only"));
    }
}
