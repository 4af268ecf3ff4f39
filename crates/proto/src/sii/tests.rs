//! Images as a whole: properties, oddities, hostile bytes; real ones in [`real_images`].

pub(crate) mod real_images;

mod properties;
mod tolerance;
