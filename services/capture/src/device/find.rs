//! From the name in the configuration to the device: by path, by where it sits, or by its serial number.
//!
//! A camera of the USB may come back under another number, so the nodes are looked through anew each time. Only nodes out of
//! which images come count: a UVC camera has a second one for data about images, at the same place and with the same serial
//! number.

use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rustix::io::Errno;

use fringeflow_config::DeviceName;

use crate::ioctl::Device;

use super::capability::Capability;

/// Where the kernel lists the nodes.
const CLASS: &str = "/sys/class/video4linux";
/// Most nodes that are looked at; the kernel numbers no more.
const MOST_NODES: usize = 256;

/// A node of a device.
#[derive(Debug)]
pub(crate) struct Node {
    /// Its path.
    pub(crate) path: PathBuf,
    /// Serial number on the USB.
    pub(crate) serial: Option<String>,
    /// What it says of itself.
    pub(crate) capability: Result<Capability, OpenError>,
}

/// A node that could not be asked what it is.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// It cannot be opened.
    #[error("{} cannot be opened: {source}{}", path.display(), hint(source))]
    Open {
        /// Its path.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: io::Error,
    },
    /// It does not answer as a V4L2 device does.
    #[error("{} does not answer as a V4L2 device: {call}: {source}", path.display())]
    NotV4l2 {
        /// Its path.
        path: PathBuf,
        /// The call.
        call: &'static str,
        /// What the system said.
        #[source]
        source: io::Error,
    },
}

/// Why a name leads to no device.
#[derive(Debug, thiserror::Error)]
pub enum FindError {
    /// It is not there.
    #[error("{name} was not found; {}", Seen(seen))]
    Absent {
        /// The name.
        name: DeviceName,
        /// Cameras that are there, and nodes that cannot be asked.
        seen: Vec<String>,
    },
    /// Several have that name.
    #[error("{name} fits all of {nodes:?}; name one by its path, best by a link in /dev/v4l/by-path")]
    Ambiguous {
        /// The name.
        name: DeviceName,
        /// Their paths.
        nodes: Vec<PathBuf>,
    },
    /// It is there and cannot be asked.
    #[error(transparent)]
    Unopened(#[from] OpenError),
}

impl FindError {
    /// Whether waiting would not help: configuration or rights must change first.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::Absent { .. } => false,
            Self::Ambiguous { .. } => true,
            Self::Unopened(OpenError::Open { source, .. } | OpenError::NotV4l2 { source, .. }) => is_lasting(source),
        }
    }
}

struct Seen<'a>(&'a [String]);

impl fmt::Display for Seen<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [] => write!(f, "there is no camera: check the cable, and check that the driver is loaded"),
            seen => write!(f, "there are: {}", seen.join("; ")),
        }
    }
}

/// What helps against an error.
fn hint(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::PermissionDenied => "; add the user to the group \"video\" and log in again",
        _ => "",
    }
}

/// Whether an error of the system will come again until somebody changes the configuration, the rights or the program;
/// others come and go with the device and whoever else uses it.
pub(crate) fn is_lasting(source: &io::Error) -> bool {
    let lasting = [
        Errno::INVAL,
        Errno::NOTTY,
        Errno::RANGE,
        Errno::ACCESS,
        Errno::PERM,
        Errno::OPNOTSUPP,
        Errno::NODATA,
        Errno::ISDIR,
    ];
    Errno::from_io_error(source).is_some_and(|errno| lasting.contains(&errno))
}

/// Where the device of a name is at this moment.
///
/// # Errors
/// It is not there, there are several, or those in question cannot be opened.
pub(crate) fn find(name: &DeviceName) -> Result<PathBuf, FindError> {
    match name {
        DeviceName::Path(path) => match fs::canonicalize(path) {
            Ok(path) => Ok(path),
            Err(source) if source.kind() == io::ErrorKind::NotFound => choose(name, nodes()),
            Err(source) => Err(OpenError::Open { path: path.clone(), source }.into()),
        },
        DeviceName::Bus(_) | DeviceName::Serial(_) => choose(name, nodes()),
    }
}

