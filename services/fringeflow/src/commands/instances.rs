//! `fringeflow status` without a name: which instances run.

use std::io::{self, Write};

use fringeflow_message::{Command, ControlRequest};
use fringeflow_supervisor::{headline, waiting_from_outside};
use fringeflow_transport::{Begun, Instance, TransportError, request};

use crate::failure::Failure;
use crate::json;

use super::status::{ANSWER, dashboard};

/// An instance that runs.
#[derive(serde::Serialize)]
struct Entry {
    instance: String,
    /// When its supervisor began, UTC.
    since: String,
    state: String,
    dashboard: Option<String>,
}

#[derive(serde::Serialize)]
struct Instances {
    instances: Vec<Entry>,
}

/// Lists the instances of this user that run.
pub(super) fn list(as_json: bool) -> Result<(), Failure> {
    let instances: Vec<Entry> = Instance::begun()?.iter().filter_map(entry).collect();
    if as_json {
        return json::print(&Instances { instances });
    }
    Ok(print(&mut io::stdout().lock(), &instances)?)
}

/// `None` for an instance whose supervisor was killed.
fn entry(Begun { instance, since }: &Begun) -> Option<Entry> {
    let asked = ControlRequest { command: Command::State as u32, ..ControlRequest::default() };
    let state = match request(instance, &asked, ANSWER) {
        Ok(response) => headline(&response.state, waiting_from_outside(instance, &response.state).as_deref()),
        Err(TransportError::NotRunning { .. }) => return None,
        Err(error) => error.to_string(),
    };
    Some(Entry {
        instance: instance.name().to_owned(),
        since: humantime::format_rfc3339_seconds(*since).to_string(),
        state,
        dashboard: dashboard(instance),
    })
}

fn print(out: &mut impl Write, instances: &[Entry]) -> io::Result<()> {
    if instances.is_empty() {
        return writeln!(out, "No instance is running.");
    }
    let width = |title: &str, of: fn(&Entry) -> &str| {
        instances.iter().map(|entry| of(entry).chars().count()).chain([title.len()]).max().unwrap_or_default()
    };
    let names = width("NAME", |entry| &entry.instance);
    let dashboards = width("DASHBOARD", |entry| entry.dashboard.as_deref().unwrap_or("–"));
    writeln!(out, "{:<names$}  {:<20}  {:<dashboards$}  STATE", "NAME", "SINCE", "DASHBOARD")?;
    for Entry { instance, since, state, dashboard } in instances {
        let dashboard = dashboard.as_deref().unwrap_or("–");
        writeln!(out, "{instance:<names$}  {since:<20}  {dashboard:<dashboards$}  {state}")?;
    }
    writeln!(out, "`fringeflow status NAME` shows one of them in full.")
}
