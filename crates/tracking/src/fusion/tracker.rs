//! Tracks the scanner from cloud to cloud, while the model grows.
//!
//! Each cloud is registered to the model as seen from the predicted pose. If that fails, it is registered again from
//! the last known pose, with a longer reach. A cloud that fails both is lost: it does not change the model, and the
//! next cloud starts from the last known pose. A cloud whose surface leaves part of the pose open is lost too, but the
//! motion stays known.
//!
//! Registration uses a few thousand points, merging uses all points. If time is short, only some of the tracked clouds
//! are merged. A fixed stride selects them, not a clock, so that the same clouds give the same poses.

use std::borrow::Borrow;

use fringeflow::cloud::{CloudPoint, Normals};
use fringeflow::correspondence::KnownDrift;
use fringeflow::geometry::{Camera, Pose};
use fringeflow::prior::{Prior, Relief, RigidMotion};

use crate::registration::{
    Lost, OrganizedSurface, PoseCovariance, Registration, RegistrationSettings, SampledPoints, register_loosely,
};

use super::closure::Closure;
use super::model::{FusionScratch, Merged, Model};
use super::motion_filter::MotionFilter;

/// Settings of tracking and merging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusionSettings {
    /// Settings of a registration.
    pub registration: RegistrationSettings,
    /// Factor for the reach of the registration when the scanner is lost.
    pub relocalization_reach: f64,
    /// Number of clouds that must measure a surfel, if as many could have measured it.
    pub min_support: u32,
    /// Stride of the merged clouds; 1 merges all. Relocalized clouds are always merged.
    pub merge_every: u32,
}

impl Default for FusionSettings {
    fn default() -> Self {
        Self {
            registration: RegistrationSettings::default(),
            relocalization_reach: 4.0,
            min_support: 3,
            merge_every: 1,
        }
    }
}

/// Result of tracking a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tracking {
    /// The first cloud: it defines the frame of the model.
    First,
    /// Registered to the model at the predicted pose.
    Tracked(Registration),
    /// Registered to the model from the last known pose.
    Relocalized(Registration),
    /// Not found on the model, and not merged. The reason is that of the last attempt.
    Lost(Lost),
}

impl Tracking {
    /// Name in reports and JSON.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Tracked(_) => "tracked",
            Self::Relocalized(_) => "relocalized",
            Self::Lost(_) => "lost",
        }
    }

    /// The registration, if the cloud has one.
    #[must_use]
    pub fn registration(&self) -> Option<&Registration> {
        match self {
            Self::Tracked(registration) | Self::Relocalized(registration) => Some(registration),
            Self::First | Self::Lost(_) => None,
        }
    }
}

/// A tracked cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracked {
    /// Its result.
    pub tracking: Tracking,
    /// Pose of C1 in the frame of C1 at the first cloud. For a lost cloud, the last known pose.
    pub model_from_cam1: Pose,
    /// Covariance of the pose relative to the first cloud.
    pub covariance: PoseCovariance,
    /// Changes that the cloud made to the model.
    pub merged: Merged,
}

/// The last known pose and motion of the scanner.
#[derive(Clone, Copy, Debug)]
struct LastKnown {
    model_from_cam1: Pose,
    /// Pose of the last cloud that determined at least part of it. The rest is predicted.
    rough_pose: Pose,
    time_ns: u64,
    motion: MotionFilter,
    /// Whether all clouds since then were lost.
    is_lost: bool,
}

impl LastKnown {
    /// Time from the last known pose to `time_ns`, seconds; 0 if `time_ns` is earlier.
    fn seconds_to(&self, time_ns: u64) -> f64 {
        time_ns.saturating_sub(self.time_ns) as f64 * 1e-9
    }

    /// Motion of the scanner; `None` if it is lost.
    fn motion(&self) -> Option<RigidMotion> {
        self.motion.motion().filter(|_| !self.is_lost)
    }

    /// Predicts the pose at `time_ns`.
    fn predict(&self, time_ns: u64) -> Pose {
        let movement = self.motion().map(|motion| motion.pose_after(self.seconds_to(time_ns)));
        self.rough_pose * movement.unwrap_or_else(Pose::identity)
    }

    /// Adds the pose of a later cloud, with its covariance.
    fn update(&mut self, pose: Pose, covariance: &PoseCovariance, time_ns: u64) {
        self.motion.update(&pose, covariance, self.seconds_to(time_ns));
        (self.rough_pose, self.time_ns, self.is_lost) = (pose, time_ns, false);
    }
}

