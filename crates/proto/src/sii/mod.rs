//! The SII image (the SubDevice's EEPROM): parse and build.