/// All nodes there are, in the order of their numbers.
pub(crate) fn nodes() -> Vec<Node> {
    // A kernel without V4L2 has no such folder, which is the same as no camera.
    let entries = fs::read_dir(CLASS).into_iter().flatten().flatten();
    let number = |entry: fs::DirEntry| Some((video_number(&entry.file_name().to_string_lossy())?, entry.path()));
    let mut found: Vec<(u32, PathBuf)> = entries.filter_map(number).take(MOST_NODES).collect();
    found.sort();
    found.into_iter().map(|(number, folder)| node(Path::new(&format!("/dev/video{number}")), &folder)).collect()
}

/// The node at a path, wherever the kernel lists it.
pub(crate) fn node_at(path: &Path) -> Node {
    let name = path.file_name().unwrap_or_default();
    node(path, &Path::new(CLASS).join(name))
}

fn node(path: &Path, folder: &Path) -> Node {
    Node { path: path.to_owned(), serial: serial(folder), capability: capability(path) }
}

fn capability(path: &Path) -> Result<Capability, OpenError> {
    let not_v4l2 = |call, source| OpenError::NotV4l2 { path: path.to_owned(), call, source };
    Capability::read(&open_node(path)?).map_err(|error| not_v4l2(error.call, error.source))
}

/// Opens a node.
///
/// # Errors
/// The system refuses it.
pub(crate) fn open_node(path: &Path) -> Result<Device, OpenError> {
    Device::open(path).map_err(|source| OpenError::Open { path: path.to_owned(), source })
}

/// `video7` → 7; other nodes of the class carry no images.
fn video_number(name: &str) -> Option<u32> {
    name.strip_prefix("video")?.parse().ok()
}

/// Serial number of the USB device that a node belongs to. Where that one has none, the hub's is not taken for it.
fn serial(folder: &Path) -> Option<String> {
    let interface = fs::canonicalize(folder.join("device")).ok()?;
    let usb = interface.ancestors().find(|folder| folder.join("idVendor").exists())?;
    let serial = fs::read(usb.join("serial")).ok()?;
    Some(String::from_utf8_lossy(&serial).trim().to_owned()).filter(|serial| !serial.is_empty())
}

/// The one node that a name means.
fn choose(name: &DeviceName, nodes: Vec<Node>) -> Result<PathBuf, FindError> {
    let is_meant = |node: &Node| match (name, &node.capability) {
        (DeviceName::Serial(serial), _) => node.serial.as_ref() == Some(serial),
        (DeviceName::Bus(bus), Ok(capability)) => capability.bus_info == *bus,
        _ => false,
    };
    let (meant, others): (Vec<Node>, Vec<Node>) = nodes.into_iter().partition(is_meant);
    let mut cameras = Vec::new();
    for node in meant {
        match node.capability {
            // What it is cannot be told: it may be the one.
            Err(error) => return Err(error.into()),
            Ok(capability) if capability.is_camera() => cameras.push(node.path),
            Ok(_) => {}
        }
    }
    match cameras.len() {
        0 => Err(FindError::Absent { name: name.clone(), seen: others.iter().filter_map(seen).collect() }),
        1 => Ok(cameras.swap_remove(0)),
        _ => Err(FindError::Ambiguous { name: name.clone(), nodes: cameras }),
    }
}

