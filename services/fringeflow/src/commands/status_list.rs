//! `fringeflow status` without a name: lists the running instances.

use std::io::{self, Write};
use std::time::Duration;

use fringeflow_message::{Command, ControlRequest, ControlResponse};
use fringeflow_runtime::{RecorderStatus, dashboard_file, has_virtual_images};
use fringeflow_supervisor::{headline, read_startup_status};
use fringeflow_transport::{Instance, StartedInstance, TransportError, request};

use crate::failure::Failure;
use crate::json;

/// Longest wait for the response of an instance.
pub(super) const RESPONSE_TIMEOUT: Duration = Duration::from_secs(3);

/// A running instance.
#[derive(serde::Serialize)]
struct Entry {
    instance: String,
    /// Start of its supervisor, UTC.
    since: String,
    state: String,
    dashboard: Option<String>,
}

#[derive(serde::Serialize)]
struct Instances {
    instances: Vec<Entry>,
}

/// Lists the running instances of this user.
pub(super) fn list(as_json: bool) -> Result<(), Failure> {
    let instances: Vec<Entry> = Instance::list_started()?.iter().filter_map(entry).collect();
    if as_json {
        return json::print(&Instances { instances });
    }
    Ok(print(&mut io::stdout().lock(), &instances)?)
}

/// URL of the dashboard of an instance, if it has one.
pub(super) fn dashboard_url(instance: &Instance) -> Option<String> {
    std::fs::read_to_string(dashboard_file(instance)).ok()
}

/// Asks an instance for its state; returns `None` if its supervisor was killed.
fn entry(StartedInstance { instance, since }: &StartedInstance) -> Option<Entry> {
    let state_request = ControlRequest { command: Command::State as u32, ..ControlRequest::default() };
    let state = match request(instance, &state_request, RESPONSE_TIMEOUT) {
        Ok(ControlResponse { state, .. }) => {
            let (recorder, waiting) = (RecorderStatus::read(instance), read_startup_status(instance, &state));
            headline(&state, recorder.as_ref(), waiting.as_deref(), has_virtual_images(instance))
        }
        Err(TransportError::NotRunning { .. }) => return None,
        Err(error) => error.to_string(),
    };
    Some(Entry {
        instance: instance.name().to_owned(),
        since: humantime::format_rfc3339_seconds(*since).to_string(),
        state,
        dashboard: dashboard_url(instance),
    })
}

fn print(out: &mut impl Write, instances: &[Entry]) -> io::Result<()> {
    if instances.is_empty() {
        return writeln!(out, "No instance is running.");
    }
    let width = |title: &str, text: fn(&Entry) -> &str| {
        instances.iter().map(|entry| text(entry).chars().count()).chain([title.len()]).max().unwrap_or_default()
    };
    let names = width("NAME", |entry| &entry.instance);
    let dashboards = width("DASHBOARD", |entry| entry.dashboard.as_deref().unwrap_or("–"));
    writeln!(out, "{:<names$}  {:<20}  {:<dashboards$}  STATE", "NAME", "SINCE", "DASHBOARD")?;
    for Entry { instance, since, state, dashboard } in instances {
        let dashboard = dashboard.as_deref().unwrap_or("–");
        writeln!(out, "{instance:<names$}  {since:<20}  {dashboard:<dashboards$}  {state}")?;
    }
    writeln!(out, "`fringeflow status NAME` shows the details of one of them.")
}
