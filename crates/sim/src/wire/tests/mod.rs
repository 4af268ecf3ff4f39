//! The walk against what the topology says of a frame's way: two accounts of the same, one literal
//! and one derived.

mod counting;
mod phy_link;
mod properties;
mod rig;
