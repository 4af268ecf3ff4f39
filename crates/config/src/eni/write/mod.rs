//! Making an ENI file of a plan, complete enough for the MainDevices of others: commands of every
//! transition, cyclic frames, process image (ETG.2100).
//!
//! The process image of the file holds the data of the datagrams one behind the other. What ENI has no
//! word for stands in elements `Linesman`, which other programs pass over.

mod cyclic;
mod main_device;
mod sub_device;
mod transition;

use self::cyclic::Image;
use crate::plan::Plan;
use crate::xml_writer::Xml;

/// The file of a plan.
#[must_use]
pub fn write(name: &str, plan: &Plan) -> String {
    let image = Image::of(plan);
    let mut xml = Xml::new();
    let attributes = [("Version", "1.3")];
    xml.element("EtherCATConfig", &attributes, |xml| {
        xml.element("Config", &[], |xml| {
            main_device::write(xml, name, plan);
            for device in &plan.devices {
                sub_device::write(xml, device, plan, &image);
            }
            cyclic::write(xml, plan, &image);
            cyclic::write_image(xml, plan, &image);
        });
    });
    xml.finish()
}
