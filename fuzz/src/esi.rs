//! Device descriptions: read, picked from, made into SII images.

use linesman_config::esi::image::image;
use linesman_config::esi::{Esi, Selection};
use linesman_proto::sii::Image;

/// Any bytes may be a file. What is wrong is told with its line; what can be read makes an image that
/// reads as what the description says.
pub fn esi(data: &[u8]) {
    let esi = match Esi::parse(data) {
        Ok(esi) => esi,
        Err(error) => {
            assert!(error.line >= 1 && !error.reason.is_empty(), "{error}");
            return;
        }
    };
    for name in ["", "P-100", "0x1234@7", "@x"] {
        let _ = Selection::parse(name).and_then(|wanted| esi.find(&wanted).cloned());
    }
    for error in esi.devices.iter().filter_map(|device| device.as_ref().err()) {
        assert!(error.line >= 1 && !error.reason.is_empty(), "{error}");
    }
    for device in esi.usable() {
        let Ok(made) = image(device, esi.vendor_id, &device.pdos) else { continue };
        let bytes = made.build().expect("it was built when it was made");
        let again = Image::parse(&bytes).expect("what we build is an image");
        assert_eq!(again.identity, made.identity);
        assert_eq!(again.configuration, made.configuration);
        assert_eq!(again.standard_mailbox, made.standard_mailbox);
        assert_eq!(again.sync_managers(), made.sync_managers());
        assert!(
            again.process_data().map(|one| one.bits).eq(made.process_data().map(|one| one.bits)),
            "process data"
        );
    }
}
