//! Checks before a run whether the monitor can run as configured.

use std::net::TcpListener;

use fringeflow_config::{Listen, MonitorConfiguration};

use crate::http::Guard;

/// Checks the token and the addresses, and returns the result as text for the user.
///
/// # Errors
/// The text says what must change first, with the key of the configuration or the file.
pub fn check(configuration: &MonitorConfiguration) -> Result<String, String> {
    if !configuration.is_enabled {
        return Ok("off: monitor.enabled is false".to_owned());
    }
    Guard::new(configuration).map_err(|error| error.to_string())?;
    let dashboard = check_address("monitor.address", &configuration.dashboard)?;
    let viewers = match &configuration.foxglove {
        Some(listen) => check_address("monitor.foxglove", listen)?,
        None => "off".to_owned(),
    };
    Ok(format!("dashboard {dashboard}, viewers {viewers}"))
}

/// Binds an address and releases it. If the port of a default is taken, any other port will do.
fn check_address(key: &str, listen: &Listen) -> Result<String, String> {
    let address = listen.address;
    match TcpListener::bind(address) {
        Ok(_) => Ok(address.to_string()),
        Err(_) if listen.is_default => Ok(format!("{} on any free port", address.ip())),
        Err(error) => Err(format!("{key}: the monitor cannot listen on {address}: {error}; set another address")),
    }
}
