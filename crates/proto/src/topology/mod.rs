//! Which way a frame goes: tree, check order, delays.
