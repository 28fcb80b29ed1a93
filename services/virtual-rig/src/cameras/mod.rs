//! The virtual cameras service. Both cameras run in one process, because they share the scene and the trigger.

mod camera;
mod capture;
mod images;
mod trigger;
mod trigger_source;

use std::time::Duration;

use fringeflow_dataset::CameraId;
use fringeflow_lab::simulation::{ConfiguredScanner, Faults};
use fringeflow_runtime::{Host, MAX_WAIT, ServiceArgs, ServiceError, clock};

use capture::Capture;
use trigger_source::TriggerSource;

pub use camera::{ExposureResult, Shot, Timing, VirtualCamera};
pub use trigger::{CableTriggers, ClockTriggers, Trigger};

/// Runs the service until it is asked to stop.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    let mut host = Host::open(arguments, "virtual-cameras")?;
    let unusable = |what: String| ServiceError::Unusable(what);
    let configured =
        ConfiguredScanner::from_scanner_configuration(&host.configuration).map_err(|e| unusable(e.to_string()))?;
    let Some(options) = configured else {
        let why = "the configuration has no virtual scanner; set cameras.source = \"virtual\"";
        return Err(unusable(why.to_owned()));
    };
    let faults = Faults::new(options.faults).map_err(|e| unusable(e.to_string()))?;
    let Some(images) = images::load_or_render(&host, &options)? else { return Ok(()) };
    let session = clock::now_ns();
    let [cam1, cam2] = CameraId::BOTH.map(|id| Capture::open(&host, id, session, faults));
    let (mut cameras, mut source) = ([cam1?, cam2?], TriggerSource::open(&host)?);
    while !host.stop.is_requested() {
        source.trigger(&mut cameras)?;
        for camera in &mut cameras {
            camera.publish_arrived(&mut host, &images)?;
        }
        if host.is_heartbeat_due() {
            cameras.iter().for_each(|camera| camera.report(&mut host));
        }
        host.check_connections(|_, now_ns| {
            cameras.iter_mut().try_for_each(Capture::ensure_connected)?;
            source.ensure_connected(now_ns)
        });
        let next_ns = cameras.iter().filter_map(Capture::next_ns).chain(source.next_ns()).min().unwrap_or(u64::MAX);
        source.wait(Duration::from_nanos(next_ns.saturating_sub(clock::now_ns())).min(MAX_WAIT))?;
    }
    for camera in &mut cameras {
        camera.drop_in_transit()?;
        camera.report(&mut host);
    }
    Ok(())
}
