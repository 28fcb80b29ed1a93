//! The whole calibration from observations: each device alone, their arrangement, then all together.
//!
//! In: observations of the board. Out: the adjusted state, or why there is none. Cost: about a second for 20 views.

use fringeflow::calibration::Cameras;
use fringeflow::geometry::{Pose, Rig};
use nalgebra::Vector2;

use crate::adjustment::{Adjusted, Device, Layout, Measured, Measurement, PROJECTOR, Problem, State, adjust};
use crate::initial::{Arrangement, DeviceViews, Devices, PlaneImage, SingleDevice, calibrate_device};
use crate::lens::INTRINSICS;
use crate::observations::{CameraView, View};
use crate::shape::BoardShape;

/// Groups of measurements: corners of C1 and C2, and the projector through C1 and C2.
pub const GROUPS: usize = 4;
/// Fewest points of a view from which a pose is computed.
const FEWEST_POINTS: usize = 6;
/// A view whose cameras disagree by this multiple of the median was not taken of one pose.
const OTHER_POSE: f64 = 8.0;
/// Exchanged images fit better by this factor when they are exchanged back. They do not fit well, since each is then seen
/// through the lens of the other camera.
const EXCHANGED: f64 = 0.5;
/// Disagreement that calibrations of each device alone may have, pixels.
const ALONE_PX: f64 = 2.0;

/// Observations of a board by a rig.
#[derive(Clone, Debug)]
pub struct RigViews {
    /// Positions of the features of the board, metres.
    pub features_m: Vec<Vector2<f64>>,
    /// Whether the board looks the same after half a turn.
    pub symmetric: bool,
    /// Whether the board's deviation from a plane is estimated.
    pub free_shape: bool,
    /// Images of the devices (width, height), pixels: the cameras, and the projector if there are phases.
    pub sizes_px: Vec<[usize; 2]>,
    /// All poses.
    pub views: Vec<View>,
}

/// A view in which the cameras do not see one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OtherPose {
    /// Number of the view.
    pub view: usize,
    /// Distance between where C2 sees the board and where it should, pixels.
    pub deviation_px: f64,
    /// The view whose image of C2 shows the pose that C1 sees here.
    pub partner: Option<usize>,
    /// Whether the images fit with the cameras exchanged.
    pub exchanged: bool,
}

/// Why there is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoCalibration {
    /// Too few poses show the board to a device.
    #[error("{device} sees the board in {views} poses; at least 3 are needed, and 15 to 25 make a good calibration")]
    TooFewViews {
        /// The device.
        device: DeviceName,
        /// Poses that it sees.
        views: usize,
    },
    /// The views of a device do not determine its lens.
    #[error(
        "the poses of the board do not determine the lens of {device}: take poses with tilts of 20° to 45° about both axes"
    )]
    NoLens {
        /// The device.
        device: DeviceName,
    },
    /// The cameras do not see the same poses.
    #[error("{0}")]
    OtherPoses(String),
    /// The equations of the whole rig have no solution.
    #[error("the whole rig has no calibration that fits its images; check that no device moved between the poses")]
    NoSolution,
}

/// A device in messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceName {
    /// Camera 1 or 2.
    Camera(usize),
    /// The projector.
    Projector,
}

impl DeviceName {
    /// The device with a number.
    #[must_use]
    pub fn of(device: usize) -> Self {
        if device == PROJECTOR { Self::Projector } else { Self::Camera(device + 1) }
    }
}

impl std::fmt::Display for DeviceName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Camera(number) => write!(f, "camera {number}"),
            Self::Projector => write!(f, "the projector"),
        }
    }
}

/// What a board that was taken for a plane seems to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// From its lowest to its highest feature, metres.
    pub height_m: f64,
    /// Root mean square by which the parameters of the rig would change with a bent board, in standard deviations.
    pub change_sds: f64,
}

/// A calibrated rig.
#[derive(Clone, Debug)]
pub struct CalibratedRig {
    /// The problem that was solved.
    pub problem: Problem,
    /// Its solution.
    pub adjusted: Adjusted,
    /// The view of each pose of the board in the state.
    pub views: Vec<usize>,
    /// Root mean square of the residuals of each device calibrated alone, pixels.
    pub alone_rms_px: Vec<f64>,
    /// How the board deviates from a plane, if it was taken for one; `None` if its shape is estimated anyway.
    pub bend: Option<Bend>,
    /// Views in which the cameras see different poses. C2 takes no part in them.
    pub other_poses: Vec<OtherPose>,
}

impl CalibratedRig {
    /// Both cameras.
    #[must_use]
    pub fn cameras(&self) -> Option<Cameras> {
        let [first, second, ..] = self.adjusted.state.devices[..] else { return None };
        Some(Cameras {
            cam1: first.lens.camera(self.problem.sizes_px[0]),
            cam2: second.lens.camera(self.problem.sizes_px[1]),
            cam2_from_cam1: second.from_first,
        })
    }

