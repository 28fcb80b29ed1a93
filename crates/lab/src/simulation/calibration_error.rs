//! Draws the error of a calibration: C2 and P as a real calibration would determine them, with a small error.
//!
//! In: the exact rig, its volume, the sd of δ that the error should cause, and the relative lens error. Out: the
//! erroneous rig, the pose of the volume relative to points triangulated with it, and the size of the error. As in a
//! real sensor, δ of true correspondences is then a smooth field over image and depth, not white noise.

use std::f64::consts::TAU;

use nalgebra::{Translation3, UnitQuaternion};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use fringeflow::geometry::{Camera, Distortion, FringePattern, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3};

use super::SimulationError;
use super::alignment::align;
use super::normal::standard_normal;

/// Size of a calibration error over the measurement volume.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct CalibrationDeviation {
    /// Root mean square of δ of true correspondences, rad.
    pub delta_rms: f64,
    /// Mean of δ, rad.
    pub delta_mean: f64,
    /// Root mean square distance of true correspondences from their epipolar line, pixels of C2.
    pub epi_rms: f64,
    /// Largest such distance, pixels.
    pub epi_max: f64,
}

/// A randomly drawn calibration.
pub(super) struct DrawnCalibration {
    pub(super) rig: Rig,
    pub(super) cam1_from_volume: Pose,
    pub(super) deviation: CalibrationDeviation,
}

/// Maximum root mean square epipolar error caused by C2, pixels.
const MAX_EPIPOLAR_RMS_PX: f64 = 0.07;
/// Largest share of the variance of δ that C2 may cause; the projector causes the rest.
const CAM2_SHARE: f64 = 0.4;
/// Maximum number of draws of the projector error. One of them must reach the wanted sd.
const MAX_DRAWS: usize = 20;
/// Maximum number of bisection steps towards the wanted sd.
const MAX_STEPS: usize = 40;

/// Random numbers for the error of one device.
#[derive(Clone, Copy)]
struct Draw {
    /// Errors of focal length, principal point, k1, rotation and position: standard normal.
    device: [f64; 10],
    /// Errors of k2, p1 and p2: normal, scaled by the lens error.
    lens: [f64; 3],
}

/// Random generators of the draws. The lens has its own, so that another lens error does not change the numbers of the
/// device.
pub(super) struct Draws {
    device: ChaCha8Rng,
    lens: ChaCha8Rng,
    lens_error: f64,
}

impl Draws {
    /// Creates the generators. The errors of the lens are scaled by `lens_error`.
    pub(super) fn new(seed: u64, lens_error: f64) -> Self {
        let device = ChaCha8Rng::seed_from_u64(seed);
        let mut lens = device.clone();
        lens.set_stream(1);
        Self { device, lens, lens_error }
    }

    fn next(&mut self) -> Draw {
        Draw {
            device: std::array::from_fn(|_| standard_normal(&mut self.device)),
            lens: std::array::from_fn(|_| self.lens_error * standard_normal(&mut self.lens)),
        }
    }
}

impl Draw {
    /// Applies this draw to a device: intrinsic parameters, distortion, rotation and position. At scale 1, each of them
    /// moves the image by about a pixel.
    fn apply(&self, scale: f64, camera: &Camera, pose: &Pose) -> (Camera, Pose) {
        let [f, cx, cy, k1, rx, ry, rz, tx, ty, tz] = self.device.map(|n| n * scale);
        let [k2, p1, p2] = self.lens.map(|n| n * scale);
        let ([fx, fy], [px, py], focal) = (camera.focal_px(), camera.principal_px(), camera.focal_px()[0]);
        let radius_px = camera.width_px() as f64 / 2.0;
        let mut distortion: Distortion = *camera.distortion();
        let spread = focal / radius_px;
        distortion.radial[0] += k1 * spread.powi(3) / focal;
        distortion.radial[1] += k2 * spread.powi(5) / focal;
        distortion.tangential[0] += p1 * spread.powi(2) / focal;
        distortion.tangential[1] += p2 * spread.powi(2) / focal;
        let growth = 1.0 + f / radius_px;
        let size = [camera.width_px(), camera.height_px()];
        let changed =
            Camera::new([fx * growth, fy * growth], [px + cx, py + cy], distortion, size).with_skew(camera.skew_px());
        // The rotation compensates most of the shift of the principal point, as in a calibration that fits its images.
        let turn = Vector3::new((cy + 0.3 * rx) / focal, (-cx + 0.3 * ry) / focal, rz / radius_px);
        let distance = pose.translation.vector.norm();
        let shift = Vector3::new(tx, ty, tz) * (0.3 * distance / focal);
        let error = Pose::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn));
        (changed, error * pose)
    }
}

