//! Place of a recording that was taken inside the line, at a tap or a probe that adds no record to a frame.

use linesman_config::attachment::Attachment;
use linesman_config::project::Project;
use linesman_diagnosis::Engine;
use linesman_diagnosis::observe::capture_probe::tap::CHANNELS;
use linesman_proto::address::{DeviceId, Network, Path};
use linesman_proto::topology::{End, Tree};
use linesman_runtime::capture::{Capture, CaptureTap, TapPlace};

use crate::failure::Failure;
use crate::output::Output;
use crate::text::quantity::count;

/// Link at which a recording was taken.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct TapArguments {
    /// The capture was taken at this link inside the line, by a tap or a probe that adds no record: 3.B-4.A is the link
    /// from SubDevice 3 to SubDevice 4, maindevice-1.A the first one; by names, K1.B-I1.A, where a project is given. A tap
    /// at several links: once for each INTERFACE, by its name or number
    #[arg(long = "probe", value_name = "[INTERFACE=]LINK")]
    links: Vec<String>,
}

/// Links of a tap.
pub(crate) struct TapLinks {
    channels: Vec<TapLink>,
    places: Vec<TapPlace>,
}

/// A link at which a channel of a tap sits.
struct TapLink {
    /// As it was written.
    text: String,
    upstream: End,
    downstream: End,
    /// SubDevices before it.
    before: u16,
}

impl TapArguments {
    /// True if a place was named.
    pub(crate) fn is_wanted(&self) -> bool {
        !self.links.is_empty()
    }

    /// Refuses a place of what is no capture.
    pub(crate) fn refuse(&self, place: &str, why: &str) -> Result<(), Failure> {
        if !self.is_wanted() {
            return Ok(());
        }
        Err(Failure::new(
            format!("`{place}`: --probe says where a capture was taken, and {why}"),
            "leave out `--probe`",
        ))
    }

    /// The links; `None` where no place was named. Names are those of the project.
    pub(crate) fn links(&self, project: Option<&Project>) -> Result<Option<TapLinks>, Failure> {
        let mut links = TapLinks { channels: Vec::new(), places: Vec::new() };
        for written in &self.links {
            links.add(written, project)?;
        }
        Ok(self.is_wanted().then_some(links))
    }
}

impl TapLinks {
    /// SubDevices before each channel.
    pub(crate) fn before(&self) -> Vec<u16> {
        self.channels.iter().map(|link| link.before).collect()
    }

    /// The same for the reader.
    pub(crate) fn tap(&self) -> CaptureTap {
        CaptureTap::new(self.places.clone())
    }

    fn add(&mut self, written: &str, project: Option<&Project>) -> Result<(), Failure> {
        let (interface, text) = match written.split_once('=') {
            Some((interface, text)) => (Some(interface.to_owned()), text),
            None => (None, written),
        };
        let several = "name each interface once, as in `--probe eth1=3.B-4.A --probe eth2=7.B-8.A`";
        let is_taken = |place: &TapPlace| {
            place.interface == interface || place.interface.is_none() || interface.is_none()
        };
        if self.places.iter().any(is_taken) {
            let reason = format!("--probe {written}: another place was named before it");
            return Err(Failure::new(reason, several));
        }
        let link = TapLink::written(written, text, project)?;
        let is_same = |known: &TapLink| {
            known.upstream == link.upstream && known.downstream == link.downstream
        };
        let channel = match self.channels.iter().position(is_same) {
            Some(channel) => channel,
            None => {
                self.channels.push(link);
                self.channels.len() - 1
            }
        };
        if channel >= usize::from(CHANNELS) {
            let reason = format!("--probe {written}: more than {CHANNELS} links");
            return Err(Failure::new(reason, "judge the recordings of fewer links together"));
        }
        self.places.push(TapPlace { interface, channel: channel as u8 });
        Ok(())
    }

    /// Refuses links that the wiring does not have, as far as it is known.
    pub(crate) fn check_wiring(&self, engine: &Engine) -> Result<(), Failure> {
        let Some(model) = engine.model(Network::default()) else { return Ok(()) };
        let Some(tree) = &model.tree else { return Ok(()) };
        let basis = if model.tree_is_planned { "by the project" } else { "by the capture" };
        self.channels.iter().try_for_each(|link| link.check(tree, basis))
    }

    /// Refuses what the whole recording contradicts.
    fn check(&self, engine: &Engine, capture: &Capture) -> Result<(), Failure> {
        if let Some(fault) = capture.tap_fault() {
            let step = match self.places.as_slice() {
                [TapPlace { interface: None, .. }] => "leave out `--probe`",
                _ => {
                    "name each interface that recorded, as in `--probe eth1=3.B-4.A`; `linesman capture info` lists them"
                }
            };
            return Err(Failure::new(format!("--probe: {fault}"), step));
        }
        let Some(model) = engine.model(Network::default()) else { return Ok(()) };
        let order = &model.capture_probe.order;
        for (link, channel) in self.channels.iter().zip(0..) {
            let Some(out) = order.port(2 * channel).or_else(|| order.port(2 * channel + 1)) else {
                continue;
            };
            let Some(passed) = out.before().filter(|passed| *passed != link.before) else {
                continue;
            };
            if order.is_back(out.number) {
                continue;
            }
            let reason = format!(
                "--probe {}: broadcasts had passed {} on their way out when they were recorded, and {} before that link",
                link.text,
                count(u64::from(passed), "SubDevice"),
                match link.before {
                    1 => "1 lies".to_owned(),
                    before => format!("{before} lie"),
                }
            );
            let step = format!("name the link that leads to SubDevice {}", passed + 1);
            return Err(Failure::new(reason, step));
        }
        // A wrong number of SubDevices before the tap garbles the wiring, so that is looked at first.
        self.check_wiring(engine)
    }

