//! `[monitor]`: metrics, dashboard and live view.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use super::ConfigurationProblem;
use super::paths::in_folder;
use super::raw::RawMonitor;

/// Default address of the dashboard.
const DASHBOARD: Listen = Listen { address: SocketAddr::new(LOOPBACK, 8780), is_default: true };
/// Default address of the server for viewers: the port that the viewers propose.
const FOXGLOVE: Listen = Listen { address: SocketAddr::new(LOOPBACK, 8765), is_default: true };
const LOOPBACK: std::net::IpAddr = std::net::IpAddr::V4(Ipv4Addr::LOCALHOST);
/// Web pages that may connect to the server for viewers by default.
const ORIGINS: [&str; 1] = ["https://app.foxglove.dev"];

/// Configuration of the monitor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MonitorConfiguration {
    /// Whether the monitor runs.
    pub is_enabled: bool,
    /// Address of dashboard and metrics.
    pub dashboard: Listen,
    /// Address for Foxglove, Lichtblick and Rerun; `None` switches it off.
    pub foxglove: Option<Listen>,
    /// File with the token that clients on other computers must present.
    pub token_file: Option<PathBuf>,
    /// Host names under which clients may address this computer, besides its IP addresses.
    pub host_names: Vec<String>,
    /// Origins of web pages that may connect as viewers, besides those of this computer.
    pub foxglove_origins: Vec<String>,
}

/// An address to listen on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Listen {
    /// The address.
    pub address: SocketAddr,
    /// Whether it is the default address. If the port of a default address is taken, for example by another instance,
    /// any free port is used.
    pub is_default: bool,
}

pub(super) fn configuration(raw: &RawMonitor, folder: &Path) -> Result<MonitorConfiguration, ConfigurationProblem> {
    let foxglove = raw.foxglove.as_deref().filter(|address| *address != "off");
    let foxglove = match (foxglove, raw.foxglove.is_some()) {
        (None, true) => None,
        (address, _) => Some(listen("monitor.foxglove", address, FOXGLOVE)?),
    };
    let monitor = MonitorConfiguration {
        is_enabled: raw.enabled.unwrap_or(true),
        dashboard: listen("monitor.address", raw.address.as_deref(), DASHBOARD)?,
        foxglove,
        token_file: raw.token_file.as_ref().map(|file| in_folder(folder, file)),
        host_names: raw.host_names.clone().unwrap_or_default(),
        foxglove_origins: raw.foxglove_origins.clone().unwrap_or_else(|| ORIGINS.map(str::to_owned).to_vec()),
    };
    let is_open = monitor.listens().any(|listen| !listen.address.ip().is_loopback());
    if monitor.is_enabled && is_open && monitor.token_file.is_none() {
        return Err(ConfigurationProblem::Missing {
            key: "monitor.token_file",
            expected: "clients on other computers must present a token: name a file with a token of at least 16 \
                       characters",
        });
    }
    Ok(monitor)
}

impl MonitorConfiguration {
    /// All addresses that the monitor listens on.
    pub fn listens(&self) -> impl Iterator<Item = &Listen> {
        std::iter::once(&self.dashboard).chain(&self.foxglove)
    }
}

fn listen(key: &'static str, address: Option<&str>, default: Listen) -> Result<Listen, ConfigurationProblem> {
    let Some(address) = address else { return Ok(default) };
    let parsed = address.parse().map_err(|_| ConfigurationProblem::Value {
        key,
        value: format!("{address:?}"),
        expected: "it must be an address and a port, for example \"127.0.0.1:8780\" or \"[::1]:8780\"; port 0 means \
                   any free port",
    })?;
    Ok(Listen { address: parsed, is_default: false })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<MonitorConfiguration, String> {
        let raw: RawMonitor = toml::from_str(text).map_err(|e| e.to_string())?;
        configuration(&raw, Path::new("/configs")).map_err(|e| e.to_string())
    }

    #[test]
    fn by_default_it_listens_on_this_computer_only() {
        let monitor = parse("").unwrap();
        assert!(monitor.is_enabled && monitor.listens().count() == 2);
        assert!(monitor.listens().all(|listen| listen.address.ip().is_loopback() && listen.is_default));
        assert_eq!(parse("foxglove = \"off\"").unwrap().foxglove, None);
    }

    #[test]
    fn an_address_reachable_by_other_computers_needs_a_token() {
        let refused = parse("address = \"0.0.0.0:8780\"").unwrap_err();
        assert!(refused.contains("monitor.token_file is missing"), "{refused}");
        assert!(parse("foxglove = \"192.168.1.5:8765\"").is_err());
        let monitor = parse("address = \"0.0.0.0:8780\"\ntoken_file = \"token\"").unwrap();
        assert_eq!(monitor.token_file.as_deref(), Some(Path::new("/configs/token")));
        assert!(parse("address = \"0.0.0.0:8780\"\nenabled = false").is_ok());
    }

    #[test]
    fn an_invalid_address_is_named() {
        let refused = parse("address = \"localhost\"").unwrap_err();
        assert!(
            refused.contains("monitor.address is \"localhost\"") && refused.contains("127.0.0.1:8780"),
            "{refused}"
        );
        assert!(parse("adress = \"127.0.0.1:1\"").is_err());
    }
}
