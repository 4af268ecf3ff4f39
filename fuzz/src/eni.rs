//! Network configurations of other tools.

use linesman_config::eni::{Eni, EniError, write};

/// Any bytes may be a file. What is wrong is told with its line; what can be read is written so that it
/// reads as the same cyclic exchange.
pub fn eni(data: &[u8]) {
    match Eni::parse(data) {
        Ok(eni) => {
            let _ = eni.plan.doubts();
            let text = write(&eni.name, &eni.plan);
            if let Ok(again) = Eni::parse(text.as_bytes()) {
                assert_eq!(again.plan.outputs_len, eni.plan.outputs_len);
                assert_eq!(again.plan.inputs_len, eni.plan.inputs_len);
                assert_eq!(again.plan.devices.len(), eni.plan.devices.len());
            }
        }
        Err(EniError::Place(error)) => {
            assert!(error.line >= 1 && !error.reason.is_empty(), "{error}");
        }
        Err(EniError::Encrypted | EniError::NoEni { .. } | EniError::Empty) => {}
    }
}