/// Tracks a scanner and fuses its clouds.
#[derive(Debug)]
pub struct Tracker {
    camera: Camera,
    settings: FusionSettings,
    model: Model,
    /// The surface of the cloud in work.
    surface: OrganizedSurface,
    /// Points of the first cloud.
    first: SampledPoints,
    /// The last cloud that was registered.
    last: OrganizedSurface,
    normals: Normals,
    scratch: FusionScratch,
    /// Depth of the last cloud that was not lost.
    relief: Relief,
    /// Number of clouds tracked since the last merge.
    unmerged: u32,
    /// Covariance of the pose of the model.
    model_covariance: PoseCovariance,
    /// `None` before the first cloud.
    last_known: Option<LastKnown>,
    covariance: PoseCovariance,
}

impl Tracker {
    /// Creates a tracker of clouds in the frame of `camera`, which is camera 1.
    #[must_use]
    pub fn new(camera: Camera, settings: FusionSettings) -> Self {
        Self {
            camera,
            settings,
            model: Model::default(),
            surface: OrganizedSurface::default(),
            first: SampledPoints::default(),
            last: OrganizedSurface::default(),
            normals: Normals::default(),
            scratch: FusionScratch::default(),
            relief: Relief::default(),
            unmerged: 0,
            model_covariance: PoseCovariance::zero(),
            last_known: None,
            covariance: PoseCovariance::zero(),
        }
    }

    /// The model so far.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Tracks the next cloud, taken at `time_ns`. Call it in the order in which the clouds were taken.
    ///
    /// The points are read once, and dropped before the work begins.
    pub fn step(&mut self, cloud: impl IntoIterator<Item: Borrow<CloudPoint>>, time_ns: u64) -> Tracked {
        self.surface.organize(cloud, self.size_px());
        let Some(known) = self.last_known else { return self.start_model(time_ns) };
        let settings = self.settings.registration;
        let rough = self.register_at(&known.predict(time_ns), &settings);
        let found = match rough {
            // Where the surface leaves part of the pose open, a second search would leave it open too.
            Ok(found) => found.determined(&settings).map(|found| (Tracking::Tracked(found), found)),
            Err(_) => self.relocalize(&known.model_from_cam1),
        };
        match found {
            Ok((tracking, found)) => self.accept(tracking, &found, known, time_ns),
            Err(lost) => {
                // The motion is now unknown, unless the surface determined a part of the pose.
                let mut known = LastKnown { is_lost: true, ..known };
                if let Ok(found) = rough {
                    known.update(normalized(found.reference_from_moved), &found.covariance, time_ns);
                    known.rough_pose = known.motion.pose();
                    self.update_relief();
                }
                self.last_known = Some(known);
                let (model_from_cam1, covariance) = (known.model_from_cam1, self.covariance);
                Tracked { tracking: Tracking::Lost(lost), model_from_cam1, covariance, merged: Merged::default() }
            }
        }
    }

    /// Returns the prior of the next windows, or `None` if the last cloud was lost or is the first one. On a surface
    /// that does not determine the whole pose, the motion along the surface is unknown, but it hardly affects the phase
    /// either. `drift` is the calibration drift found with the correspondences of this cloud.
    #[must_use]
    pub fn prior(&self, drift: Option<KnownDrift>) -> Option<Prior> {
        Some(Prior { motion: self.last_known?.motion()?, relief: self.relief.clone(), drift })
    }

    /// Registers the last tracked cloud directly to the first, and compares the pose with the tracked one. Returns
    /// `None` if the two overlap too little.
    #[must_use]
    pub fn closure(&self) -> Option<Closure> {
        let pose = self.last_known?.model_from_cam1;
        if self.model.clouds() < 2 {
            return None;
        }
        Closure::new(&self.camera, &self.first, &self.last, &pose, &self.settings.registration)
    }

    /// Stores the depth of the surface for the prior.
    fn update_relief(&mut self) {
        let [width, height] = self.size_px();
        // A quarter of the pixels is enough for cells of 256.
        let pixels = (0..height).step_by(2).flat_map(|v| (0..width).step_by(2).map(move |u| [u as u16, v as u16]));
        let depth_m = |[u, v]: [u16; 2]| self.surface.depth_at(u as isize, v as isize);
        let measured = pixels.filter_map(|pixel| Some((pixel, depth_m(pixel)?)));
        self.relief = Relief::from_points(self.size_px(), measured);
    }