/// A node in a list of what is there; those that are no cameras are left out.
fn seen(node: &Node) -> Option<String> {
    let capability = match &node.capability {
        Err(error) => return Some(error.to_string()),
        Ok(capability) => capability,
    };
    if !capability.is_camera() {
        return None;
    }
    let serial = node.serial.as_ref().map_or_else(String::new, |serial| format!(", serial:{serial}"));
    Some(format!("{} ({}, bus:{}{serial})", node.path.display(), capability.card, capability.bus_info))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAPTURE: u32 = 0x0400_0001;
    const METADATA: u32 = 0x0480_0000;

    fn node(number: u32, bus: &str, serial: &str, flags: u32) -> Node {
        let capability =
            Capability { driver: "uvcvideo".into(), card: "Cam".into(), bus_info: bus.into(), node: flags };
        let serial = (!serial.is_empty()).then(|| serial.to_owned());
        Node { path: format!("/dev/video{number}").into(), serial, capability: Ok(capability) }
    }

    fn denied(number: u32, serial: &str) -> Node {
        let path: PathBuf = format!("/dev/video{number}").into();
        let source = io::ErrorKind::PermissionDenied.into();
        Node { path: path.clone(), serial: Some(serial.into()), capability: Err(OpenError::Open { path, source }) }
    }

    fn two_cameras() -> Vec<Node> {
        let left = [node(0, "usb-1", "A", CAPTURE), node(1, "usb-1", "A", METADATA)];
        let right = [node(2, "usb-2", "B", CAPTURE), node(3, "usb-2", "B", METADATA)];
        left.into_iter().chain(right).collect()
    }

    #[test]
    fn the_node_that_captures_is_found_by_place_and_by_serial_number() {
        let found = |name: &str| choose(&name.parse().unwrap(), two_cameras()).unwrap();
        assert_eq!(found("bus:usb-2"), Path::new("/dev/video2"));
        assert_eq!(found("serial:A"), Path::new("/dev/video0"));
    }

    #[test]
    fn an_absent_one_is_told_with_what_is_there() {
        let mut nodes = two_cameras();
        nodes.push(denied(9, "C"));
        let error = choose(&"bus:usb-7".parse().unwrap(), nodes).unwrap_err();
        assert!(!error.is_lasting());
        let text = error.to_string();
        let all = [
            "bus:usb-7 was not found",
            "/dev/video0 (Cam, bus:usb-1, serial:A)",
            "/dev/video9 cannot be opened",
            "\"video\"",
        ];
        assert!(all.iter().all(|part| text.contains(part)) && !text.contains("video1"), "{text}");
        let none = choose(&"serial:A".parse().unwrap(), Vec::new()).unwrap_err().to_string();
        assert!(none.contains("there is no camera"), "{none}");
    }

    #[test]
    fn several_of_the_same_name_are_refused() {
        let mut nodes = two_cameras();
        nodes.push(node(4, "usb-1", "A", CAPTURE));
        let error = choose(&"serial:A".parse().unwrap(), nodes).unwrap_err();
        assert!(error.is_lasting());
        assert!(error.to_string().contains("/dev/video0") && error.to_string().contains("/dev/video4"), "{error}");
    }

    #[test]
    fn one_that_cannot_be_opened_is_told_as_such() {
        let error = choose(&"serial:C".parse().unwrap(), vec![denied(9, "C")]).unwrap_err();
        assert!(matches!(&error, FindError::Unopened(OpenError::Open { .. })), "{error}");
    }

    #[test]
    fn the_serial_number_is_that_of_the_device_not_of_its_hub() {
        let root = tempfile::tempdir().unwrap();
        let interface = root.path().join("hub/port/interface");
        fs::create_dir_all(&interface).unwrap();
        for (folder, name, text) in [("hub", "idVendor", "1"), ("hub", "serial", "HUB"), ("hub/port", "idVendor", "2")]
        {
            fs::write(root.path().join(folder).join(name), text).unwrap();
        }
        let class = root.path().join("video0");
        fs::create_dir(&class).unwrap();
        std::os::unix::fs::symlink(&interface, class.join("device")).unwrap();
        assert_eq!(serial(&class), None);
        fs::write(root.path().join("hub/port/serial"), " 7 \n").unwrap();
        assert_eq!(serial(&class), Some("7".into()));
    }

    #[test]
    fn only_nodes_of_images_have_numbers() {
        assert_eq!(video_number("video12"), Some(12));
        assert!(["vbi0", "v4l-subdev0", "video", "videox"].iter().all(|name| video_number(name).is_none()));
    }
}
