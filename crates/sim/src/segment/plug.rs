//! Groups that are plugged in and out while the line runs.
//!
//! Pulling the cable of a device cuts it off with all that hangs behind it; to the ports it is an open
//! link (`link-open` in the truth log, until it is plugged in again). It may be plugged in at another
//! free port: the wiring is another one from then on, and the link is negotiated anew. A hot connect
//! group of the segment file comes off by every cable that leads into it.

use linesman_config::attachment::Attachment;
use linesman_config::fault::FaultName;
use linesman_proto::address::{DeviceId, Path};
use linesman_proto::time::Instant;
use linesman_proto::topology::{End, Tree};

use super::Segment;
use crate::fault::FaultError;
use crate::hardware::PortKind;
use crate::segment_file::FaultEntry;
use crate::truth::FaultId;

/// Why something cannot be plugged in or out.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PlugError {
    /// Nobody is called so.
    #[error("no device or group is called `{name}`, or it is not there")]
    Unknown {
        /// What was given.
        name: String,
    },
    /// It is out already.
    #[error("`{name}` is unplugged already; plug it in first")]
    IsOut {
        /// Which.
        name: String,
    },
    /// It is in.
    #[error("`{name}` is plugged in; unplug it first")]
    IsIn {
        /// Which.
        name: String,
    },
    /// The place does not fit.
    #[error("`{name}` cannot be plugged in at `{on}`: {why}")]
    Place {
        /// Which.
        name: String,
        /// Where.
        on: String,
        /// What does not fit.
        why: String,
    },
    /// Its link cannot be opened.
    #[error(transparent)]
    Fault(#[from] FaultError),
}

impl Segment {
    /// Pulls the cable by which a device hangs on the line, or those of a group. `name` is a device,
    /// or a group as the segment file names it, with or without `group:` before it.
    ///
    /// # Errors
    /// [`PlugError`] when there is no such device or group, or it is out already.
    pub fn unplug(&mut self, now: Instant, name: &str) -> Result<Vec<FaultId>, PlugError> {
        let heads = self.heads(name)?;
        if let Some(out) = heads.iter().find(|head| self.is_out(**head)) {
            return Err(PlugError::IsOut { name: self.name(self.world.id(*out)).to_owned() });
        }
        let mut faults = Vec::new();
        for node in heads {
            let Some(link) = self.tree.link_above(node) else {
                return Err(PlugError::Unknown { name: name.to_owned() });
            };
            let ends = self.tree.links()[link];
            let place =
                format!("{}-{}", self.written(ends.upstream), self.written(ends.downstream));
            let fault = self.inject(now, &FaultEntry::new(FaultName::LinkOpen).at(place))?;
            self.unplugged.insert(node, fault);
            faults.push(fault);
        }
        Ok(faults)
    }

    /// Plugs a device in again: where it was, or at another free port. A group comes in where it was,
    /// or at another port when one cable leads into it.
    ///
    /// # Errors
    /// [`PlugError`] when it is in, or the port is not there, taken, or of another kind.
    pub fn plug(
        &mut self,
        now: Instant,
        name: &str,
        on: Option<&Attachment>,
    ) -> Result<(), PlugError> {
        let heads = self.heads(name)?;
        let out: Vec<usize> = heads.into_iter().filter(|head| self.is_out(*head)).collect();
        match (out.as_slice(), on) {
            ([], _) => return Err(PlugError::IsIn { name: name.to_owned() }),
            ([node], Some(on)) => self.rewire(*node, name, on)?,
            (_, Some(on)) => {
                let why =
                    format!("{} cables lead into it: plug in its devices one by one", out.len());
                return Err(PlugError::Place { name: name.to_owned(), on: on.to_string(), why });
            }
            (_, None) => {}
        }
        for node in out {
            if let Some(fault) = self.unplugged.remove(&node) {
                self.heal(now, fault);
            }
        }
        Ok(())
    }

    /// Whether a cable is out: one whose fault was healed is in again.
    fn is_out(&self, node: usize) -> bool {
        let fault = self.unplugged.get(&node).and_then(|fault| self.truth().fault(*fault));
        fault.is_some_and(|fault| fault.ended.is_none())
    }

    /// Devices by whose cables something hangs on the line: the device itself, or those of a group
    /// that hang on none of the group.
    fn heads(&self, name: &str) -> Result<Vec<usize>, PlugError> {
        let unknown = || PlugError::Unknown { name: name.to_owned() };
        let of_group = if self.names.iter().any(|known| known == name) {
            None
        } else if name.starts_with("group:") {
            Some(self.groups.get(name).ok_or_else(unknown)?)
        } else {
            self.groups.get(&format!("group:{name}"))
        };
        let Some(members) = of_group else { return Ok(vec![self.named(name)?]) };
        let nodes: Vec<usize> = members.iter().filter_map(|id| self.node(*id)).collect();
        let is_inside = |node: usize| {
            self.tree.upstream(node).and_then(End::node).is_some_and(|on| nodes.contains(&on))
        };
        let heads: Vec<usize> = nodes.iter().copied().filter(|node| !is_inside(*node)).collect();
        if heads.is_empty() { Err(unknown()) } else { Ok(heads) }
    }

    fn rewire(&mut self, node: usize, name: &str, on: &Attachment) -> Result<(), PlugError> {
        let wrong = |why: &str| PlugError::Place {
            name: name.to_owned(),
            on: on.to_string(),
            why: why.to_owned(),
        };
        let end = match on {
            Attachment::MainDevice(path) => End::MainDevice(*path),
            Attachment::Device { name, port } => End::Controller(self.named(name)?, *port),
        };
        if self.tree.upstream(node) == Some(end) {
            return Ok(());
        }
        if self.tree.link_at(end).is_some() {
            return Err(wrong("something is plugged in there"));
        }
        let kind = match end {
            End::MainDevice(_) => PortKind::Mii,
            End::Controller(at, port) => {
                if self.tree.is_downstream_of(at, node) || at == node {
                    return Err(wrong("it would hang on itself"));
                }
                self.world.nodes[at].controller.hardware().ports[port]
            }
        };
        let entry = self.tree.entry(node);
        if kind != self.world.nodes[node].controller.hardware().ports[entry] {
            return Err(wrong("no cable fits both ports"));
        }
        let tree = self.tree.wiring().and_then(|mut wired| {
            wired[node].on = end;
            Tree::from_wiring(&wired, self.ring_end())
        });
        let tree = tree.map_err(|error| wrong(&error.to_string()))?;
        if let Some(link) = tree.link_above(node) {
            self.world.rewire(link, end);
        }
        self.tree = tree;
        Ok(())
    }

    fn ring_end(&self) -> Option<(usize, linesman_proto::port::Port)> {
        let ends = self.tree.links().iter();
        let closing = ends.rev().find(|link| link.downstream == End::MainDevice(Path::B))?;
        match closing.upstream {
            End::Controller(node, port) => Some((node, port)),
            End::MainDevice(_) => None,
        }
    }

    fn named(&self, name: &str) -> Result<usize, PlugError> {
        let id = self.names.iter().position(|known| known == name);
        let node = id.and_then(|id| self.node(DeviceId(id as u32)));
        node.ok_or_else(|| PlugError::Unknown { name: name.to_owned() })
    }

    /// An end as files write it.
    fn written(&self, end: End) -> String {
        match end {
            End::MainDevice(path) => Attachment::MainDevice(path).to_string(),
            End::Controller(node, port) => {
                format!("{}.{port}", self.name(self.world.id(node)))
            }
        }
    }
}
