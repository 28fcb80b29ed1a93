//! Where the scanner stands, and the model that its clouds make.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use super::{DriftNumbers, Window};

/// What became of a cloud that was tracked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum TrackingState {
    /// The first of a model: it makes its frame.
    First = 0,
    /// Registered to the model where it was expected.
    Tracked = 1,
    /// Registered to the model from the last known pose, after the expectation had failed.
    Relocalized = 2,
    /// Not found on the model: it has no pose, and changes nothing.
    Lost = 3,
}

/// Why a cloud was not found on the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum LostReason {
    /// The surfaces have too little in common.
    TooFewInCommon = 1,
    /// The surfaces do not lie on each other.
    ResidualTooLarge = 2,
    /// A motion leaves the distances nearly as they are.
    Degenerate = 3,
    /// The last steps were still large.
    NotConverged = 4,
}

/// Pose of camera 1 at a cloud, in the frame of the model: that of camera 1 at its first cloud.
///
/// A pose follows from the clouds that had one before it, in their order: those whose reports have the same `first_cloud`.
/// The fields of the pose are 0 where the cloud was lost.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.PoseReport.2")]
pub struct PoseReport {
    /// Reports that this channel has carried before.
    pub published: u64,
    /// Number of the cloud in its channel.
    pub cloud: u64,
    /// Number of the first cloud of the model.
    pub first_cloud: u64,
    /// The images of the cloud.
    pub window: Window,
    /// When it was published.
    pub published_ns: u64,
    /// Place of camera 1, metres.
    pub position_m: [f64; 3],
    /// Its turn as a quaternion: x, y, z, w.
    pub rotation: [f64; 4],
    /// Covariance of the error of the pose as a small motion `x + t + ω × x` of the model's frame, row by row: t (metres)
    /// before ω (rad).
    pub covariance: [[f64; 6]; 6],
    /// Standard deviation of where the pose puts the middle of the model, all directions together, metres.
    pub sd_m: f64,
    /// Standard deviation of its turn, all axes together, rad.
    pub sd_rad: f64,
    /// Root mean square of the distances to the planes of the model, metres.
    pub rms_m: f64,
    /// How many times larger these are than noise alone would make them.
    pub excess: f64,
    /// Share of the points looked at that have a partner in the model.
    pub share: f64,
    /// Points that have one.
    pub inliers: u64,
    /// Points of the model, after this cloud.
    pub model_points: u64,
    /// Clouds that the model is made of.
    pub model_clouds: u64,
    /// [`TrackingState`].
    pub state: u32,
    /// [`LostReason`]; 0 for a cloud that has a pose.
    pub reason: u32,
}

/// What is known of the next windows after a cloud: how the scanner moves, roughly what it sees, and by how much the calibration errs,
/// see `fringeflow::prior`. The payload is the relief: an inverse depth (`u16`, little-endian) for each square of 16 × 16 pixels of camera
/// 1, row by row, in units of 30/65535 of 1/m, 0 where nothing was seen. Where nothing is known it is empty, and the numbers of the
/// motion are 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.PriorHeader.2")]
pub struct PriorHeader {
    /// Messages that this channel has carried before: one with each pose report.
    pub published: u64,
    /// Number of the cloud in its channel.
    pub cloud: u64,
    /// Time of the cloud: the middle of its exposures.
    pub centre_ns: u64,
    /// When it was published. Windows take the last one that was published before their last image came.
    pub published_ns: u64,
    /// Velocity of camera 1 in its own frame, metres a second.
    pub velocity_m_s: [f64; 3],
    /// Its turn about an axis, in its own frame, rad a second.
    pub rate_rad_s: [f64; 3],
    /// Width of the images of camera 1, pixels; 0 where nothing is known.
    pub width_px: u32,
    /// Height, pixels.
    pub height_px: u32,
    /// The drift of the calibration that the cloud showed.
    pub drift: DriftNumbers,
}

/// Describes the points of the model that are shown: some, so that they are few enough.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.ModelHeader.1")]
pub struct ModelHeader {
    /// Number of the first cloud of the model.
    pub first_cloud: u64,
    /// Clouds that it is made of.
    pub clouds: u64,
    /// Its points.
    pub model_points: u64,
    /// Points of the payload, of [`MODEL_POINT_BYTES`] each.
    pub points: u64,
    /// Side of the cubes of which each has one point at most, metres; 0 where all points are shown.
    pub voxel_m: f64,
    /// Time of the last cloud in it: the middle of its exposures.
    pub centre_ns: u64,
    /// When it was published.
    pub published_ns: u64,
}

/// Bytes of a point of the model: x, y, z and standard deviation (`f32`, metres), clouds that measured it (`u16`), grey level
/// (`u8`), 0; little-endian.
pub const MODEL_POINT_BYTES: usize = 20;

impl TrackingState {
    /// All states.
    pub const ALL: [Self; 4] = [Self::First, Self::Tracked, Self::Relocalized, Self::Lost];

    /// Name in reports, metrics and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Tracked => "tracked",
            Self::Relocalized => "relocalized",
            Self::Lost => "lost",
        }
    }
}

impl LostReason {
    /// All reasons.
    pub const ALL: [Self; 4] = [Self::TooFewInCommon, Self::ResidualTooLarge, Self::Degenerate, Self::NotConverged];

    /// Name in reports, metrics and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::TooFewInCommon => "too_few_in_common",
            Self::ResidualTooLarge => "residual_too_large",
            Self::Degenerate => "degenerate",
            Self::NotConverged => "not_converged",
        }
    }
}

impl PriorHeader {
    /// Time that a message may take to its receiver, nanoseconds.
    const WAY_NS: u64 = 1_000_000;

    /// Whether a window whose last image came at a time may take it: every receiver had it by then, live as in a replay.
    #[must_use]
    pub fn is_settled_at(&self, received_ns: u64) -> bool {
        self.published_ns.saturating_add(Self::WAY_NS) <= received_ns
    }
}

impl PoseReport {
    /// What became of the cloud; `None` for a code that is none.
    #[must_use]
    pub fn state(&self) -> Option<TrackingState> {
        TrackingState::ALL.into_iter().find(|state| *state as u32 == self.state)
    }

    /// Why it was lost, if it was.
    #[must_use]
    pub fn reason(&self) -> Option<LostReason> {
        LostReason::ALL.into_iter().find(|reason| *reason as u32 == self.reason)
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
