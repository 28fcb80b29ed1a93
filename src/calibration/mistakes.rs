//! Ways in which a calibration is often given wrongly, and what speaks for them.
//!
//! In: a rig as its file gives it, and the measurement volume. Out: the mistake without which cameras and projector
//! would see the volume that they do not see now. Cost: some thousand projections, once per rig.

use std::fmt;

use crate::geometry::{Camera, MeasurementVolume, Point3, Pose, Rig};

/// A mistake in a calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mistake {
    /// R2 and T2 lead from camera 2 to camera 1.
    Cam2Inverted,
    /// Rp and Tp lead from the projector to camera 1.
    ProjectorInverted,
    /// R2 is transposed, as MATLAB stores it.
    Cam2Transposed,
    /// Rp is transposed, as MATLAB stores it.
    ProjectorTransposed,
    /// Rp and Tp lead from camera 2 to the projector.
    ProjectorFromCam2,
    /// Tp is in another unit than T2. The correct Tp is this many times as long.
    ProjectorUnit(f64),
    /// T2 and Tp are in another unit than the volume. The correct ones are this many times as long.
    AllLengths(f64),
    /// K1 and K2 are those of images of another resolution. The correct values are this many times as large.
    Resolution(f64),
}

/// A mistake, and how much of the measurement volume speaks for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LikelyMistake {
    /// The mistake.
    pub mistake: Mistake,
    /// Share of the volume that both cameras see and the projector lights, by the calibration as it is.
    pub seen_share: f64,
    /// The same without the mistake.
    pub corrected_share: f64,
    /// Distance from camera 1 to camera 2 and to the projector, metres, as the calibration is.
    pub bases_m: [f64; 2],
}

/// A calibration counts as mistaken if less of the volume than this is seen,
const FEW_SEEN: f64 = 0.25;
/// and at least this much without the mistake.
const MOST_SEEN: f64 = 0.6;
/// Points along each axis of the volume.
const GRID: usize = 9;

impl Mistake {
    /// All mistakes that a rig and its volume could have.
    #[must_use]
    pub fn all(rig: &Rig, volume: Option<&MeasurementVolume>) -> Vec<Self> {
        let resolutions = [Self::Resolution(2.0), Self::Resolution(0.5)];
        Self::of_poses(rig, volume).into_iter().chain(resolutions).collect()
    }

    /// Those in poses and lengths. Only these does the volume show: a camera with a shorter focal length always sees more
    /// of it.
    fn of_poses(rig: &Rig, volume: Option<&MeasurementVolume>) -> Vec<Self> {
        let poses = [
            Self::Cam2Inverted,
            Self::ProjectorInverted,
            Self::Cam2Transposed,
            Self::ProjectorTransposed,
            Self::ProjectorFromCam2,
        ];
        let units = [Self::ProjectorUnit(1000.0), Self::ProjectorUnit(1e-3)];
        let scale = volume.and_then(|volume| missing_scale(rig, volume)).map(Self::AllLengths);
        poses.into_iter().chain(units).chain(scale).collect()
    }

    /// The rig without this mistake.
    #[must_use]
    pub fn corrected(self, rig: &Rig) -> Rig {
        let mut corrected = *rig;
        let Rig { cam1: view1, cam2: view2, cam2_from_cam1: cam2, projector_from_cam1: projector, .. } = &mut corrected;
        match self {
            Self::Cam2Inverted => *cam2 = cam2.inverse(),
            Self::ProjectorInverted => *projector = projector.inverse(),
            Self::Cam2Transposed => cam2.rotation = cam2.rotation.inverse(),
            Self::ProjectorTransposed => projector.rotation = projector.rotation.inverse(),
            Self::ProjectorFromCam2 => *projector *= *cam2,
            Self::ProjectorUnit(factor) => scale(projector, factor),
            Self::AllLengths(factor) => [cam2, projector].into_iter().for_each(|pose| scale(pose, factor)),
            Self::Resolution(factor) => [view1, view2].into_iter().for_each(|view| *view = resampled(view, factor)),
        }
        corrected
    }
}

fn scale(pose: &mut Pose, factor: f64) {
    pose.translation.vector *= factor;
}

/// The camera whose pixels are this many times as many in each direction, as if its image were as large as before.
fn resampled(camera: &Camera, factor: f64) -> Camera {
    let ([fx, fy], [cx, cy]) = (camera.focal_px(), camera.principal_px());
    // Pixel 0 reaches from −0.5 to 0.5.
    let principal_px = [cx, cy].map(|c| (c + 0.5) * factor - 0.5);
    let size_px = [camera.width_px(), camera.height_px()];
    Camera::new([fx * factor, fy * factor], principal_px, *camera.distortion(), size_px)
        .with_skew(camera.skew_px() * factor)
}

