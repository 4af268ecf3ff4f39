//! Pictures of a line: SubDevices as boxes, links as lines between them, what is wrong marked on the
//! link or box where it is.
//!
//! [`scene`] is what is drawn, [`layout`] where on the paper; [`svg`] draws boxes, [`wire`] links,
//! [`badge`] the names of findings. A drawing is a self-contained SVG, by itself a file, or part of a
//! page.

mod badge;
mod cycle_plot;
mod layout;
mod scene;
mod svg;
pub(crate) mod time_axis;
mod wire;

pub(crate) use cycle_plot::CyclePlot;
pub(crate) use scene::{Label, Mark, Scene, State};
pub(crate) use svg::{NARROW, STYLE, WIDE, draw, file};
