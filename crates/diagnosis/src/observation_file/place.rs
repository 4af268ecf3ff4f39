//! Checks of what a file refers to, with the lines where it stands.

use linesman_config::attachment::Attachment;
use linesman_config::project::ProjectError;
use linesman_proto::topology::{End, Tree};

use super::value::Date;
use super::{ExchangedPart, ObservationError, ObservationFile, ObservedExchange, Reading};
use crate::model::reported::ExchangePlace;

/// Where the tables of a file begin.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines(Vec<(String, usize)>);

impl Lines {
    /// The headers `[[name]]` of a text, with their lines.
    pub(super) fn of(text: &str) -> Self {
        let header = |line: &str| {
            let name = line.trim().strip_prefix("[[")?.split_once("]]")?.0;
            Some(name.trim().trim_matches('"').to_owned())
        };
        let numbered = text.lines().enumerate();
        Self(numbered.filter_map(|(at, line)| Some((header(line)?, at + 1))).collect())
    }

    /// What a message calls the table `name` with an index, such as ``line 12, device `T1` ``.
    pub(super) fn place(&self, name: &str, index: usize, label: &str) -> String {
        let what = match label {
            "" => format!("{name} {}", index + 1),
            label => format!("{name} `{label}`"),
        };
        match self.0.iter().filter(|(header, _)| header == name).nth(index) {
            Some((_, line)) => format!("line {line}, {what}"),
            None => what,
        }
    }

    /// What is wrong with the wiring, with the line of the device that says so.
    pub(super) fn wiring(&self, names: &[Option<String>], error: ProjectError) -> ObservationError {
        let (name, is_second) = match &error {
            ProjectError::UnknownDevice { device, .. } | ProjectError::NoPort { device, .. } => {
                (device, false)
            }
            ProjectError::NameTwice { name } => (name, true),
            ProjectError::Form(_)
            | ProjectError::TaskTwice { .. }
            | ProjectError::UnknownTask { .. }
            | ProjectError::Value { .. }
            | ProjectError::Wiring(_) => return ObservationError::Wiring(error),
        };
        let mut of_name = names.iter().enumerate().filter(|(_, one)| one.as_ref() == Some(name));
        let found = if is_second { of_name.nth(1) } else { of_name.next() };
        match found {
            Some((index, _)) => ObservationError::Value {
                place: self.place("device", index, name),
                what: error.to_string(),
            },
            None => ObservationError::Wiring(error),
        }
    }
}

/// Seconds that make sense as a time.
fn is_time(seconds: f64) -> bool {
    (0.0..=1e9).contains(&seconds)
}

impl Reading {
    /// Whether anything of it is about the MainDevice.
    pub(super) const fn tells_of_main(&self) -> bool {
        self.maindevice.is_some()
    }
}

impl ObservationFile {
    /// Checks what refers to something else.
    pub(super) fn check(&self, lines: &Lines) -> Result<(), ObservationError> {
        self.check_times(lines)?;
        self.check_readings(lines)?;
        for (index, counter) in self.working_counters.iter().enumerate() {
            let place =
                lines.place("working_counter", index, counter.name.as_deref().unwrap_or(""));
            self.check_named(&place, counter.owners())?;
        }
        let emergencies = self.emergencies.iter().map(|one| ("emergency", &one.device));
        let aborts = self.aborts.iter().map(|one| ("abort", &one.device));
        for (name, all) in
            [("emergency", emergencies.collect::<Vec<_>>()), ("abort", aborts.collect())]
        {
            for (index, (_, device)) in all.into_iter().enumerate() {
                self.check_named(&lines.place(name, index, ""), [device.as_str()])?;
            }
        }
        let tree = self.project().tree().map_err(ObservationError::Wiring)?;
        for (index, exchange) in self.exchanges.iter().enumerate() {
            let what = match self.exchange_places(exchange, &tree) {
                Ok(_) => continue,
                Err(what) => what,
            };
            return Err(ObservationError::Value {
                place: lines.place("exchange", index, ""),
                what,
            });
        }
        Ok(())
    }

