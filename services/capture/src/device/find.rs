//! Finds the device that a name in the configuration means, by path, `bus_info` or serial number.
//!
//! A USB camera may return under another number, so each search lists all nodes again. Only nodes that deliver images
//! count: a UVC camera has a second node for metadata, with the same `bus_info` and serial number.

use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rustix::io::Errno;

use fringeflow_config::DeviceName;

use crate::ioctl::{CallError, Device};

use super::capability::Capability;
use super::file_kind;

/// Folder in which the kernel lists the nodes.
const CLASS: &str = "/sys/class/video4linux";
/// Maximum number of nodes that are read; the kernel numbers no more.
const MAX_NODES: usize = 256;

/// A device node.
#[derive(Debug)]
pub(crate) struct Node {
    /// Its path, `/dev/video…`.
    pub(crate) path: PathBuf,
    /// USB serial number.
    pub(crate) serial: Option<String>,
    /// What the device reports about itself.
    pub(crate) capability: Result<Capability, OpenError>,
}

/// Why a node cannot be queried.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The node cannot be opened.
    #[error("{} cannot be opened: {source}{}", path.display(), hint(source))]
    Open {
        /// Its path.
        path: PathBuf,
        /// Error of the system.
        #[source]
        source: io::Error,
    },
    /// The path is not that of a V4L2 camera.
    #[error("{} is no V4L2 camera, but {what}; `fringeflow cameras` lists the cameras", path.display())]
    NotV4l2 {
        /// The path.
        path: PathBuf,
        /// What it is instead, in words.
        what: String,
    },
    /// The node does not tell what it is.
    #[error("{} does not answer: {call}: {source}", path.display())]
    NoAnswer {
        /// Its path.
        path: PathBuf,
        /// The refused call.
        call: &'static str,
        /// Error of the system.
        #[source]
        source: io::Error,
    },
}

/// Why no device was found for a name.
#[derive(Debug, thiserror::Error)]
pub enum FindError {
    /// No device has the name.
    #[error("{name} was not found{}; {}", LinkText(target.as_deref()), AvailableText(available))]
    Absent {
        /// The name.
        name: DeviceName,
        /// Where the name leads, if it is a link to a node that does not exist.
        target: Option<PathBuf>,
        /// Cameras that are available, and nodes that cannot be queried.
        available: Vec<String>,
    },
    /// Several devices have the name.
    #[error("{name} matches several devices: {nodes:?}; name one by its path, best by a link in /dev/v4l/by-path")]
    Ambiguous {
        /// The name.
        name: DeviceName,
        /// Their paths.
        nodes: Vec<PathBuf>,
    },
    /// The device cannot be queried.
    #[error(transparent)]
    Unopened(#[from] OpenError),
}

impl FindError {
    /// Whether waiting does not help, because the configuration or permissions must change first.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::Absent { .. } => false,
            Self::Ambiguous { .. } => true,
            Self::Unopened(OpenError::NotV4l2 { .. }) => true,
            Self::Unopened(OpenError::Open { source, .. } | OpenError::NoAnswer { source, .. }) => is_lasting(source),
        }
    }
}

struct LinkText<'a>(Option<&'a Path>);

impl fmt::Display for LinkText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            None => Ok(()),
            Some(target) => {
                write!(f, ": it is a link to {}, which does not exist (is the camera plugged in?)", target.display())
            }
        }
    }
}

struct AvailableText<'a>(&'a [String]);

impl fmt::Display for AvailableText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [] => write!(f, "there is no camera: check the cable, and check that the driver is loaded"),
            available => write!(f, "available: {}", available.join("; ")),
        }
    }
}

/// Tells what to do about an error.
fn hint(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::PermissionDenied => {
            "; add the user to the group \"video\" and log in again; in a container, pass the device to it (--device)"
        }
        io::ErrorKind::ResourceBusy => "; another program uses the device: close it",
        _ => "",
    }
}

/// Whether an error of the system lasts until the configuration, permissions or the program change. Other errors may
/// pass, such as an absent device or one that another program uses.
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

/// Finds the current path of the device with a name.
///
/// # Errors
/// There is no such device, there are several, or a device in question cannot be opened.
pub(crate) fn find_device(name: &DeviceName) -> Result<PathBuf, FindError> {
    match name {
        DeviceName::Path(path) => match fs::canonicalize(path) {
            Ok(path) => Ok(path),
            // No node matches a path, so this yields the error that lists the cameras.
            Err(source) if source.kind() == io::ErrorKind::NotFound => choose_node(name, list_nodes()),
            Err(source) => Err(OpenError::Open { path: path.clone(), source }.into()),
        },
        DeviceName::Bus(_) | DeviceName::Serial(_) => choose_node(name, list_nodes()),
    }
}

/// Lists all nodes in the order of their numbers.
pub(crate) fn list_nodes() -> Vec<Node> {
    // A kernel without V4L2 has no such folder, and so no cameras.
    let entries = fs::read_dir(CLASS).into_iter().flatten().flatten();
    let number = |entry: fs::DirEntry| Some((video_number(&entry.file_name().to_string_lossy())?, entry.path()));
    let mut found: Vec<(u32, PathBuf)> = entries.filter_map(number).take(MAX_NODES).collect();
    found.sort();
    found.into_iter().map(|(number, folder)| read_node(Path::new(&format!("/dev/video{number}")), &folder)).collect()
}

/// Reads the node at a path.
pub(crate) fn read_node_at(path: &Path) -> Node {
    let name = path.file_name().unwrap_or_default();
    read_node(path, &Path::new(CLASS).join(name))
}

