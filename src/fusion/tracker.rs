//! Where the scanner stands, cloud after cloud, and the model that grows meanwhile.
//!
//! Each cloud is registered to the model as it would be seen from where the scanner should be by now. If that fails, it is
//! tried once more from where it was last known to be, with a longer reach. What fails both is lost: it changes nothing, and
//! the next cloud begins from the last known pose.

use crate::cloud::Cloud;
use crate::geometry::{Camera, Pose};
use crate::registration::{Lost, OrganizedSurface, PoseCovariance, Registration, RegistrationSettings, register};

use super::closure::Closure;
use super::model::{Merged, Model};

/// How clouds are tracked and merged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusionSettings {
    /// What is asked of a registration.
    pub registration: RegistrationSettings,
    /// How many times further points are paired when the scanner is looked for where it was last.
    pub relocalization_reach: f64,
    /// Clouds that a surfel is to be measured in, where as many could have measured it.
    pub min_support: u32,
}

impl Default for FusionSettings {
    fn default() -> Self {
        Self { registration: RegistrationSettings::default(), relocalization_reach: 4.0, min_support: 3 }
    }
}

/// What became of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tracking {
    /// The first one: it makes the frame of the model.
    First,
    /// Registered to the model where it was expected.
    Tracked(Registration),
    /// Registered to the model from the last known pose.
    Relocalized(Registration),
    /// Not merged. The reason is that of the last attempt.
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

    /// The registration, of those that have one.
    #[must_use]
    pub fn registration(&self) -> Option<&Registration> {
        match self {
            Self::Tracked(registration) | Self::Relocalized(registration) => Some(registration),
            Self::First | Self::Lost(_) => None,
        }
    }
}

/// A cloud that was looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracked {
    /// What became of it.
    pub tracking: Tracking,
    /// Pose of C1, frame of C1 at the first cloud; of a lost cloud the last known one.
    pub model_from_cam1: Pose,
    /// Covariance of the pose against the first cloud.
    pub covariance: PoseCovariance,
    /// What it did to the model.
    pub merged: Merged,
}

/// Tracks a scanner and fuses its clouds.
#[derive(Clone, Debug)]
pub struct Tracker {
    camera: Camera,
    settings: FusionSettings,
    model: Model,
    first: OrganizedSurface,
    last: OrganizedSurface,
    /// Last known pose of C1, and the pose before that.
    known: Option<[Pose; 2]>,
    covariance: PoseCovariance,
}

impl Tracker {
    /// A tracker of clouds in the frame of `camera`, camera 1.
    #[must_use]
    pub fn new(camera: Camera, settings: FusionSettings) -> Self {
        Self {
            camera,
            settings,
            model: Model::default(),
            first: OrganizedSurface::default(),
            last: OrganizedSurface::default(),
            known: None,
            covariance: PoseCovariance::zero(),
        }
    }

    /// The model so far.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The next cloud, in the order they were taken.
    pub fn step(&mut self, cloud: &Cloud) -> Tracked {
        let surface = OrganizedSurface::of_cloud(cloud, [self.camera.width_px(), self.camera.height_px()]);
        let Some([pose, before]) = self.known else { return self.begin(surface) };
        match self.locate(&surface, &pose, &before) {
            Ok((tracking, predicted, registration)) => self.take(surface, tracking, &predicted, &registration),
            Err(lost) => {
                // What the scanner did meanwhile, nobody knows.
                self.known = Some([pose, pose]);
                let (model_from_cam1, covariance) = (pose, self.covariance);
                Tracked { tracking: Tracking::Lost(lost), model_from_cam1, covariance, merged: Merged::default() }
            }
        }
    }

    /// How the last merged cloud lies to the first, by themselves and by the tracking; `None` where they have too little
    /// in common.
    #[must_use]
    pub fn closure(&self) -> Option<Closure> {
        let [pose, _] = self.known?;
        let is_first = self.model.clouds() < 2;
        if is_first {
            None
        } else {
            Closure::of(&self.camera, [&self.first, &self.last], &pose, &self.settings.registration)
        }
    }

    fn begin(&mut self, surface: OrganizedSurface) -> Tracked {
        let with_normal = surface.points().iter().filter(|point| point.normal.is_some()).count();
        let least = self.settings.registration.min_associated;
        let (model_from_cam1, covariance) = (Pose::identity(), PoseCovariance::zero());
        if with_normal < least {
            let lost = Lost::TooFewInCommon { associated: 0, tried: with_normal };
            return Tracked { tracking: Tracking::Lost(lost), model_from_cam1, covariance, merged: Merged::default() };
        }
        let merged = self.merge(&surface, &model_from_cam1, covariance, 1.0);
        self.first = surface.clone();
        self.last = surface;
        self.known = Some([model_from_cam1; 2]);
        Tracked { tracking: Tracking::First, model_from_cam1, covariance, merged }
    }

    /// Registers a surface to the model: from where it moved on to, or else from where it was.
    fn locate(
        &self,
        surface: &OrganizedSurface,
        pose: &Pose,
        before: &Pose,
    ) -> Result<(Tracking, Pose, Registration), Lost> {
        let predicted = pose * before.inverse() * pose;
        let settings = self.settings.registration;
        if let Ok(found) = self.register_at(surface, &predicted, &settings) {
            return Ok((Tracking::Tracked(found), predicted, found));
        }
        let reach_share = settings.reach_share * self.settings.relocalization_reach;
        let found = self.register_at(surface, pose, &RegistrationSettings { reach_share, ..settings })?;
        Ok((Tracking::Relocalized(found), *pose, found))
    }

    fn register_at(
        &self,
        surface: &OrganizedSurface,
        model_from_cam1: &Pose,
        settings: &RegistrationSettings,
    ) -> Result<Registration, Lost> {
        let expected = self.model.surface_from(&self.camera, model_from_cam1, self.settings.min_support);
        register(&self.camera, &expected, surface, &Pose::identity(), settings)
    }

    /// Merges a surface that was registered to the model as seen from a pose.
    fn take(
        &mut self,
        surface: OrganizedSurface,
        tracking: Tracking,
        model_from_reference: &Pose,
        registration: &Registration,
    ) -> Tracked {
        let mut model_from_cam1 = model_from_reference * registration.reference_from_moved;
        // A prediction is a product of three poses, and the next pose is one of that: the rounding of the quaternions'
        // length would triple with every cloud.
        model_from_cam1.rotation.renormalize();
        let own = registration.covariance.seen_from(model_from_reference);
        let covariance = PoseCovariance(own.0 + self.model.covariance().0);
        let merged = self.merge(&surface, &model_from_cam1, covariance, registration.excess);
        let before = self.known.map_or(model_from_cam1, |[pose, _]| pose);
        self.known = Some([model_from_cam1, before]);
        self.covariance = covariance;
        self.last = surface;
        Tracked { tracking, model_from_cam1, covariance, merged }
    }

    fn merge(
        &mut self,
        surface: &OrganizedSurface,
        model_from_cam1: &Pose,
        covariance: PoseCovariance,
        excess: f64,
    ) -> Merged {
        let min_support = self.settings.min_support;
        self.model.merge(&self.camera, surface, model_from_cam1, covariance, excess, min_support)
    }
}
