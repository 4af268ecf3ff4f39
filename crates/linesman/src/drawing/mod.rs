//! Pictures of a line: SubDevices as boxes, links as lines between them, what is wrong marked on the
//! link or box where it is.
//!
//! [`scene`] is what is drawn, [`layout`] where on the paper, [`svg`] with which strokes. A picture
//! is a self-contained SVG, by itself a file, or part of a page.

mod layout;
mod scene;
mod svg;

pub(crate) use scene::{Label, Mark, Scene, State};
pub(crate) use svg::{STYLE, draw, file};