    fn size_px(&self) -> [usize; 2] {
        [self.camera.width_px(), self.camera.height_px()]
    }

    fn start_model(&mut self, time_ns: u64) -> Tracked {
        self.surface.compute_normals(&mut self.normals);
        let with_normal = self.surface.normal_count();
        let least = self.settings.registration.min_associated;
        let (model_from_cam1, covariance) = (Pose::identity(), PoseCovariance::zero());
        if with_normal < least {
            let lost = Lost::TooFewInCommon { associated: 0, tried: with_normal };
            return Tracked { tracking: Tracking::Lost(lost), model_from_cam1, covariance, merged: Merged::default() };
        }
        let merged = self.merge(&model_from_cam1, covariance, 1.0);
        self.update_relief();
        self.first = SampledPoints::of_surface(&self.surface, self.settings.registration.points);
        let motion = MotionFilter::new(model_from_cam1, &covariance);
        let rough_pose = model_from_cam1;
        self.last_known = Some(LastKnown { model_from_cam1, rough_pose, time_ns, motion, is_lost: false });
        Tracked { tracking: Tracking::First, model_from_cam1, covariance, merged }
    }

    /// Registers the surface to the model from the last known pose, with a longer reach.
    fn relocalize(&self, model_from_cam1: &Pose) -> Result<(Tracking, Registration), Lost> {
        let settings = self.settings.registration;
        let reach_share = settings.reach_share * self.settings.relocalization_reach;
        let settings = RegistrationSettings { reach_share, ..settings };
        let found = self.register_at(model_from_cam1, &settings)?.determined(&settings)?;
        Ok((Tracking::Relocalized(found), found))
    }

    /// Registers the surface to the surfels that lie where it has points, at a rough pose. The result may leave part of
    /// the pose undetermined.
    fn register_at(&self, model_from_cam1: &Pose, settings: &RegistrationSettings) -> Result<Registration, Lost> {
        let Self { camera, model, surface, .. } = self;
        let reference = model.sample(camera, model_from_cam1, surface, self.settings.min_support, settings.points);
        register_loosely(camera, &reference, surface, model_from_cam1, settings)
    }

    /// Accepts a pose, and merges the cloud if it is due.
    fn accept(
        &mut self,
        tracking: Tracking,
        registration: &Registration,
        mut known: LastKnown,
        time_ns: u64,
    ) -> Tracked {
        let model_from_cam1 = normalized(registration.reference_from_moved);
        let own = registration.covariance;
        let covariance = PoseCovariance(own.0 + self.model_covariance.0);
        self.unmerged += 1;
        let is_due = self.unmerged >= self.settings.merge_every || matches!(tracking, Tracking::Relocalized(_));
        let merged = if is_due {
            self.surface.compute_normals(&mut self.normals);
            self.merge(&model_from_cam1, covariance, registration.excess)
        } else {
            Merged::default()
        };
        known.update(model_from_cam1, &own, time_ns);
        if matches!(tracking, Tracking::Relocalized(_)) {
            // The motion was not smooth, so the filter starts again.
            known.motion = MotionFilter::new(model_from_cam1, &own);
        }
        self.last_known = Some(LastKnown { model_from_cam1, ..known });
        self.update_relief();
        self.covariance = covariance;
        std::mem::swap(&mut self.last, &mut self.surface);
        Tracked { tracking, model_from_cam1, covariance, merged }
    }

    /// Merges the surface, which has its normals.
    fn merge(&mut self, model_from_cam1: &Pose, covariance: PoseCovariance, excess: f64) -> Merged {
        let Self { camera, model, surface, scratch, settings, .. } = self;
        let merged = model.merge(camera, surface, model_from_cam1, covariance, excess, settings.min_support, scratch);
        self.unmerged = 0;
        self.model_covariance = self.model.covariance();
        merged
    }
}

/// Renormalizes the rotation of a pose. A prediction is a product of three poses, and the next pose is a product with
/// that prediction. Without renormalization, the rounding error of the length of the quaternion would triple with each
/// cloud.
fn normalized(mut pose: Pose) -> Pose {
    pose.rotation.renormalize();
    pose
}
