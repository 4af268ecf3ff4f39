//! A whole network: controllers, wires, the cards of the MainDevice.