/// Reads a node; `folder` is its entry in [`CLASS`].
fn read_node(path: &Path, folder: &Path) -> Node {
    Node { path: path.to_owned(), serial: usb_serial(folder), capability: read_capability(path) }
}

fn read_capability(path: &Path) -> Result<Capability, OpenError> {
    Ok(open_node(path)?.1)
}

/// Opens a node, and reads what it reports about itself.
///
/// # Errors
/// The path is not that of a V4L2 device, or the system refuses it.
pub(crate) fn open_node(path: &Path) -> Result<(Device, Capability), OpenError> {
    let not_v4l2 = |what| OpenError::NotV4l2 { path: path.to_owned(), what };
    if let Some(what) = file_kind::other_than_v4l2(path) {
        return Err(not_v4l2(what));
    }
    let device = Device::open(path).map_err(|source| OpenError::Open { path: path.to_owned(), source })?;
    match Capability::read(&device) {
        Ok(capability) => Ok((device, capability)),
        Err(error) if error.errno() == Some(Errno::NOTTY) => Err(not_v4l2(file_kind::other_v4l2_node(path))),
        Err(CallError { call, source }) => Err(OpenError::NoAnswer { path: path.to_owned(), call, source }),
    }
}

/// Returns the number of a node: `video7` → 7. Other nodes of the class carry no images.
fn video_number(name: &str) -> Option<u32> {
    name.strip_prefix("video")?.parse().ok()
}

/// Reads the serial number of the USB device that a node belongs to. The serial number of a hub does not count.
fn usb_serial(folder: &Path) -> Option<String> {
    let interface = fs::canonicalize(folder.join("device")).ok()?;
    // The innermost folder with a USB vendor is the device; those around it are its hubs.
    let usb = interface.ancestors().find(|folder| folder.join("idVendor").exists())?;
    let serial = fs::read(usb.join("serial")).ok()?;
    Some(String::from_utf8_lossy(&serial).trim().to_owned()).filter(|serial| !serial.is_empty())
}

/// Returns the one node that a name means.
fn choose_node(name: &DeviceName, nodes: Vec<Node>) -> Result<PathBuf, FindError> {
    let is_meant = |node: &Node| match (name, &node.capability) {
        (DeviceName::Serial(serial), _) => node.serial.as_ref() == Some(serial),
        (DeviceName::Bus(bus), Ok(capability)) => capability.bus_info == *bus,
        _ => false,
    };
    let (meant, others): (Vec<Node>, Vec<Node>) = nodes.into_iter().partition(is_meant);
    let mut cameras = Vec::new();
    for node in meant {
        match node.capability {
            // It may be the wanted camera, so the others are not used in its place.
            Err(error) => return Err(error.into()),
            Ok(capability) if capability.is_camera() => cameras.push(node.path),
            Ok(_) => {}
        }
    }
    match cameras.len() {
        0 => Err(FindError::Absent {
            name: name.clone(),
            target: dangling_target(name),
            available: others.iter().filter_map(node_text).collect(),
        }),
        1 => Ok(cameras.swap_remove(0)),
        _ => Err(FindError::Ambiguous { name: name.clone(), nodes: cameras }),
    }
}

/// Returns where a path leads, if it is a link to nothing.
fn dangling_target(name: &DeviceName) -> Option<PathBuf> {
    let DeviceName::Path(path) = name else { return None };
    fs::read_link(path).ok().filter(|_| !path.exists())
}

/// Describes a node in a list of the available ones; returns `None` if it is not a camera.
fn node_text(node: &Node) -> Option<String> {
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
    fn the_capture_node_is_found_by_bus_info_and_by_serial_number() {
        let found = |name: &str| choose_node(&name.parse().unwrap(), two_cameras()).unwrap();
        assert_eq!(found("bus:usb-2"), Path::new("/dev/video2"));
        assert_eq!(found("serial:A"), Path::new("/dev/video0"));
    }

    #[test]
    fn an_absent_device_is_reported_with_the_available_ones() {
        let mut nodes = two_cameras();
        nodes.push(denied(9, "C"));
        let error = choose_node(&"bus:usb-7".parse().unwrap(), nodes).unwrap_err();
        assert!(!error.is_lasting());
        let text = error.to_string();
        let all = [
            "bus:usb-7 was not found",
            "/dev/video0 (Cam, bus:usb-1, serial:A)",
            "/dev/video9 cannot be opened",
            "\"video\"",
        ];
        assert!(all.iter().all(|part| text.contains(part)) && !text.contains("video1"), "{text}");
        let none = choose_node(&"serial:A".parse().unwrap(), Vec::new()).unwrap_err().to_string();
        assert!(none.contains("there is no camera"), "{none}");
    }

    #[test]
    fn several_devices_of_the_same_name_are_refused() {
        let mut nodes = two_cameras();
        nodes.push(node(4, "usb-1", "A", CAPTURE));
        let error = choose_node(&"serial:A".parse().unwrap(), nodes).unwrap_err();
        assert!(error.is_lasting());
        assert!(error.to_string().contains("/dev/video0") && error.to_string().contains("/dev/video4"), "{error}");
    }

    #[test]
    fn a_device_that_cannot_be_opened_is_reported_as_such() {
        let error = choose_node(&"serial:C".parse().unwrap(), vec![denied(9, "C")]).unwrap_err();
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
        assert_eq!(usb_serial(&class), None);
        fs::write(root.path().join("hub/port/serial"), " 7 \n").unwrap();
        assert_eq!(usb_serial(&class), Some("7".into()));
    }

    #[test]
    fn only_video_nodes_have_numbers() {
        assert_eq!(video_number("video12"), Some(12));
        assert!(["vbi0", "v4l-subdev0", "video", "videox"].iter().all(|name| video_number(name).is_none()));
    }
}