    /// Refuses what the whole recording of this name contradicts, and warns where nothing can be placed.
    pub(crate) fn check_all(
        &self,
        engine: &Engine,
        capture: &Capture,
        name: &str,
        output: &Output,
    ) -> Result<(), Failure> {
        self.check(engine, capture).map_err(|failure| failure.at(name))?;
        if let Some(unused) = self.unused(engine) {
            output.warn(&unused);
        }
        Ok(())
    }

    /// Reason for which nothing can be placed although a link was named; `None` where frames passed it both ways.
    fn unused(&self, engine: &Engine) -> Option<String> {
        let model = engine.model(Network::default())?;
        let first = self.channels.first()?;
        model.capture_probe.order.is_empty().then(|| {
            format!(
                "--probe {}: no frame was recorded twice, out and back: nothing is placed by it, and the frames are \
                 judged as any others",
                first.text
            )
        })
    }
}

impl TapLink {
    fn written(written: &str, text: &str, project: Option<&Project>) -> Result<Self, Failure> {
        let ends = text.match_indices('-').find_map(|(at, _)| {
            let (from, to) = (text[..at].parse().ok()?, text[at + 1..].parse().ok()?);
            Some((from, to))
        });
        let Some((from, to)): Option<(Attachment, Attachment)> = ends else {
            let reason = format!(
                "--probe {written}: `{text}` is no link; expected both its ends, each with its port: `3.B-4.A` by the \
                 numbers of the SubDevices, `maindevice-1.A`"
            );
            return Err(Failure::new(
                reason,
                "`linesman capture info FILE` shows the wiring with ports",
            ));
        };
        let (from, to) = (end(written, &from, project)?, end(written, &to, project)?);
        let no = |end: End| end.node().map_or(0, |node| node + 1);
        if from == End::MainDevice(Path::B) || to == End::MainDevice(Path::B) {
            let reason = format!(
                "--probe {written}: damage on the link of the second card of a ring is not placed"
            );
            return Err(Failure::new(
                reason,
                "leave out `--probe`: the capture is judged as that of the card",
            ));
        }
        if no(from) == no(to) {
            let reason = format!("--probe {written}: both ends are at one device");
            return Err(Failure::new(reason, "name the ends of one link, as in `3.B-4.A`"));
        }
        // Numbers follow the way of the frames: the end further from the MainDevice has the greater one.
        let (upstream, downstream) = if no(from) < no(to) { (from, to) } else { (to, from) };
        let before = u16::try_from(no(downstream) - 1).unwrap_or(u16::MAX);
        Ok(Self { text: text.to_owned(), upstream, downstream, before })
    }

    fn check(&self, tree: &Tree, basis: &str) -> Result<(), Failure> {
        let failure = |what: String| {
            let reason = format!("--probe {}: there is no such link: {basis}, {what}", self.text);
            Err(Failure::new(reason, "name a link that is there, as in `3.B-4.A`"))
        };
        for end in [self.upstream, self.downstream] {
            if end.node().is_some_and(|node| node >= tree.len()) {
                return failure(format!("the line has {}", count(tree.len() as u64, "SubDevice")));
            }
        }
        match tree.opposite(self.upstream) {
            Some(other) if other == self.downstream => Ok(()),
            Some(other) => failure(format!("{} leads to {}", name(self.upstream), name(other))),
            None => failure(format!("nothing is plugged in at {}", name(self.upstream))),
        }
    }
}

/// An end of a link, by the number of its SubDevice or its name in the project.
fn end(written: &str, end: &Attachment, project: Option<&Project>) -> Result<End, Failure> {
    let (called, port) = match end {
        Attachment::MainDevice(path) => return Ok(End::MainDevice(*path)),
        Attachment::Device { name, port } => (name, *port),
    };
    let mut planned = project.map(|project| project.devices.as_slice()).unwrap_or_default().iter();
    let by_name = planned.position(|device| device.name == *called);
    let by_number = || called.parse().ok().and_then(DeviceId::from_no).map(DeviceId::index);
    if let Some(node) = by_name.or_else(by_number) {
        return Ok(End::Controller(node, port));
    }
    let reason = format!("--probe {written}: no SubDevice is called `{called}`");
    let step = match project {
        Some(_) => "use a name of the project, or the number of the SubDevice as in `3.B-4.A`",
        None => {
            "name SubDevices by their numbers as in `3.B-4.A`; names need a project beside the capture"
        }
    };
    Err(Failure::new(reason, step))
}

fn name(end: End) -> String {
    match end {
        End::MainDevice(path) => Attachment::MainDevice(path).to_string(),
        End::Controller(node, port) => format!("{}.{port}", node + 1),
    }
}
