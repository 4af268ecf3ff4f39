//! Random lines: the tree, the route, the derivation and the delays against a literal walk.

mod line;
mod properties;