/// Draws a calibration of `exact`. Its δ over `volume` has the root mean square `sd_rad`.
pub(super) fn draw(
    exact: &Rig,
    volume: &MeasurementVolume,
    pattern: &FringePattern,
    sd_rad: f64,
    mut draws: Draws,
) -> Result<DrawnCalibration, SimulationError> {
    let probe = Probe::new(exact, volume, pattern);
    if sd_rad == 0.0 {
        let deviation = CalibrationDeviation::default();
        let cam1_from_volume = *volume.cam1_from_volume();
        return Ok(DrawnCalibration { rig: *exact, cam1_from_volume, deviation });
    }
    let cam2 = draws.next();
    let base = probe.with_cam2_error(&cam2, sd_rad);
    for _ in 0..MAX_DRAWS {
        let projector = draws.next();
        if let Some(rig) = probe.with_projector_error(&base, &projector, sd_rad) {
            let deviation = probe.deviation(&rig).ok_or(SimulationError::NoCalibration { sd_rad })?;
            let pairs = probe.triangulated(&rig);
            let cam1_from_volume = align(&pairs) * volume.cam1_from_volume();
            return Ok(DrawnCalibration { cam1_from_volume, rig, deviation });
        }
    }
    Err(SimulationError::NoCalibration { sd_rad })
}

/// True correspondences over the volume, for evaluating a calibration.
struct Probe<'a> {
    exact: &'a Rig,
    pattern: &'a FringePattern,
    /// Points in the frame of the exact C1, metres, with their images in C1, C2 and P.
    points: Vec<(Point3, Pixel, Pixel, Pixel)>,
}

impl<'a> Probe<'a> {
    fn new(exact: &'a Rig, volume: &MeasurementVolume, pattern: &'a FringePattern) -> Self {
        let steps = [9, 7, 5];
        let extent = volume.max() - volume.min();
        let mut points = Vec::new();
        for i in 0..steps[0] * steps[1] * steps[2] {
            let cell = [i % steps[0], i / steps[0] % steps[1], i / (steps[0] * steps[1])];
            let offset =
                Vector3::from_fn(|axis, _| extent[axis] * (f64::from(cell[axis]) + 0.5) / f64::from(steps[axis]));
            let point = volume.cam1_from_volume() * (volume.min() + offset);
            let seen = (exact.cam1.project(&point), exact.project_cam2(&point), exact.project_projector(&point));
            if let (Some(p), Some(q), Some(lit)) = seen {
                points.push((point, p, q, lit));
            }
        }
        Self { exact, pattern, points }
    }

    /// Returns the rig with an error of C2, scaled down until its epipolar error and its contribution to δ are small
    /// enough.
    fn with_cam2_error(&self, draw: &Draw, sd_rad: f64) -> Rig {
        let mut scale = 1.0;
        for _ in 0..MAX_STEPS {
            let (cam2, cam2_from_cam1) = draw.apply(scale, &self.exact.cam2, &self.exact.cam2_from_cam1);
            let rig = self.centred(Rig { cam2, cam2_from_cam1, ..*self.exact });
            let excess = self
                .deviation(&rig)
                .map(|d| (d.epi_rms / MAX_EPIPOLAR_RMS_PX).max(d.delta_rms / (sd_rad * CAM2_SHARE.sqrt()).max(1e-12)));
            match excess {
                Some(excess) if excess <= 1.0 => return rig,
                Some(excess) => scale *= 0.98 / excess.max(1.02),
                None => scale *= 0.5,
            }
        }
        *self.exact
    }