    /// The rig; `None` without a projector.
    #[must_use]
    pub fn rig(&self) -> Option<Rig> {
        let [first, second, projector] = self.adjusted.state.devices[..] else { return None };
        let size = |device: usize| self.problem.sizes_px[device];
        Some(Rig {
            cam1: first.lens.camera(size(0)),
            cam2: second.lens.camera(size(1)),
            projector: projector.lens.camera(size(PROJECTOR)),
            cam2_from_cam1: second.from_first,
            projector_from_cam1: projector.from_first,
        })
    }
}

/// Calibrates a rig.
///
/// # Errors
/// [`NoCalibration`].
pub fn calibrate(input: &RigViews) -> Result<CalibratedRig, NoCalibration> {
    let mut views = input.views.clone();
    let cameras = [alone(input, &views, 0)?, alone(input, &views, 1)?];
    let probes_m = probes(&input.features_m);
    let devices = Devices {
        first: &cameras[0].poses,
        second: &cameras[1].poses,
        lens: &cameras[1].lens,
        probes_m: &probes_m,
        symmetric: input.symmetric,
    };
    let arrangement = devices.arrangement().ok_or_else(no_common_views)?;
    let other_poses = other_poses(&devices, &arrangement);
    check_pairs(&other_poses, &arrangement)?;
    for (view, fit) in views.iter_mut().zip(&arrangement.views) {
        if fit.is_some_and(|fit| fit.half_turn) {
            turn_labels(&mut view.cameras[1], &input.features_m);
        }
    }
    for other in &other_poses {
        views[other.view].cameras[1] = CameraView::default();
    }
    let mut alone_devices = cameras.to_vec();
    let mut from_first = vec![Pose::identity(), arrangement.second_from_first];
    if input.sizes_px.len() > PROJECTOR {
        let projector = alone(input, &views, PROJECTOR)?;
        let devices = Devices {
            first: &cameras[0].poses,
            second: &projector.poses,
            lens: &projector.lens,
            probes_m: &probes_m,
            symmetric: false,
        };
        from_first.push(devices.arrangement().ok_or_else(no_common_views)?.second_from_first);
        alone_devices.push(projector);
    }
    joint(input, &views, &alone_devices, &from_first, other_poses)
}

fn no_common_views() -> NoCalibration {
    NoCalibration::OtherPoses("no pose is seen by both cameras; take poses in which both see the board".to_owned())
}

/// Calibrates one device alone.
fn alone(input: &RigViews, views: &[View], device: usize) -> Result<SingleDevice, NoCalibration> {
    let images: Vec<PlaneImage> = views.iter().map(|view| plane_image(view, device)).collect();
    let usable = images.iter().filter(|image| image.len() >= FEWEST_POINTS).count();
    let name = DeviceName::of(device);
    if usable < 3 {
        return Err(NoCalibration::TooFewViews { device: name, views: usable });
    }
    let views = images.into_iter().map(|image| if image.len() >= FEWEST_POINTS { image } else { Vec::new() });
    let device =
        DeviceViews { features_m: input.features_m.clone(), size_px: input.sizes_px[device], views: views.collect() };
    calibrate_device(&device).ok_or(NoCalibration::NoLens { device: name })
}

/// What a device sees of a view. The projector sees what C1 tells of it, and what C2 tells of other features.
fn plane_image(view: &View, device: usize) -> PlaneImage {
    if device < PROJECTOR {
        return view.cameras[device].corners.iter().map(|corner| (corner.feature, corner.pixel)).collect();
    }
    let mut image = PlaneImage::new();
    for patch in view.cameras.iter().flat_map(|camera| &camera.patches) {
        if image.iter().all(|(feature, _)| *feature != patch.feature) {
            image.push((patch.feature, patch.at(&patch.centre).0.into()));
        }
    }
    image
}

/// Some points spread over the board: every tenth feature, and the last.
fn probes(features_m: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    features_m.iter().step_by(10).chain(features_m.last()).copied().collect()
}

/// The views whose images of both cameras show different poses.
fn other_poses(devices: &Devices<'_>, arrangement: &Arrangement) -> Vec<OtherPose> {
    let limit_px = OTHER_POSE * arrangement.median_px + ALONE_PX;
    let fits = arrangement.views.iter().enumerate().filter_map(|(view, fit)| Some((view, fit.as_ref()?.deviation_px)));
    let deviating: Vec<_> = fits.filter(|(_, deviation_px)| *deviation_px > limit_px).collect();
    // A median of many pixels means that hardly a pair shows one pose. Then the limit must not grow with it.
    let is_median_of_one_pose = arrangement.median_px <= ALONE_PX;
    if deviating.is_empty() && is_median_of_one_pose {
        return Vec::new();
    }
    let limit_px = if is_median_of_one_pose { limit_px } else { OTHER_POSE * ALONE_PX };
    let partners = devices.partners(limit_px);
    let other = |(view, deviation_px)| OtherPose {
        view,
        deviation_px,
        partner: partners.get(view).copied().flatten().filter(|&partner| partner != view),
        exchanged: devices
            .exchanged_px(&arrangement.second_from_first, view)
            .is_some_and(|exchanged_px| exchanged_px < EXCHANGED * deviation_px),
    };
    if is_median_of_one_pose {
        return deviating.into_iter().map(other).collect();
    }
    let fits = arrangement.views.iter().enumerate().filter_map(|(view, fit)| Some((view, fit.as_ref()?.deviation_px)));
    fits.map(other).filter(|other| other.partner.is_some()).collect()
}

