//! Cables: links with two directions, their noise, and the walk of a frame along them.
