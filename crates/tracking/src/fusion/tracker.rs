//! Where the scanner stands, cloud after cloud, and the model that grows meanwhile.
//!
//! Each cloud is registered to the model as it would be seen from where the scanner should be by now. If that fails, it is
//! tried once more from where it was last known to be, with a longer reach. What fails both is lost: it changes nothing, and
//! the next cloud begins from the last known pose.
//!
//! Registering takes a few thousand points, merging all of them: where time is short, only some of the clouds that were
//! tracked go into the model. Which ones, their number decides and no clock, so that the same clouds give the same poses.

use fringeflow::cloud::Cloud;
use fringeflow::correspondence::KnownDrift;
use fringeflow::geometry::{Camera, Point3, Pose};
use fringeflow::prior::{Prior, Relief, RigidMotion};

use crate::registration::{
    Lost, OrganizedSurface, PoseCovariance, Registration, RegistrationSettings, register_loosely,
};

use super::closure::Closure;
use super::model::{Merged, Model};
use super::motion_filter::MotionFilter;

/// How clouds are tracked and merged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusionSettings {
    /// What is asked of a registration.
    pub registration: RegistrationSettings,
    /// How many times further points are paired when the scanner is looked for where it was last.
    pub relocalization_reach: f64,
    /// Clouds that a surfel is to be measured in, where as many could have measured it.
    pub min_support: u32,
    /// Tracked clouds of which one is merged; 1 merges all. Those found again after they were lost always are.
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

/// What became of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tracking {
    /// The first one: it makes the frame of the model.
    First,
    /// Registered to the model where it was expected.
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

/// The model as it was drawn for camera 1 at some pose: what clouds are registered to.
#[derive(Clone, Debug)]
struct View {
    model_from_cam1: Pose,
    surface: OrganizedSurface,
}

/// Where the scanner was last known to be.
#[derive(Clone, Copy, Debug)]
struct Known {
    model_from_cam1: Pose,
    /// Where it was then, as far as a surface tells that does not determine all of the pose.
    roughly: Pose,
    time_ns: u64,
    motion: MotionFilter,
    /// No cloud since then told anything.
    is_lost: bool,
}

impl Known {
    /// From then to a time, seconds; 0 if that is earlier.
    fn seconds_to(&self, time_ns: u64) -> f64 {
        time_ns.saturating_sub(self.time_ns) as f64 * 1e-9
    }

    /// How it moved; `None` after it was lost.
    fn motion(&self) -> Option<RigidMotion> {
        self.motion.motion().filter(|_| !self.is_lost)
    }

    /// Where it should be at a time.
    fn predicted(&self, time_ns: u64) -> Pose {
        let way = self.motion().map(|motion| motion.pose_after(self.seconds_to(time_ns)));
        self.roughly * way.unwrap_or_else(Pose::identity)
    }

    /// A cloud of a later time was found at a pose of this covariance.
    fn moved_to(&mut self, pose: Pose, covariance: &PoseCovariance, time_ns: u64) {
        self.motion.take(&pose, covariance, self.seconds_to(time_ns));
        (self.roughly, self.time_ns, self.is_lost) = (pose, time_ns, false);
    }
}

/// A view serves as long as places move in the image by less than this, as a share of their distance: about 6 pixels of 640.
/// What comes into the image at its border has no partner until then.
const VIEW_SHARE: f64 = 0.01;

