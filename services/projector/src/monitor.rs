//! The monitors of an X server.

use serde::Serialize;
use x11rb::connection::Connection as _;
use x11rb::protocol::present::{self, ConnectionExt as _};
use x11rb::protocol::randr::{self, ConnectionExt as _, ModeFlag, ModeInfo};
use x11rb::protocol::xproto::{self, ConnectionExt as _};
use x11rb::rust_connection::RustConnection;

use crate::ProjectorError;

/// A connection to an X server.
#[derive(Debug)]
pub struct Screen {
    pub(crate) connection: RustConnection,
    number: usize,
}

/// A monitor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Monitor {
    /// Name of its output.
    pub name: String,
    /// Width and height, pixels.
    pub size_px: [usize; 2],
    /// Left upper corner on the desktop, pixels.
    pub place_px: [i16; 2],
    /// Refreshes per second of its mode; `None` if the server does not tell, as virtual ones do.
    pub refresh_hz: Option<f64>,
    /// Whether it is the primary monitor, which has the desktop.
    pub primary: bool,
}

impl Screen {
    /// Connects to an X server; `None` for the one in `DISPLAY`.
    ///
    /// # Errors
    /// There is no such server, or it lacks an extension.
    pub fn open(display: Option<&str>) -> Result<Self, ProjectorError> {
        let (connection, number) = x11rb::connect(display)
            .map_err(|source| ProjectorError::Connect { name: display.map(str::to_owned), source })?;
        for name in [present::X11_EXTENSION_NAME, randr::X11_EXTENSION_NAME] {
            if connection.query_extension(name.as_bytes())?.reply()?.present {
                continue;
            }
            return Err(ProjectorError::NoExtension(name));
        }
        connection.present_query_version(1, 0)?.reply()?;
        connection.randr_query_version(1, 5)?.reply()?;
        Ok(Self { connection, number })
    }

    pub(crate) fn root(&self) -> &xproto::Screen {
        &self.connection.setup().roots[self.number]
    }

    /// Lists the monitors.
    ///
    /// # Errors
    /// The server does not answer.
    pub fn monitors(&self) -> Result<Vec<Monitor>, ProjectorError> {
        let (connection, root) = (&self.connection, self.root().root);
        let resources = connection.randr_get_screen_resources_current(root)?.reply()?;
        let mut monitors = Vec::new();
        for info in connection.randr_get_monitors(root, true)?.reply()?.monitors {
            let name = connection.get_atom_name(info.name)?.reply()?.name;
            let mut refresh_hz = None;
            for output in info.outputs {
                let crtc = connection.randr_get_output_info(output, resources.config_timestamp)?.reply()?.crtc;
                if crtc != x11rb::NONE {
                    let mode = connection.randr_get_crtc_info(crtc, resources.config_timestamp)?.reply()?.mode;
                    refresh_hz = resources.modes.iter().find(|known| known.id == mode).and_then(mode_refresh_hz);
                }
            }
            monitors.push(Monitor {
                name: String::from_utf8_lossy(&name).into_owned(),
                size_px: [info.width.into(), info.height.into()],
                place_px: [info.x, info.y],
                refresh_hz,
                primary: info.primary,
            });
        }
        Ok(monitors)
    }

    /// Returns the monitor with a name. Without a name, it is the only one, or the only one beside the primary monitor.
    ///
    /// # Errors
    /// There is no such monitor, or several.
    pub fn monitor(&self, wanted: Option<&str>) -> Result<Monitor, ProjectorError> {
        chosen(&self.monitors()?, wanted)
    }
}

fn chosen(monitors: &[Monitor], wanted: Option<&str>) -> Result<Monitor, ProjectorError> {
    let known = || monitors.iter().map(|monitor| monitor.name.as_str()).collect::<Vec<_>>().join(", ");
    if let Some(wanted) = wanted {
        let found = monitors.iter().find(|monitor| monitor.name == wanted).cloned();
        return found.ok_or_else(|| ProjectorError::NoMonitor { wanted: wanted.to_owned(), known: known() });
    }
    if let [only] = monitors {
        return Ok(only.clone());
    }
    let mut others = monitors.iter().filter(|monitor| !monitor.primary);
    match (monitors.iter().any(|monitor| monitor.primary), others.next(), others.next()) {
        (true, Some(other), None) => Ok(other.clone()),
        _ => Err(ProjectorError::WhichMonitor { known: known() }),
    }
}

fn mode_refresh_hz(mode: &ModeInfo) -> Option<f64> {
    let mut lines = f64::from(mode.vtotal);
    if mode.mode_flags.contains(ModeFlag::DOUBLE_SCAN) {
        lines *= 2.0;
    }
    if mode.mode_flags.contains(ModeFlag::INTERLACE) {
        lines /= 2.0;
    }
    let dots = f64::from(mode.htotal) * lines;
    (mode.dot_clock > 0 && dots > 0.0).then(|| f64::from(mode.dot_clock) / dots)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn monitor(name: &str, primary: bool) -> Monitor {
        Monitor { name: name.to_owned(), size_px: [64, 48], place_px: [0, 0], refresh_hz: None, primary }
    }

    #[test]
    fn the_projector_is_the_other_monitor_or_named() {
        let two = || vec![monitor("eDP-1", true), monitor("HDMI-1", false)];
        assert_eq!(chosen(&two(), None).unwrap().name, "HDMI-1");
        assert_eq!(chosen(&two(), Some("eDP-1")).unwrap().name, "eDP-1");
        assert_eq!(chosen(&[monitor("screen", false)], None).unwrap().name, "screen");
        let refused = chosen(&two(), Some("DP-9")).unwrap_err().to_string();
        assert!(refused.contains("\"DP-9\"") && refused.contains("eDP-1, HDMI-1"), "{refused}");
        for many in [
            vec![monitor("a", true), monitor("b", false), monitor("c", false)],
            vec![monitor("a", false), monitor("b", false)],
            vec![],
        ] {
            assert!(chosen(&many, None).unwrap_err().to_string().contains("--monitor"));
        }
    }

    #[test]
    fn the_rate_follows_from_the_mode() {
        let mode = ModeInfo { dot_clock: 148_500_000, htotal: 2200, vtotal: 1125, ..ModeInfo::default() };
        assert_eq!(mode_refresh_hz(&mode), Some(60.0));
        assert_eq!(mode_refresh_hz(&ModeInfo { mode_flags: ModeFlag::INTERLACE, ..mode }), Some(120.0));
        assert_eq!(mode_refresh_hz(&ModeInfo { dot_clock: 0, ..mode }), None);
    }
}
