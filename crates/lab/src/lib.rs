//! MainDevice, segment and diagnosis in virtual time.