/// Tracks a scanner and fuses its clouds.
#[derive(Clone, Debug)]
pub struct Tracker {
    camera: Camera,
    settings: FusionSettings,
    model: Model,
    first: OrganizedSurface,
    last: OrganizedSurface,
    /// What the last cloud looked like that was not lost altogether.
    relief: Relief,
    /// The model as it was last drawn, if nothing was merged since.
    view: Option<View>,
    /// Clouds tracked since the last was merged.
    unmerged: u32,
    /// Middle of the model, and the covariance of where it stands.
    centre: Point3,
    standing: PoseCovariance,
    /// Last known pose of C1.
    known: Option<Known>,
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
            relief: Relief::default(),
            view: None,
            unmerged: 0,
            centre: Point3::origin(),
            standing: PoseCovariance::zero(),
            known: None,
            covariance: PoseCovariance::zero(),
        }
    }

    /// The model so far.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Middle of the model when a cloud was last merged, frame of C1 at the first cloud, metres.
    #[must_use]
    pub fn centre(&self) -> &Point3 {
        &self.centre
    }

    /// The next cloud, in the order they were taken, and its time.
    pub fn step(&mut self, cloud: &Cloud, time_ns: u64) -> Tracked {
        let Some(known) = self.known else { return self.begin(self.surface(cloud), time_ns) };
        let sampled = OrganizedSurface::sampled(cloud, self.size_px(), self.settings.registration.points);
        let settings = self.settings.registration;
        let roughly = self.register_at(&sampled, &known.predicted(time_ns), &settings);
        let found = roughly.and_then(|(reference, found)| {
            let found = found.determined(&settings)?;
            Ok((Tracking::Tracked(found), reference, found))
        });
        match found.or_else(|_| self.relocalize(&sampled, &known.model_from_cam1)) {
            Ok((tracking, reference, found)) => {
                self.take(cloud, sampled, (tracking, &reference, &found), known, time_ns)
            }
            Err(lost) => {
                // What the scanner did meanwhile, nobody knows, unless a part of its pose was found.
                let mut known = Known { is_lost: true, ..known };
                if let Ok((reference, found)) = roughly {
                    let pose = normalized(reference * found.reference_from_moved);
                    known.moved_to(pose, &found.covariance.seen_from(&reference), time_ns);
                    self.look_at(&sampled);
                }
                self.known = Some(known);
                let (model_from_cam1, covariance) = (known.model_from_cam1, self.covariance);
                Tracked { tracking: Tracking::Lost(lost), model_from_cam1, covariance, merged: Merged::default() }
            }
        }
    }

    /// What the last cloud tells of the next windows; `None` where it was lost, or is the first one. A surface that does not
    /// determine all of the pose tells nothing of the motion that leaves it in itself, which hardly shows in its phase either. The
    /// drift is what the correspondences of this cloud showed.
    #[must_use]
    pub fn prior(&self, drift: Option<KnownDrift>) -> Option<Prior> {
        Some(Prior { motion: self.known?.motion()?, relief: self.relief.clone(), drift })
    }

    /// How the last merged cloud lies to the first, by themselves and by the tracking; `None` where they have too little
    /// in common.
    #[must_use]
    pub fn closure(&self) -> Option<Closure> {
        let pose = self.known?.model_from_cam1;
        let is_first = self.model.clouds() < 2;
        if is_first {
            None
        } else {
            Closure::new(&self.camera, [&self.first, &self.last], &pose, &self.settings.registration)
        }
    }

    /// Keeps what a surface looks like.
    fn look_at(&mut self, surface: &OrganizedSurface) {
        let points = surface.points().iter().map(|point| (point.cam1_px, point.position_m[2]));
        self.relief = Relief::from_points(self.size_px(), points);
    }

    fn size_px(&self) -> [usize; 2] {
        [self.camera.width_px(), self.camera.height_px()]
    }

    fn surface(&self, cloud: &Cloud) -> OrganizedSurface {
        OrganizedSurface::from_cloud(cloud, self.size_px())
    }

    fn begin(&mut self, surface: OrganizedSurface, time_ns: u64) -> Tracked {
        let with_normal = surface.points().iter().filter(|point| point.normal.is_some()).count();
        let least = self.settings.registration.min_associated;
        let (model_from_cam1, covariance) = (Pose::identity(), PoseCovariance::zero());
        if with_normal < least {
            let lost = Lost::TooFewInCommon { associated: 0, tried: with_normal };
            return Tracked { tracking: Tracking::Lost(lost), model_from_cam1, covariance, merged: Merged::default() };
        }
        let merged = self.merge(&surface, &model_from_cam1, covariance, 1.0);
        self.look_at(&surface);
        self.first = surface.clone();
        self.last = surface;
        let motion = MotionFilter::new(model_from_cam1, &covariance);
        self.known = Some(Known { model_from_cam1, roughly: model_from_cam1, time_ns, motion, is_lost: false });
        Tracked { tracking: Tracking::First, model_from_cam1, covariance, merged }
    }

    /// Looks for a surface on the model from where the scanner was last known to be. The pose is that which the registration
    /// refers to.
    fn relocalize(
        &mut self,
        surface: &OrganizedSurface,
        model_from_cam1: &Pose,
    ) -> Result<(Tracking, Pose, Registration), Lost> {
        let settings = self.settings.registration;
        let reach_share = settings.reach_share * self.settings.relocalization_reach;
        let settings = RegistrationSettings { reach_share, ..settings };
        let (reference, found) = self.register_at(surface, model_from_cam1, &settings)?;
        let found = found.determined(&settings)?;
        Ok((Tracking::Relocalized(found), reference, found))
    }

    /// Registers a surface to the model as seen from a pose, or from near it: that pose comes first. What the surface does not
    /// determine means nothing.
    fn register_at(
        &mut self,
        surface: &OrganizedSurface,
        model_from_cam1: &Pose,
        settings: &RegistrationSettings,
    ) -> Result<(Pose, Registration), Lost> {
        let centre = surface.centre();
        let serves = |view: &View| {
            let moved = view.model_from_cam1.inverse() * model_from_cam1 * centre;
            (moved - centre).norm() <= VIEW_SHARE * centre.coords.norm()
        };
        let view = self.view.take().filter(serves).unwrap_or_else(|| View {
            model_from_cam1: *model_from_cam1,
            surface: self.model.surface_from(&self.camera, model_from_cam1, self.settings.min_support),
        });
        let start = view.model_from_cam1.inverse() * model_from_cam1;
        let found = register_loosely(&self.camera, &view.surface, surface, &start, settings);
        let reference = self.view.insert(view).model_from_cam1;
        Ok((reference, found?))
    }

    /// Takes over a pose that was found against the model as seen from `model_from_reference`, and merges the cloud when its
    /// turn has come.
    fn take(
        &mut self,
        cloud: &Cloud,
        sampled: OrganizedSurface,
        (tracking, model_from_reference, registration): (Tracking, &Pose, &Registration),
        mut known: Known,
        time_ns: u64,
    ) -> Tracked {
        let model_from_cam1 = normalized(model_from_reference * registration.reference_from_moved);
        let own = registration.covariance.seen_from(model_from_reference);
        let covariance = PoseCovariance(own.0 + self.standing.0);
        self.unmerged += 1;
        let is_turn = self.unmerged >= self.settings.merge_every || matches!(tracking, Tracking::Relocalized(_));
        let merged = if is_turn {
            self.merge(&self.surface(cloud), &model_from_cam1, covariance, registration.excess)
        } else {
            Merged::default()
        };
        known.moved_to(model_from_cam1, &own, time_ns);
        if matches!(tracking, Tracking::Relocalized(_)) {
            // It did not move evenly.
            known.motion = MotionFilter::new(model_from_cam1, &own);
        }
        self.known = Some(Known { model_from_cam1, ..known });
        self.look_at(&sampled);
        self.covariance = covariance;
        self.last = sampled;
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
        let merged = self.model.merge(&self.camera, surface, model_from_cam1, covariance, excess, min_support);
        self.view = None;
        self.unmerged = 0;
        self.centre = self.model.centre();
        self.standing = self.model.covariance();
        merged
    }
}

/// A prediction is a product of three poses, and the next pose is one of that: the rounding of the quaternions' length would triple
/// with every cloud.
fn normalized(mut pose: Pose) -> Pose {
    pose.rotation.renormalize();
    pose
}
