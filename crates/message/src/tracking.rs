//! Pose of the scanner, prior of the next windows, and the fused model.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use crate::codes::codes;
use crate::{DriftNumbers, Window};

codes! {
    /// How a cloud was registered to the model.
    pub enum TrackingState {
        First = 0, "first", "the first cloud of a model; it defines the frame of the model";
        Tracked = 1, "tracked", "registered from the expected pose";
        Relocalized = 2, "relocalized", "registered from the last known pose, after the expected pose had failed";
        Lost = 3, "lost", "not found on the model; the cloud has no pose and changes nothing";
    }
}

codes! {
    /// Why a cloud was not found on the model.
    pub enum LostReason {
        TooFewInCommon = 1, "too_few_in_common", "the overlap with the model is too small";
        ResidualTooLarge = 2, "residual_too_large", "the distances to the model are too large";
        Degenerate = 3, "degenerate", "the surface does not determine the pose: some motion hardly changes the distances";
        NotConverged = 4, "not_converged", "the cloud still moved in the last iterations";
    }
}

/// Pose of camera 1 at a cloud, in the frame of the model. That frame is the pose of camera 1 at the first cloud.
///
/// The pose was computed from the earlier clouds of the model: those whose reports have the same `first_cloud`, in
/// their order. If the cloud was lost, the fields of the pose are 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.PoseReport.2")]
pub struct PoseReport {
    /// Number of reports published on the channel before this one.
    pub published: u64,
    /// Number of the cloud in its channel.
    pub cloud: u64,
    /// Number of the first cloud of the model.
    pub first_cloud: u64,
    /// The images of the cloud.
    pub window: Window,
    /// When the report was published.
    pub published_ns: u64,
    /// Position of camera 1, metres.
    pub position_m: [f64; 3],
    /// Rotation of camera 1 as a quaternion: x, y, z, w.
    pub rotation: [f64; 4],
    /// Covariance of the pose error, a small motion `x + t + ω × x` in the frame of the model: t (metres), then ω
    /// (rad).
    pub covariance: [[f64; 6]; 6],
    /// Standard deviation of the position of the model centre, combined over all directions, metres.
    pub sd_m: f64,
    /// Standard deviation of the rotation, combined over all axes, rad.
    pub sd_rad: f64,
    /// Root mean square of the distances to the planes of the model, metres.
    pub rms_m: f64,
    /// Ratio of these distances to those that noise alone would cause.
    pub excess: f64,
    /// Share of the examined points that have a partner in the model.
    pub share: f64,
    /// Points with a partner.
    pub inliers: u64,
    /// Points of the model, after this cloud.
    pub model_points: u64,
    /// Clouds in the model.
    pub model_clouds: u64,
    /// [`TrackingState`].
    pub state: u32,
    /// [`LostReason`]; 0 if the cloud has a pose.
    pub reason: u32,
}

/// Prior of the next windows, computed from a cloud: motion of the scanner, coarse depth, and drift of the calibration.
/// See `fringeflow::prior`.
///
/// The payload is the coarse depth: one inverse depth (`u16`, little-endian) for each square of 16 × 16 pixels of
/// camera 1, row by row, in units of 30/65535 of 1/m, or 0 if the cloud has no point in the square. If nothing is
/// known, the payload is empty and the motion is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.PriorHeader.2")]
pub struct PriorHeader {
    /// Number of messages published on the channel before this one; there is one for each pose report.
    pub published: u64,
    /// Number of the cloud in its channel.
    pub cloud: u64,
    /// Time of the cloud, the midpoint of its exposures.
    pub centre_ns: u64,
    /// When the prior was published. A window uses the last prior published before the arrival of its last image.
    pub published_ns: u64,
    /// Velocity of camera 1 in its own frame, m/s.
    pub velocity_m_s: [f64; 3],
    /// Angular velocity of camera 1 in its own frame, rad/s.
    pub rate_rad_s: [f64; 3],
    /// Width of the images of camera 1, pixels; 0 if nothing is known.
    pub width_px: u32,
    /// Height, pixels.
    pub height_px: u32,
    /// The drift of the calibration found in the cloud.
    pub drift: DriftNumbers,
}

/// Describes the points of the model for viewers: a subset of limited size.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.ModelHeader.1")]
pub struct ModelHeader {
    /// Number of the first cloud of the model.
    pub first_cloud: u64,
    /// Clouds in the model.
    pub clouds: u64,
    /// Points of the model.
    pub model_points: u64,
    /// Points in the payload, of [`MODEL_POINT_BYTES`] each.
    pub points: u64,
    /// Voxel size of the subset, which has one point per voxel, metres; 0 if all points are shown.
    pub voxel_m: f64,
    /// Time of the last cloud in the model, the midpoint of its exposures.
    pub centre_ns: u64,
    /// When the message was published.
    pub published_ns: u64,
}

/// Size of a point of the model, bytes. Its fields are x, y, z and standard deviation (`f32`, metres), the number of
/// clouds that measured it (`u16`), its grey level (`u8`), and 0; little-endian.
pub const MODEL_POINT_BYTES: usize = 20;

impl PriorHeader {
    /// Maximum latency of a message to its receiver, nanoseconds.
    const LATENCY_NS: u64 = 1_000_000;

    /// Whether a window whose last image arrived at `received_ns` may use this prior. By then every receiver has the
    /// prior, both live and in a replay.
    #[must_use]
    pub fn is_settled_at(&self, received_ns: u64) -> bool {
        self.published_ns.saturating_add(Self::LATENCY_NS) <= received_ns
    }
}

impl PoseReport {
    /// Returns the tracking state of the cloud; `None` for an unknown code.
    #[must_use]
    pub fn state(&self) -> Option<TrackingState> {
        TrackingState::from_code(self.state)
    }

    /// Returns the reason why the cloud was lost; `None` if it was not lost.
    #[must_use]
    pub fn reason(&self) -> Option<LostReason> {
        LostReason::from_code(self.reason)
    }

    /// Whether the cloud has a pose.
    #[must_use]
    pub fn has_pose(&self) -> bool {
        self.state().is_some_and(|state| state != TrackingState::Lost)
    }
}

impl Default for PoseReport {
    fn default() -> Self {
        Self::zeroed()
    }
}
