//! Whether the monitor can run as configured, before anything is started.

use std::net::TcpListener;

use fringeflow_config::{Listen, MonitorConfiguration};

use crate::http::Guard;

/// Looks at the token and at the addresses; what was found, in words.
///
/// # Errors
/// What must change first, with the key of the configuration or the file.
pub fn check(configuration: &MonitorConfiguration) -> Result<String, String> {
    if !configuration.is_enabled {
        return Ok("off: monitor.enabled is false".to_owned());
    }
    Guard::new(configuration).map_err(|error| error.to_string())?;
    let dashboard = free("monitor.address", &configuration.dashboard)?;
    let viewers = match &configuration.foxglove {
        Some(listen) => free("monitor.foxglove", listen)?,
        None => "off".to_owned(),
    };
    Ok(format!("dashboard {dashboard}, viewers {viewers}"))
}

/// Takes an address and leaves it again; a default gives way to any other port.
fn free(key: &str, listen: &Listen) -> Result<String, String> {
    let address = listen.address;
    match TcpListener::bind(address) {
        Ok(_) => Ok(address.to_string()),
        Err(_) if listen.is_default => Ok(format!("{} on any free port", address.ip())),
        Err(error) => Err(format!("{key}: the monitor cannot listen on {address}: {error}; set another address")),
    }
}