/// Refuses a set of which most pairs show different poses.
fn check_pairs(other_poses: &[OtherPose], arrangement: &Arrangement) -> Result<(), NoCalibration> {
    let pairs = arrangement.views.iter().flatten().count();
    if 2 * other_poses.len() < pairs {
        return Ok(());
    }
    let example = other_poses.iter().find_map(|other| Some((other.view, other.partner?)));
    let found = example.map_or_else(String::new, |(view, partner)| {
        format!(": what camera 1 sees in view {view}, camera 2 sees in view {partner}")
    });
    Err(NoCalibration::OtherPoses(format!(
        "the images of both cameras show different poses in {} of {pairs} views{found}; pair images of the same moment",
        other_poses.len()
    )))
}

/// Counts the features from the opposite corner of the board.
fn turn_labels(view: &mut CameraView, features_m: &[Vector2<f64>]) {
    let opposite = |feature: usize| {
        let distance = |k: &usize| (features_m[*k] + features_m[feature]).norm();
        (0..features_m.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(feature)
    };
    view.corners.iter_mut().for_each(|corner| corner.feature = opposite(corner.feature));
    view.patches.iter_mut().for_each(|patch| patch.feature = opposite(patch.feature));
}

/// Adjusts all devices together.
fn joint(
    input: &RigViews,
    views: &[View],
    alone: &[SingleDevice],
    from_first: &[Pose],
    other_poses: Vec<OtherPose>,
) -> Result<CalibratedRig, NoCalibration> {
    let (mut measurements, mut boards, mut views_of_boards) = (Vec::new(), Vec::new(), Vec::new());
    for (number, view) in views.iter().enumerate() {
        let second = || Some(from_first[1].inverse() * alone[1].poses[number]?);
        let Some(pose) = alone[0].poses[number].or_else(second) else { continue };
        push_measurements(&mut measurements, boards.len(), view, from_first.len() > PROJECTOR);
        boards.push(pose);
        views_of_boards.push(number);
    }
    let half_size_m = input.features_m.iter().map(|f| f.amax()).fold(0.0, f64::max);
    let shape = if input.free_shape { BoardShape::free(half_size_m) } else { BoardShape::flat() };
    let devices = alone.iter().zip(from_first).map(|(device, &from_first)| Device { lens: device.lens, from_first });
    let state = State { devices: devices.collect(), boards, shape };
    let problem = Problem {
        features_m: input.features_m.clone(),
        measurements,
        sizes_px: input.sizes_px.clone(),
        groups: GROUPS,
    };
    let adjusted = adjust(&problem, state).ok_or(NoCalibration::NoSolution)?;
    let bend = (!input.free_shape).then(|| bend(&problem, &adjusted, half_size_m)).flatten();
    let alone_rms_px = alone.iter().map(|device| device.rms_px).collect();
    Ok(CalibratedRig { problem, adjusted, views: views_of_boards, alone_rms_px, bend, other_poses })
}

/// What the board is if its shape is free, and what that changes.
fn bend(problem: &Problem, flat: &Adjusted, half_size_m: f64) -> Option<Bend> {
    let start = State { shape: BoardShape::free(half_size_m), ..flat.state.clone() };
    let free = adjust(problem, start)?;
    let heights = problem.features_m.iter().map(|feature| free.state.shape.point(*feature).z);
    let (low, high) = (heights.clone().fold(f64::INFINITY, f64::min), heights.fold(f64::NEG_INFINITY, f64::max));
    let lenses = flat.state.devices.iter().zip(&free.state.devices).enumerate();
    let layout = Layout::of(&flat.state);
    let changes: Vec<f64> = lenses
        .flat_map(|(device, (flat_device, free_device))| {
            (0..INTRINSICS)
                .map(move |k| (free_device.lens.0[k] - flat_device.lens.0[k]) / flat.sd(layout.lens(device) + k))
        })
        .collect();
    let square: f64 = changes.iter().map(|change| change * change).sum();
    Some(Bend { height_m: high - low, change_sds: (square / changes.len() as f64).sqrt() })
}

fn push_measurements(measurements: &mut Vec<Measurement>, number: usize, view: &View, with_phase: bool) {
    for (device, camera) in view.cameras.iter().enumerate() {
        measurements.extend(camera.corners.iter().map(|corner| Measurement {
            view: number,
            feature: corner.feature,
            device,
            group: device,
            measured: Measured::Pixel(corner.pixel, corner.sd_px),
        }));
        let patches = camera.patches.iter().filter(|_| with_phase);
        measurements.extend(patches.map(|patch| Measurement {
            view: number,
            feature: patch.feature,
            device,
            group: PROJECTOR + device,
            measured: Measured::Phase(*patch),
        }));
    }
}
