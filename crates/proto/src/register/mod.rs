//! Registers of a controller: one table, and typed views of what is in them.
