//! `fringeflow run --check`: checks everything that a run needs, without starting it.

use std::io::Write as _;
use std::path::Path;
use std::time::Duration;

use rustix::fs::{Access, access, statvfs};

use fringeflow_capture::{
    CameraError, ReadyCamera, SampleError, Wanted, check_cameras, check_stereo_camera, sample_images,
};
use fringeflow_config::{CameraSource, RecorderConfiguration, ScannerConfiguration, V4l2Camera};
use fringeflow_dataset::{GreyImage, Setup};
use fringeflow_pixels::ImageReader;
use fringeflow_runtime::{ServiceArgs, channel_sizes};
use fringeflow_transport::{Instance, InstanceLock, check_shared_memory, required_bytes};

use crate::failure::Failure;
use crate::image_health::image_faults_of;
use crate::json;

/// Bytes of a mebibyte.
const MIB: u64 = 1 << 20;

/// Time to wait for the images of a camera, besides twice the time of a cycle, seconds.
const SAMPLE_S: f64 = 2.0;

/// Result of the check of one thing that a run needs.
#[derive(serde::Serialize)]
struct CheckResult {
    what: &'static str,
    ready: bool,
    /// The state that was found, or the error.
    found: String,
}

#[derive(serde::Serialize)]
struct Report {
    ready: bool,
    points: Vec<CheckResult>,
}

impl CheckResult {
    fn new<E: std::fmt::Display>(what: &'static str, found: Result<String, E>) -> Self {
        let ready = found.is_ok();
        Self { what, ready, found: found.unwrap_or_else(|error| error.to_string()) }
    }
}

/// Checks everything that a run needs, and prints the results.
///
/// # Errors
/// A check failed.
pub(super) fn check(arguments: &ServiceArgs, json: bool) -> Result<(), Failure> {
    let points = check_all(arguments);
    let failed = points.iter().filter(|point| !point.ready).count();
    let report = Report { ready: failed == 0, points };
    if json {
        json::print(&report)?;
    } else {
        let mut out = std::io::stdout().lock();
        for CheckResult { what, ready, found } in &report.points {
            writeln!(out, "{} {what}: {found}", if *ready { "ok    " } else { "FAILED" })?;
        }
    }
    match failed {
        0 => Ok(()),
        failed => Err(Failure::Usage(format!("{failed} of {} checks failed, see above", report.points.len()))),
    }
}

fn check_all(arguments: &ServiceArgs) -> Vec<CheckResult> {
    let file = arguments.config.display();
    let configuration = match arguments.configuration() {
        Ok(configuration) => configuration,
        Err(error) => return vec![CheckResult::new("configuration", Err(error))],
    };
    let mut points = vec![CheckResult::new::<Failure>("configuration", Ok(file.to_string()))];
    if !configuration.processors.is_empty() {
        let processors = arguments.check_processors(&configuration);
        points.push(CheckResult::new(
            "processors",
            processors.map(|()| "this machine has all configured CPUs".to_owned()),
        ));
    }
    let setup = arguments.setup(&configuration);
    points.push(CheckResult::new("calibration and volume", setup.as_ref().map(rig_text)));
    if let Ok(setup) = &setup {
        let table = arguments.segment_table(&configuration, setup);
        points.push(CheckResult::new("segment table", table.map(|_| "can be used".to_owned())));
    }
    let cameras = camera_results(&configuration, setup.as_ref().ok());
    let can_sample = !cameras.is_empty() && cameras.iter().all(|camera| camera.ready);
    points.extend(cameras);
    if let Some(setup) = setup.as_ref().ok().filter(|_| can_sample) {
        points.push(CheckResult::new("images", Ok::<_, Failure>(images_text(&configuration, setup))));
    }
    if let Ok(setup) = &setup {
        points.push(CheckResult::new("shared memory", shared_memory(&configuration, setup)));
    }
    points.push(CheckResult::new("runtime folder", runtime_folder(&configuration)));
    points.push(CheckResult::new("recorder", recorder(&configuration.recorder)));
    points.push(CheckResult::new("monitor", fringeflow_monitor::check(&configuration.monitor)));
    points
}

fn rig_text(setup: &Setup) -> String {
    let [width, height] = setup.image_size_px;
    let volume = setup.volume.as_ref().map_or_else(String::new, |volume| {
        let [x, y, z] = [0, 1, 2].map(|axis| (volume.max()[axis] - volume.min()[axis]) * 1e3);
        format!(", volume {x:.0} x {y:.0} x {z:.0} mm")
    });
    format!("images of {width}x{height}, {} steps{volume}", setup.steps)
}

/// Checks the cameras; returns nothing unless they are V4L2 devices.
fn camera_results(configuration: &ScannerConfiguration, setup: Option<&Setup>) -> Vec<CheckResult> {
    let result = |(what, found): (_, Result<ReadyCamera, CameraError>)| {
        let text = |camera: ReadyCamera| format!("{}: {}", camera.path.display(), camera.notes.join(", "));
        CheckResult::new(what, found.map(text))
    };
    checked_cameras(configuration, setup).into_iter().map(result).collect()
}

