//! `fringeflow service`: one service of an instance, in a process that the supervisor starts.

use fringeflow_capture::CapturedCameras;
use fringeflow_dataset::CameraId;
use fringeflow_recorder::Outcome;
use fringeflow_runtime::{ServiceArgs, ServiceError, ServiceKind};

use crate::acting_options::{ActingOptions, Mode};
use crate::failure::Failure;
use crate::globals::Globals;

/// Arguments of `fringeflow service`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    service: Service,
}

#[derive(clap::Subcommand)]
enum Service {
    /// Publish the pattern events of a virtual projector.
    VirtualProjector(ServiceArgs),
    /// Publish the images of both cameras of a virtual scanner.
    VirtualCameras(ServiceArgs),
    /// Capture the images of camera 1, a V4L2 device.
    Camera1(ServiceArgs),
    /// Capture the images of camera 2, a V4L2 device.
    Camera2(ServiceArgs),
    /// Capture the images of both cameras from one V4L2 device.
    StereoCamera(ServiceArgs),
    /// Compute phase maps from images.
    Phase(ServiceArgs),
    /// Find correspondences in phase maps.
    Correspondence(ServiceArgs),
    /// Triangulate clouds from correspondences.
    Cloud(ServiceArgs),
    /// Track the scanner, and fuse the clouds into a model.
    Tracking(ServiceArgs),
    /// Record all channels.
    Recorder(ServiceArgs),
    /// Serve metrics, dashboard and live view.
    Monitor(ServiceArgs),
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["config", "virtual_images", "setup", "restarts", "supervised", "threads", "simd", "log_format"],
    choices: &[&[
        Mode {
            name: "for correspondence and cloud",
            is_chosen: |args| args.service.kind().reads_segment_table(),
            options: &["segment_table"],
        },
        Mode { name: "for this service", is_chosen: |_| true, options: &[] },
    ]],
};

impl Args {
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        globals.start_log(self.service.kind().name());
        self.service.run().map_err(Failure::Service)?.map_or(Ok(()), |losses| Err(Failure::Losses(losses)))
    }
}

impl Service {
    fn kind(&self) -> ServiceKind {
        match self {
            Self::VirtualProjector(_) => ServiceKind::VirtualProjector,
            Self::VirtualCameras(_) => ServiceKind::VirtualCameras,
            Self::Camera1(_) => ServiceKind::Camera1,
            Self::Camera2(_) => ServiceKind::Camera2,
            Self::StereoCamera(_) => ServiceKind::StereoCamera,
            Self::Phase(_) => ServiceKind::Phase,
            Self::Correspondence(_) => ServiceKind::Correspondence,
            Self::Cloud(_) => ServiceKind::Cloud,
            Self::Tracking(_) => ServiceKind::Tracking,
            Self::Monitor(_) => ServiceKind::Monitor,
            Self::Recorder(_) => ServiceKind::Recorder,
        }
    }

    /// Runs the service until it has to stop. Returns a message if the recordings are incomplete.
    fn run(&self) -> Result<Option<String>, ServiceError> {
        let done = match self {
            Self::VirtualProjector(arguments) => fringeflow_virtual_rig::projector::run(arguments),
            Self::VirtualCameras(arguments) => fringeflow_virtual_rig::cameras::run(arguments),
            Self::Camera1(arguments) => fringeflow_capture::run(arguments, CapturedCameras::One(CameraId::Cam1)),
            Self::Camera2(arguments) => fringeflow_capture::run(arguments, CapturedCameras::One(CameraId::Cam2)),
            Self::StereoCamera(arguments) => fringeflow_capture::run(arguments, CapturedCameras::Both),
            Self::Phase(arguments) => fringeflow_stages::phase::run(arguments),
            Self::Correspondence(arguments) => fringeflow_stages::correspondence::run(arguments),
            Self::Cloud(arguments) => fringeflow_stages::cloud::run(arguments),
            Self::Tracking(arguments) => fringeflow_stages::tracking::run(arguments),
            Self::Monitor(arguments) => fringeflow_monitor::run(arguments),
            Self::Recorder(arguments) => return Ok(losses(fringeflow_recorder::run(arguments)?)),
        };
        done.map(|()| None)
    }
}

fn losses(outcome: Outcome) -> Option<String> {
    (outcome == Outcome::Incomplete).then(|| "recordings of this run are incomplete".to_owned())
}
