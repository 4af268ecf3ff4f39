//! The EtherCAT MainDevice: exchange engine, procedures, cyclic process data.
