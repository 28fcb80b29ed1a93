//! Lists the cameras of this machine, and formats, rates and controls of each, as needed to write a configuration.

use std::path::PathBuf;

use fringeflow_config::{ControlValue, DeviceName};

use crate::ioctl::Device;

use super::capability::Capability;
use super::controls::{self, Control};
use super::find::{FindError, Node, find_device, list_nodes, open_node, read_node_at};
use super::format;
use super::offer::{self, OfferedFormat};
use super::{stamp_source, timings};

/// A device and its properties, as far as they could be read.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Listing {
    /// Its node.
    pub path: PathBuf,
    /// Best name for the configuration: if possible, one that stays the same when the device is plugged in again.
    pub device: String,
    /// Name of the device.
    pub card: String,
    /// Name of its driver.
    pub driver: String,
    /// V4L2 `bus_info`: where the device is connected.
    pub bus_info: String,
    /// USB serial number.
    pub serial: Option<String>,
    /// Pixel formats.
    pub formats: Vec<OfferedFormat>,
    /// Video signal of a frame grabber.
    pub video_signal: Option<VideoSignal>,
    /// What its time stamps mark; `None` if it is not a camera at present.
    pub time_stamps: Option<String>,
    /// Controls.
    pub controls: Vec<ListedControl>,
    /// What could not be read, and why the device is not a camera.
    pub problems: Vec<String>,
}

/// Video signal of a frame grabber. Each text is a signal, or the reason why there is none.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct VideoSignal {
    /// The signal that the device is set to.
    pub set: String,
    /// The signal that the device detects.
    pub seen: String,
}

/// A control and its value.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ListedControl {
    /// The control.
    #[serde(flatten)]
    pub control: Control,
    /// Its value, if it can be read.
    pub value: Option<ControlValue>,
}

impl ListedControl {
    /// Returns the names of the set flags.
    #[must_use]
    pub fn flags(&self) -> Vec<&'static str> {
        controls::flag_names(self.control.flags)
    }
}

/// Lists all cameras, and the nodes that cannot be queried.
#[must_use]
pub fn cameras() -> Vec<Listing> {
    let nodes = list_nodes();
    let is_listed = |node: &&Node| node.capability.as_ref().map_or(true, Capability::is_camera);
    nodes.iter().filter(is_listed).map(|node| list_device(node, &nodes)).collect()
}

/// Describes the device with a name, camera or not.
///
/// # Errors
/// There is no such device, there are several, or it is not a V4L2 device.
pub fn describe(name: &DeviceName) -> Result<Listing, FindError> {
    let node = read_node_at(&find_device(name)?);
    match node.capability {
        Err(error) => Err(error.into()),
        Ok(_) => Ok(list_device(&node, &list_nodes())),
    }
}

fn list_device(node: &Node, all: &[Node]) -> Listing {
    let mut listing = Listing {
        path: node.path.clone(),
        device: best_name(node, all).to_string(),
        card: String::new(),
        driver: String::new(),
        bus_info: String::new(),
        serial: node.serial.clone(),
        formats: Vec::new(),
        video_signal: None,
        time_stamps: None,
        controls: Vec::new(),
        problems: Vec::new(),
    };
    match &node.capability {
        Ok(capability) => listing.read(capability),
        Err(error) => listing.problems.push(error.to_string()),
    }
    listing
}

impl Listing {
    fn read(&mut self, capability: &Capability) {
        self.card.clone_from(&capability.card);
        self.driver.clone_from(&capability.driver);
        self.bus_info.clone_from(&capability.bus_info);
        let device = match open_node(&self.path) {
            Ok((device, _)) => device,
            Err(error) => return self.problems.push(error.to_string()),
        };
        match capability.buffer_type() {
            Ok(kind) => {
                self.formats = offer::list_formats(&device, kind);
                let layout = format::read(&device, kind).ok();
                self.time_stamps = layout.map(|layout| stamp_source::describe(&device, capability, layout.kind));
            }
            Err(what) => self.problems.push(format!("it is {what}")),
        }
        self.video_signal = timings::input_has_timings(&device).then(|| video_signal(&device));
        self.list_controls(&device);
    }

    fn list_controls(&mut self, device: &Device) {
        let controls = controls::list_controls(device).unwrap_or_else(|error| {
            self.problems.push(format!("controls: {error}"));
            Vec::new()
        });
        for control in controls {
            let value = control.read(device).unwrap_or_else(|error| {
                self.problems.push(format!("control {}: {error}", control.name));
                None
            });
            self.controls.push(ListedControl { control, value });
        }
    }
}

fn video_signal(device: &Device) -> VideoSignal {
    let text = |signal: Result<timings::Signal, _>| match signal {
        Ok(signal) => signal.to_string(),
        Err(error) => format!("none ({error})"),
    };
    VideoSignal { set: text(timings::read_current(device)), seen: text(timings::detect(device)) }
}

/// Returns the name that stays valid longest: the serial number (any port), else the `bus_info` (any device number),
/// else the path. Serial number and `bus_info` must be unique among the cameras.
fn best_name(node: &Node, all: &[Node]) -> DeviceName {
    let is_camera = |node: &&Node| node.capability.as_ref().is_ok_and(Capability::is_camera);
    let is_only = |is_same: &dyn Fn(&Node) -> bool| {
        let mut others = all.iter().filter(is_camera).filter(|other| other.path != node.path);
        is_camera(&node) && !others.any(is_same)
    };
    if let Some(serial) = &node.serial
        && is_only(&|other| other.serial.as_ref() == Some(serial))
    {
        return DeviceName::Serial(serial.clone());
    }
    if let Ok(capability) = &node.capability
        && !capability.bus_info.is_empty()
        && is_only(&|other| other.capability.as_ref().is_ok_and(|other| other.bus_info == capability.bus_info))
    {
        return DeviceName::Bus(capability.bus_info.clone());
    }
    DeviceName::Path(node.path.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(number: u32, bus: &str, serial: Option<&str>, flags: u32) -> Node {
        let (driver, card, bus_info) = ("uvcvideo".to_owned(), "Cam".to_owned(), bus.to_owned());
        let capability = Ok(Capability { driver, card, bus_info, node: flags });
        Node { path: format!("/dev/video{number}").into(), serial: serial.map(str::to_owned), capability }
    }

    #[test]
    fn the_name_that_stays_valid_longest_is_proposed() {
        let (capture, metadata) = (0x0400_0001, 0x0480_0000);
        let nodes = [
            node(0, "usb-1", Some("A"), capture),
            node(1, "usb-1", Some("A"), metadata),
            // Some makers give all devices the same serial number.
            node(2, "usb-2", Some("0001"), capture),
            node(4, "usb-4", Some("0001"), capture),
            // Two sensors of one device.
            node(6, "usb-6", None, capture),
            node(8, "usb-6", None, capture),
        ];
        let names: Vec<String> = nodes.iter().map(|node| best_name(node, &nodes).to_string()).collect();
        assert_eq!(names, ["serial:A", "/dev/video1", "bus:usb-2", "bus:usb-4", "/dev/video6", "/dev/video8"]);
    }
}