    fn check_named<'n>(
        &self,
        place: &str,
        names: impl IntoIterator<Item = &'n str>,
    ) -> Result<(), ObservationError> {
        match names.into_iter().find(|name| self.find(name).is_none()) {
            None => Ok(()),
            Some(name) => Err(ObservationError::Value {
                place: place.to_owned(),
                what: format!("no device is called `{name}`: {}", self.known()),
            }),
        }
    }

    /// Names that there are, for messages.
    fn known(&self) -> String {
        let names: Vec<String> =
            self.devices.iter().take(6).map(|device| format!("`{}`", device.label())).collect();
        let more = if self.devices.len() > names.len() { ", …" } else { "" };
        format!("expected one of {}{more}", names.join(", "))
    }

    fn check_readings(&self, lines: &Lines) -> Result<(), ObservationError> {
        let mut at_device = 0;
        let mut at_counter = 0;
        for reading in &self.readings {
            for device in &reading.devices {
                let label = device.label().unwrap_or_default();
                let place = lines.place("reading.device", at_device, &label);
                at_device += 1;
                let fail = |what| Err(ObservationError::Value { place: place.clone(), what });
                match device.label() {
                    None => {
                        return fail(
                            "it has neither `name` nor `no`: say which device it is".into(),
                        );
                    }
                    Some(label) => self.check_named(&place, [label.as_str()])?,
                }
                if let Err(what) = device.check() {
                    return fail(what);
                }
            }
            for counter in &reading.working_counters {
                let label = counter.name.clone().unwrap_or_default();
                let place = lines.place("reading.working_counter", at_counter, &label);
                at_counter += 1;
                self.check_named(&place, counter.owners())?;
            }
        }
        Ok(())
    }

    /// Times must be of one kind, and rise.
    fn check_times(&self, lines: &Lines) -> Result<(), ObservationError> {
        let events = self.emergencies.iter().map(|one| ("emergency", one.at, one.at_s));
        let aborts = self.aborts.iter().map(|one| ("abort", one.at, one.at_s));
        let readings = self.readings.iter().map(|one| ("reading", one.at, one.at_s));
        let all: Vec<(&str, Option<Date>, Option<f64>)> =
            readings.chain(events).chain(aborts).collect();
        let mut counts = std::collections::BTreeMap::new();
        let uses_dates = all.iter().any(|(_, at, _)| at.is_some()) || self.at.is_some();
        let uses_seconds = all.iter().any(|(_, _, at)| at.is_some()) || self.at_s.is_some();
        let mut last: Option<(Option<Date>, Option<f64>)> = None;
        for (name, at, at_s) in all {
            let index: &mut usize = counts.entry(name).or_default();
            let place = lines.place(name, *index, "");
            *index += 1;
            let fail = |what: String| Err(ObservationError::Value { place: place.clone(), what });
            if (at.is_some() && at_s.is_some()) || (uses_dates && uses_seconds) {
                return fail(
                    "times are given both as `at` and as `at_s`: use one of them in the whole file"
                        .into(),
                );
            }
            if let Some(seconds) = at_s.filter(|seconds| !is_time(*seconds)) {
                return fail(format!("`at_s` is {seconds}: expected seconds from 0 to 1000000000"));
            }
            if name != "reading" {
                continue;
            }
            if at.is_none() && at_s.is_none() {
                return fail(
                    "it says no time: add `at = \"2026-11-20T10:00:00\"`, or `at_s`".into(),
                );
            }
            if let Some((before, before_s)) = last
                && (at.zip(before).is_some_and(|(at, before)| at <= before)
                    || at_s.zip(before_s).is_some_and(|(at, before)| at <= before))
            {
                return fail(
                    "it is not later than the reading before it: give them in order of time".into(),
                );
            }
            last = Some((at, at_s));
        }
        if let Some(seconds) = self.at_s.filter(|seconds| !is_time(*seconds)) {
            let what = format!("{seconds}: expected seconds from 0 to 1000000000");
            return Err(ObservationError::Value { place: "`at_s`".into(), what });
        }
        Ok(())
    }

    /// Where a part was, and where it came to.
    pub(super) fn exchange_places(
        &self,
        exchange: &ObservedExchange,
        tree: &Tree,
    ) -> Result<(ExchangePlace, Option<ExchangePlace>), String> {
        let place = |text: &str| {
            match exchange.what {
            ExchangedPart::Cable => self.link(text, tree).map(ExchangePlace::Link).ok_or_else(|| {
                format!("`{text}` is no link of this line: expected both ends, such as `K1.C-K2.A`, or one")
            }),
            ExchangedPart::Device => self
                .find(text)
                .map(|index| ExchangePlace::Device(linesman_proto::address::DeviceId(index as u32)))
                .ok_or_else(|| format!("no device is called `{text}`: {}", self.known())),
            ExchangedPart::Card => Err("a card has no place: leave `at` and `to` out".to_owned()),
        }
        };
        let at = match (&exchange.at, exchange.what) {
            (None, ExchangedPart::Card) => ExchangePlace::Host,
            (None, ExchangedPart::Cable) => {
                return Err("it says no place: add `at` with the link, such as `K1.C-K2.A`".into());
            }
            (None, ExchangedPart::Device) => {
                return Err("it says no place: add `at` with the name of the device".into());
            }
            (Some(at), _) => place(at)?,
        };
        Ok((at, exchange.to.as_deref().map(place).transpose()?))
    }

    /// The link between two ends such as `K1.C-K2.A`, or at one of them. Names may have a hyphen, too.
    fn link(&self, text: &str, tree: &Tree) -> Option<usize> {
        let end = |text: &str| -> Option<End> {
            match text.trim().parse().ok()? {
                Attachment::MainDevice(path) => Some(End::MainDevice(path)),
                Attachment::Device { name, port } => Some(End::Controller(self.find(&name)?, port)),
            }
        };
        let at = |end: End| tree.link_at(end);
        if let Some(one) = end(text) {
            return at(one);
        }
        text.match_indices('-').find_map(|(hyphen, _)| {
            let (one, other) = (end(&text[..hyphen])?, end(&text[hyphen + 1..])?);
            at(one).filter(|link| at(other) == Some(*link))
        })
    }
}