impl fmt::Display for Mistake {
    /// What the file seems to hold, and what it must hold.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cam2Inverted => write!(f, "R2 and T2 seem to be inverted; they must give x2 = R2·x1 + T2"),
            Self::ProjectorInverted => write!(f, "Rp and Tp seem to be inverted; they must give xp = Rp·x1 + Tp"),
            Self::Cam2Transposed => write!(f, "R2 seems to be transposed, as MATLAB stores it; transpose it"),
            Self::ProjectorTransposed => write!(f, "Rp seems to be transposed, as MATLAB stores it; transpose it"),
            Self::ProjectorFromCam2 => {
                write!(f, "Rp and Tp seem to start from camera 2; they must start from camera 1: Rp·R2 and Rp·T2 + Tp")
            }
            Self::ProjectorUnit(factor) => write!(
                f,
                "Tp seems to be in another unit than T2; it must be {factor} times as long (metres beside millimetres?)"
            ),
            Self::AllLengths(factor) => write!(
                f,
                "T2 and Tp seem to be in another unit than the measurement volume, such as squares of the calibration \
                 board; they must be {factor:.3} times as long"
            ),
            Self::Resolution(factor) => write!(
                f,
                "K1 and K2 seem to be those of images of another resolution; fx, fy, cx and cy must be {factor} times as \
                 large"
            ),
        }
    }
}

impl fmt::Display for LikelyMistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mistake, seen_share, corrected_share, bases_m: [cam2_m, projector_m] } = self;
        write!(
            f,
            "{mistake} (camera 2 lies {:.1} mm and the projector {:.1} mm from camera 1; all three see {:.0} % of the \
             measurement volume, and {:.0} % the other way round)",
            cam2_m * 1e3,
            projector_m * 1e3,
            seen_share * 100.0,
            corrected_share * 100.0
        )
    }
}

/// The mistake that explains best why cameras and projector see little of the volume; `None` if they see enough of it,
/// or no mistake explains it.
#[must_use]
pub fn likely_mistake(rig: &Rig, volume: &MeasurementVolume) -> Option<LikelyMistake> {
    let seen_share = seen_share(rig, volume);
    if seen_share >= FEW_SEEN {
        return None;
    }
    let bases_m = [rig.centre_of_cam2(), rig.centre_of_projector()].map(|centre| centre.coords.norm());
    let shares = Mistake::of_poses(rig, Some(volume)).into_iter().map(|mistake| LikelyMistake {
        mistake,
        seen_share,
        corrected_share: self::seen_share(&mistake.corrected(rig), volume),
        bases_m,
    });
    let best = shares.max_by(|a, b| a.corrected_share.total_cmp(&b.corrected_share))?;
    (best.corrected_share >= MOST_SEEN).then_some(best)
}

/// Share of the volume that both cameras see and the projector lights.
fn seen_share(rig: &Rig, volume: &MeasurementVolume) -> f64 {
    let step = |index: usize| (index as f64 + 0.5) / GRID as f64;
    let extent = volume.max() - volume.min();
    let points = (0..GRID * GRID * GRID).map(|i| [i % GRID, i / GRID % GRID, i / GRID / GRID].map(step));
    let is_seen = |[x, y, z]: [f64; 3]| {
        let in_volume = volume.min() + nalgebra::Vector3::new(x, y, z).component_mul(&extent);
        let point: Point3 = volume.cam1_from_volume() * in_volume;
        let in_cam1 = rig.cam1.project(&point).is_some_and(|pixel| rig.cam1.sees(&pixel));
        let in_cam2 = || rig.project_cam2(&point).is_some_and(|pixel| rig.cam2.sees(&pixel));
        let is_lit = || rig.project_projector(&point).is_some_and(|pixel| rig.projector.sees(&pixel));
        point.z > 0.0 && in_cam1 && in_cam2() && is_lit()
    };
    points.filter(|&point| is_seen(point)).count() as f64 / (GRID * GRID * GRID) as f64
}

/// The factor that brings the point where the axes of the cameras come nearest to each other to the distance of the
/// volume; `None` if the axes are parallel or part from each other.
fn missing_scale(rig: &Rig, volume: &MeasurementVolume) -> Option<f64> {
    let cam1_from_cam2 = rig.cam2_from_cam1.inverse();
    let (centre, axis) = (cam1_from_cam2.translation.vector, cam1_from_cam2.rotation * nalgebra::Vector3::z());
    // Nearest points s·z on the axis of camera 1 and centre + t·axis on that of camera 2.
    let between = axis.z;
    let parallel = 1.0 - between * between;
    let meets_at_m = (centre.z - between * centre.dot(&axis)) / parallel;
    let middle = volume.cam1_from_volume() * nalgebra::center(volume.min(), volume.max());
    let factor = middle.z / meets_at_m;
    (factor.is_finite() && factor > 0.0).then_some(factor)
}