    /// Adds an error of the projector, scaled so that δ has the wanted root mean square. Returns `None` if no scale
    /// reaches it.
    fn with_projector_error(&self, base: &Rig, draw: &Draw, sd_rad: f64) -> Option<Rig> {
        let at = |scale: f64| {
            let (projector, projector_from_cam1) = draw.apply(scale, &base.projector, &base.projector_from_cam1);
            self.centred(Rig { projector, projector_from_cam1, ..*base })
        };
        // Bracket the scale by doubling, then bisect.
        let (mut low, mut high) = (0.0, 0.05);
        while self.deviation(&at(high))?.delta_rms < sd_rad {
            (low, high) = (high, high * 2.0);
            if high > 1e3 {
                return None;
            }
        }
        for _ in 0..MAX_STEPS {
            let middle = 0.5 * (low + high);
            if self.deviation(&at(middle))?.delta_rms < sd_rad { low = middle } else { high = middle }
        }
        Some(at(0.5 * (low + high)))
    }

    /// Shifts the principal point of the projector so that δ has mean zero. Every calibration that fits its own images
    /// determines it that well.
    fn centred(&self, rig: Rig) -> Rig {
        let Some(deviation) = self.deviation(&rig) else { return rig };
        let [px, py] = rig.projector.principal_px();
        let column_px = deviation.delta_mean * self.pattern.period_px / TAU;
        let size = [rig.projector.width_px(), rig.projector.height_px()];
        let projector = Camera::new(rig.projector.focal_px(), [px - column_px, py], *rig.projector.distortion(), size)
            .with_skew(rig.projector.skew_px());
        Rig { projector, ..rig }
    }

    /// Returns the size of the error of a calibration, or `None` if a point cannot be triangulated or projected with
    /// it.
    fn deviation(&self, rig: &Rig) -> Option<CalibrationDeviation> {
        let (mut delta_sum, mut delta_squares, mut epi_squares, mut epi_max) = (0.0, 0.0, 0.0, 0.0_f64);
        for (_, p, q, lit) in &self.points {
            let point = on_ray_of_cam1(rig, p, q)?;
            let delta = TAU * (rig.project_projector(&point)?.x - lit.x) / self.pattern.period_px;
            // To first order, the nearest point of the epipolar line is the image of the nearest point of the ray.
            let epi = (rig.project_cam2(&point)? - q).norm();
            delta_sum += delta;
            delta_squares += delta * delta;
            epi_squares += epi * epi;
            epi_max = epi_max.max(epi);
        }
        let count = self.points.len() as f64;
        Some(CalibrationDeviation {
            delta_rms: (delta_squares / count).sqrt(),
            delta_mean: delta_sum / count,
            epi_rms: (epi_squares / count).sqrt(),
            epi_max,
        })
    }

    /// Returns pairs of exact points and the points that a calibration triangulates from their images.
    fn triangulated(&self, rig: &Rig) -> Vec<(Point3, Point3)> {
        self.points.iter().filter_map(|(exact, p, q, _)| Some((*exact, on_ray_of_cam1(rig, p, q)?))).collect()
    }
}

/// Returns the point of the ray through `p` that is nearest to the ray through `q`, in the frame of C1.
fn on_ray_of_cam1(rig: &Rig, p: &Pixel, q: &Pixel) -> Option<Point3> {
    let a = rig.cam1.ray(p)?;
    let b = rig.cam2_from_cam1.rotation.inverse() * rig.cam2.ray(q)?;
    let centre = rig.centre_of_cam2().coords;
    let across = a.cross(&b);
    let depth = centre.cross(&b).dot(&across) / across.norm_squared();
    depth.is_finite().then(|| Point3::from(a * depth))
}
