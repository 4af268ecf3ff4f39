//! A virtual EtherCAT segment: controllers, wires and the ways in which they break.