/// Takes a cycle of images of each camera, and says what is wrong with them by the limits of `[health]`. This is no
/// failure: the projector may not run yet.
fn images_text(configuration: &ScannerConfiguration, setup: &Setup) -> String {
    let faults = sampled_images(configuration, setup)
        .map_err(|error| error.to_string())
        .and_then(|images| image_faults_of(&images, setup, &configuration.measurement).map_err(|e| e.to_string()));
    match faults {
        Err(error) => format!("not judged: {error}"),
        Ok(faults) if faults.is_empty() => "both cameras see fringes, well exposed".to_owned(),
        Ok(faults) => format!("warning: {}", faults.join("; ")),
    }
}

/// A cycle of images of both cameras.
fn sampled_images(configuration: &ScannerConfiguration, setup: &Setup) -> Result<[Vec<GreyImage>; 2], SampleError> {
    let wanted = wanted(configuration, setup);
    let timeout = Duration::from_secs_f64(SAMPLE_S + 2.0 * setup.steps as f64 / configuration.rate_hz);
    let sample = |camera: &V4l2Camera, views: usize| {
        let mut reader = ImageReader::new(wanted.images, setup.readout)?;
        sample_images(camera, &wanted, &mut reader, (views, setup.steps), timeout)
    };
    let mut views = match &configuration.cameras {
        CameraSource::Virtual | CameraSource::External => Vec::new(),
        CameraSource::V4l2(cameras) => {
            let [cam1, cam2] = cameras.as_ref();
            [sample(cam1, 1)?, sample(cam2, 1)?].concat()
        }
        CameraSource::V4l2Stereo(camera) => sample(camera, 2)?,
    };
    let cam2 = views.pop().unwrap_or_default();
    Ok([views.pop().unwrap_or_default(), cam2])
}

fn wanted(configuration: &ScannerConfiguration, setup: &Setup) -> Wanted {
    Wanted { images: configuration.device_images, view_px: setup.readout.sensor_px(), rate_hz: configuration.rate_hz }
}

/// Checks each V4L2 device, and names the cameras whose images it gives.
fn checked_cameras(
    configuration: &ScannerConfiguration,
    setup: Option<&Setup>,
) -> Vec<(&'static str, Result<ReadyCamera, CameraError>)> {
    let wanted = setup.map(|setup| wanted(configuration, setup));
    match &configuration.cameras {
        CameraSource::Virtual | CameraSource::External => Vec::new(),
        CameraSource::V4l2(cameras) => {
            ["camera 1", "camera 2"].into_iter().zip(check_cameras(cameras, wanted.as_ref())).collect()
        }
        CameraSource::V4l2Stereo(camera) => vec![("cameras 1 and 2", check_stereo_camera(camera, wanted.as_ref()))],
    }
}

/// Checks the settings of the cameras and the monitor. An absent or busy camera is not an error: its service waits for
/// it.
///
/// # Errors
/// A camera does not accept its settings, or the monitor cannot listen.
pub(super) fn refuse_settings(configuration: &ScannerConfiguration, setup: &Setup) -> Result<(), Failure> {
    for (what, found) in checked_cameras(configuration, Some(setup)) {
        if let Err(error) = found
            && error.is_lasting()
        {
            return Err(Failure::Usage(format!("{what}: {error}")));
        }
    }
    fringeflow_monitor::check(&configuration.monitor).map(drop).map_err(Failure::Usage)
}

fn shared_memory(configuration: &ScannerConfiguration, setup: &Setup) -> Result<String, Failure> {
    let sizes = channel_sizes(setup, configuration);
    let folder = check_shared_memory(&sizes)?;
    Ok(format!("{}: {} MiB are needed and available", folder.display(), required_bytes(&sizes).div_ceil(MIB)))
}

/// Checks the runtime folder: takes the lock of the instance and releases it.
fn runtime_folder(configuration: &ScannerConfiguration) -> Result<String, Failure> {
    let instance = Instance::new(&configuration.name)?;
    drop(InstanceLock::take(&instance)?);
    Ok(format!("{} can be used, and no instance {} is running", instance.runtime_dir().display(), instance.name()))
}

/// Checks that the folder of the recordings can be written, or created, and that the disk has free space.
fn recorder(recorder: &RecorderConfiguration) -> Result<String, String> {
    let folder = std::path::absolute(&recorder.folder).map_err(|e| format!("{}: {e}", recorder.folder.display()))?;
    let exists = |path: &&Path| path.symlink_metadata().is_ok();
    let existing = folder.ancestors().find(exists).unwrap_or(Path::new("/"));
    if !existing.is_dir() {
        return Err(format!("{}: it is not a folder; name another folder as recorder.folder", existing.display()));
    }
    let fail = |e: rustix::io::Errno| format!("{}: {e}; name another folder as recorder.folder", existing.display());
    access(existing, Access::WRITE_OK | Access::EXEC_OK).map_err(fail)?;
    let disk = statvfs(existing).map_err(fail)?;
    let free = disk.f_bavail.saturating_mul(disk.f_frsize);
    let [free_mib, kept_mib] = [free / MIB, recorder.min_free_bytes / MIB];
    if free <= recorder.min_free_bytes {
        return Err(format!(
            "{}: {free_mib} MiB are free, but recorder.min_free_mb keeps {kept_mib} MiB free; make room or lower it",
            existing.display()
        ));
    }
    Ok(format!("{}: {} MiB are free for recordings", folder.display(), free_mib.saturating_sub(kept_mib)))
}
