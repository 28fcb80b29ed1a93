//! The virtual rig: the exact sensor, its calibration with an error, and its measurement volume.
//!
//! In: an arrangement, and the parameters that determine `efc` (paper, Eq. 1): depth of the volume, period, calibration
//! error. Out: two [`Rig`]s (exact and calibrated), the measurement volume in the frame of each, and the fringe
//! patterns.

use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

use fringeflow::geometry::{Camera, Distortion, FringePattern, MeasurementVolume, Point3, Pose, Rig, Vector3};
use fringeflow_patterns::{gray_bits, usual_fringes};

use super::calibration_error::{self, CalibrationDeviation, Draws};
use super::projector_place::with_projector_at;
use super::solid::MM_PER_M;
use super::{SimulationError, check_range};

/// Arrangement of cameras and projector. The default is [`Arrangement::TABLE_TOP`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrangement {
    /// Distance between the centres of the cameras, metres.
    pub base_m: f64,
    /// Distance of the base of the cameras from the centre of the volume, metres.
    pub distance_m: f64,
    /// Place of the projector along the base, 0 at C1 and 1 at C2.
    pub projector_place: f64,
    /// Height of the projector above the base, metres.
    pub projector_height_m: f64,
    /// Rotation of the projector about its line of sight, which tilts the columns against the base, rad.
    pub projector_roll_rad: f64,
    /// Focal length of the cameras for an image of 640 × 512 pixels, pixels.
    pub camera_focal_px: f64,
    /// Focal length of the projector, pixels.
    pub projector_focal_px: f64,
    /// Whether the lenses distort.
    pub distorted: bool,
}

impl Arrangement {
    /// A table-top sensor like that of the paper: cameras 110 mm apart, converging on a volume 305 mm away, and the
    /// projector above at 0.38 of the base, where no wrong fringe order of low number passes the back-projection test.
    pub const TABLE_TOP: Self = Self {
        base_m: 0.11,
        distance_m: 0.305,
        projector_place: 0.38,
        projector_height_m: 0.055,
        projector_roll_rad: 0.011,
        camera_focal_px: 1840.0,
        projector_focal_px: 3420.0,
        distorted: true,
    };

    /// As [`Self::TABLE_TOP`], but with the projector in the middle, where every second fringe order passes the test.
    pub const SYMMETRIC: Self = Self { projector_place: 0.5, ..Self::TABLE_TOP };
}

/// A rig of the user, to be simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GivenRig {
    /// Cameras and projector.
    pub rig: Rig,
    /// Measurement volume. Its axis z must lead away from the sensor. The object stands in its middle.
    pub volume: MeasurementVolume,
    /// The fringes.
    pub pattern: FringePattern,
}

impl GivenRig {
    /// The volume with its origin in the middle of the box, where the virtual scanner puts its objects.
    fn centred_volume(&self) -> Result<MeasurementVolume, SimulationError> {
        let (min, max) = (self.volume.min(), self.volume.max());
        let half = (max - min) / 2.0;
        let middle = Translation3::from(min.coords + half);
        let corner = Point3::from(half);
        Ok(MeasurementVolume::new(self.volume.cam1_from_volume() * middle, -corner, corner)?)
    }
}

/// Options of a virtual rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigOptions {
    /// A rig that takes the place of arrangement, image size, depth and period; `None` for those below.
    pub given: Option<GivenRig>,
    /// Arrangement of cameras and projector.
    pub arrangement: Arrangement,
    /// Where the centre of the projector stands instead, in the frame of C1, millimetres. It is aimed at the middle of
    /// the volume. `None` for the place of the arrangement or of the given rig.
    pub projector_at_mm: Option<[f64; 3]>,
    /// Width and height of the camera images, pixels.
    pub size_px: [usize; 2],
    /// Depth of the measurement volume, metres. The volume is 100 mm × 80 mm wide.
    pub depth_m: f64,
    /// Fringe period, projector pixels.
    pub period_px: f64,
    /// Standard deviation of δ of true correspondences caused by the calibration error alone, rad.
    pub sd_rad: f64,
    /// Size of the errors of k2, p1 and p2 of the lenses, relative to each other error of the calibration; 0 for none.
    /// They do not change the standard deviation of δ, but make its variation over image and depth more complex.
    pub lens_error: f64,
    /// Seed of the calibration error.
    pub seed: u64,
}

impl RigOptions {
    /// A table-top rig with the sd and the number of periods of the paper (sd 0.041 rad, n about 6), for a volume of
    /// this depth.
    #[must_use]
    pub const fn usual(depth_m: f64) -> Self {
        let arrangement = Arrangement::TABLE_TOP;
        let (size_px, period_px, sd_rad) = ([640, 512], 16.0, 0.041);
        let (given, projector_at_mm, lens_error, seed) = (None, None, 0.0, 1);
        Self { given, arrangement, projector_at_mm, size_px, depth_m, period_px, sd_rad, lens_error, seed }
    }

    /// The fringes of a projector without a pattern of its own.
    #[must_use]
    pub fn pattern(&self) -> FringePattern {
        usual_fringes(self.period_px)
    }

    /// Whether the projector is as far from the volume as in the built-in rig.
    fn has_usual_light(&self) -> bool {
        let is_built_in = self.given.is_none() && self.projector_at_mm.is_none();
        is_built_in && self.arrangement.distance_m == Arrangement::TABLE_TOP.distance_m
    }

    /// These options with a rig of the user.
    #[must_use]
    pub fn with_given(self, given: GivenRig) -> Self {
        let size_px = [given.rig.cam1.width_px(), given.rig.cam1.height_px()];
        let depth_m = given.volume.max().z - given.volume.min().z;
        Self { given: Some(given), size_px, depth_m, period_px: given.pattern.period_px, ..self }
    }
}

/// A simulated sensor, and its calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualRig {
    /// The rig that takes the images.
    pub exact: Rig,
    /// The rig as calibrated.
    pub calibrated: Rig,
    /// Measurement volume in the frame of the exact C1.
    pub exact_volume: MeasurementVolume,
    /// Measurement volume in the frame of the calibrated C1, which is the frame of points triangulated with the
    /// calibration.
    pub volume: MeasurementVolume,
    /// Fringes along the projector's columns.
    pub columns: FringePattern,
    /// Fringes along the projector's rows, for the second direction.
    pub rows: FringePattern,
    /// Size of the calibration error.
    pub deviation: CalibrationDeviation,
}

/// Side of the square display of the projector, pixels.
const PROJECTOR_PX: usize = 1024;
/// Image size to which the focal length of the arrangement refers, pixels.
const NOMINAL_PX: [f64; 2] = [640.0, 512.0];
/// Largest depth of the measurement volume of the built-in rig, and of a given rig, millimetres.
const MAX_DEPTH_MM: f64 = 300.0;
const MAX_GIVEN_DEPTH_MM: f64 = 2000.0;
/// Largest relative errors of k2, p1 and p2.
const MAX_LENS_ERROR: f64 = 10.0;
/// Distance of the projector of [`Arrangement::TABLE_TOP`] from the middle of the volume, rounded, millimetres.
const USUAL_DISTANCE_MM: f64 = 310.0;
/// Half the width and height of the measurement volume, metres.
const VOLUME_HALF_M: [f64; 2] = [0.05, 0.04];

impl VirtualRig {
    /// Builds the rig and draws its calibration error.
    ///
    /// # Errors
    /// [`SimulationError`]: an option is out of range, or the calibration error is too large for this rig.
    pub fn new(options: &RigOptions) -> Result<Self, SimulationError> {
        for size in options.size_px {
            check_range("image size", size as f64, 64.0, 4096.0, "px")?;
        }
        let most_mm = if options.given.is_some() { MAX_GIVEN_DEPTH_MM } else { MAX_DEPTH_MM };
        check_range("depth", options.depth_m * 1e3, 1.0, most_mm, "mm")?;
        check_range("period", options.period_px, 4.0, 256.0, "px")?;
        check_range("sd", options.sd_rad, 0.0, 1.0, "rad")?;
        check_range("the lens error", options.lens_error, 0.0, MAX_LENS_ERROR, "")?;
        let (exact, exact_volume, columns) = match &options.given {
            Some(given) => (given.rig, given.centred_volume()?, given.pattern),
            None => {
                let (rig, volume) = exact_rig(&options.arrangement, options.size_px, options.depth_m)?;
                (rig, volume, options.pattern())
            }
        };
        let exact = match options.projector_at_mm {
            Some(at_mm) => with_projector_at(&exact, &exact_volume, at_mm)?,
            None => exact,
        };
        let draws = Draws::new(options.seed, options.lens_error);
        let drawn = calibration_error::draw(&exact, &exact_volume, &columns, options.sd_rad, draws)?;
        let (min, max) = (*exact_volume.min(), *exact_volume.max());
        let volume = MeasurementVolume::new(drawn.cam1_from_volume, min, max)?;
        Ok(Self {
            exact,
            calibrated: drawn.rig,
            exact_volume,
            volume,
            columns,
            rows: columns,
            deviation: drawn.deviation,
        })
    }

    /// Light that the projector sends to the middle of the volume, relative to that of the built-in rig. `options` are
    /// those of this rig. The exposure of its cameras evens the light out.
    pub(super) fn light(&self, options: &RigOptions) -> f64 {
        if options.has_usual_light() {
            return 1.0;
        }
        let target = self.exact_volume.cam1_from_volume() * Point3::origin();
        (USUAL_DISTANCE_MM / ((target - self.exact.centre_of_projector()).norm() * MM_PER_M)).powi(2)
    }

    /// Number of Gray-code images that distinguish all half periods of the display.
    #[must_use]
    pub fn gray_images(&self) -> usize {
        gray_bits(self.exact.projector.width_px(), self.columns.period_px) as usize
    }

    /// Mean number of fringe periods on an epipolar segment, the `n` of Eq. 1: the periods that C2 sees between both
    /// ends of a segment on the middle plane of the volume.
    #[must_use]
    pub fn mean_periods(&self) -> f64 {
        let (columns, rows) = (9, 7);
        let (width, height) = (self.exact.cam1.width_px() as f64, self.exact.cam1.height_px() as f64);
        let mut periods = Vec::new();
        for i in 0..columns * rows {
            let u = width * (f64::from(i % columns) + 0.5) / f64::from(columns);
            let v = height * (f64::from(i / columns) + 0.5) / f64::from(rows);
            periods.extend(self.periods_on_segment(u, v));
        }
        periods.iter().sum::<f64>() / periods.len().max(1) as f64
    }

    fn periods_on_segment(&self, u_px: f64, v_px: f64) -> Option<f64> {
        let ray = self.exact.cam1.ray(&[u_px, v_px].into())?;
        let (near, far) = self.exact_volume.clip(&ray)?;
        let column = |depth: f64| {
            let on_plane = self.on_middle_plane(&Point3::from(ray * depth))?;
            Some(self.exact.project_projector(&on_plane)?.x)
        };
        Some((column(far)? - column(near)?).abs() / self.columns.period_px)
    }

    /// Intersects the ray of C2 to a point with the middle plane of the volume, in the frame of C1.
    fn on_middle_plane(&self, point: &Point3) -> Option<Point3> {
        let volume_from_cam1 = self.exact_volume.cam1_from_volume().inverse();
        let (eye, target) = (volume_from_cam1 * self.exact.centre_of_cam2(), volume_from_cam1 * point);
        let share = eye.z / (eye.z - target.z);
        share.is_finite().then(|| self.exact_volume.cam1_from_volume() * (eye + (target - eye) * share))
    }
}

/// Returns the rig without error, and its volume. The frame of the volume is x right, y down, z away from the sensor.
fn exact_rig(
    arrangement: &Arrangement,
    size_px: [usize; 2],
    depth_m: f64,
) -> Result<(Rig, MeasurementVolume), SimulationError> {
    let a = arrangement;
    // A slight asymmetry, since no assembled sensor is level to the micrometre.
    let centre1 = Point3::new(-a.base_m / 2.0, 0.0, -a.distance_m);
    let base = Vector3::new(a.base_m, 0.0018, 0.001);
    let above = Vector3::new(0.0, -a.projector_height_m, -0.004);
    let across = above - base * (above.dot(&base) / base.norm_squared());
    let cam1 = looking_at_centre(centre1, 0.006);
    let cam2 = looking_at_centre(centre1 + base, -0.009);
    let projector = looking_at_centre(centre1 + base * a.projector_place + across, a.projector_roll_rad);
    let lens = |coefficients: [f64; 5]| {
        if a.distorted { Distortion::from_opencv(&coefficients) } else { Distortion::default() }
    };
    let rig = Rig {
        cam1: camera(a.camera_focal_px, [1.8, -3.9], lens([-0.115, 0.31, 5.0e-4, -4.0e-4, 0.0]), size_px),
        cam2: camera(a.camera_focal_px * 0.9985, [-3.1, 2.6], lens([-0.108, 0.27, -6.0e-4, 5.0e-4, 0.0]), size_px),
        projector: projector_lens(a.projector_focal_px, lens([-0.05, 0.12, 3.0e-4, 2.0e-4, 0.0])),
        cam2_from_cam1: cam2 * cam1.inverse(),
        projector_from_cam1: projector * cam1.inverse(),
    };
    let [x, y] = VOLUME_HALF_M;
    let corner = Point3::new(x, y, depth_m / 2.0);
    Ok((rig, MeasurementVolume::new(cam1, -corner, corner)?))
}

/// Returns the pose `camera_from_volume` of a camera at `eye` that looks at the origin of the volume, rotated by
/// `roll_rad`.
pub(super) fn looking_at_centre(eye: Point3, roll_rad: f64) -> Pose {
    let z = -eye.coords.normalize();
    let x = Vector3::y().cross(&z).normalize();
    let y = z.cross(&x);
    let rows = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
    let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), roll_rad) * Rotation3::from_matrix_unchecked(rows);
    let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
    Pose::from_parts(Translation3::from(rotation * -eye.coords), rotation)
}

/// Creates a camera from nominal numbers for 640 × 512 pixels, scaled to its image size.
fn camera(focal_px: f64, off_centre_px: [f64; 2], lens: Distortion, size_px: [usize; 2]) -> Camera {
    let scale = (size_px[0] as f64 / NOMINAL_PX[0]).min(size_px[1] as f64 / NOMINAL_PX[1]);
    let principal = [0, 1].map(|i| (size_px[i] as f64 - 1.0) / 2.0 + off_centre_px[i] * scale);
    Camera::new([focal_px * scale, focal_px * scale * 1.0004], principal, lens, size_px)
}

fn projector_lens(focal_px: f64, lens: Distortion) -> Camera {
    Camera::new([focal_px, focal_px], [514.3, 508.2], lens, [PROJECTOR_PX, PROJECTOR_PX])
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn options() -> RigOptions {
        RigOptions::usual(0.025)
    }

    #[test]
    fn the_usual_rig_has_the_numbers_of_the_paper() {
        let rig = VirtualRig::new(&options()).unwrap();
        let n = rig.mean_periods();
        assert!((5.5..6.5).contains(&n), "n {n}");
        let efc = 3.0 * rig.deviation.delta_rms * (n - 1.0) / PI;
        assert!((0.17..0.22).contains(&efc), "efc {efc}");
        assert!((rig.exact.projector_place_on_base() - 0.38).abs() < 1e-9);
        assert_eq!(rig.gray_images(), 7);
    }

    #[test]
    fn the_calibration_error_has_its_size_and_is_hardly_vertical() {
        for seed in 0..12 {
            for sd_rad in [0.004, 0.041, 0.12] {
                let rig = VirtualRig::new(&RigOptions { seed, sd_rad, ..options() }).unwrap();
                let d = rig.deviation;
                assert!((d.delta_rms - sd_rad).abs() < 1e-6, "seed {seed}: {d:?}");
                assert!(d.delta_mean.abs() < 1e-6 && d.epi_rms < 0.1, "seed {seed}: {d:?}");
                assert!(rig.calibrated != rig.exact);
            }
        }
    }

    #[test]
    fn a_lens_error_changes_the_lenses_and_not_the_sd_of_delta() {
        let with = |lens_error| VirtualRig::new(&RigOptions { lens_error, ..options() }).unwrap();
        let (none, large) = (with(0.0), with(5.0));
        let coefficients = |rig: &VirtualRig| {
            [&rig.calibrated.cam2, &rig.calibrated.projector]
                .map(|lens| (lens.distortion().radial[1], lens.distortion().tangential))
        };
        let exact = [&none.exact.cam2, &none.exact.projector]
            .map(|lens| (lens.distortion().radial[1], lens.distortion().tangential));
        assert_eq!(coefficients(&none), exact);
        for (is, exact) in coefficients(&large).into_iter().zip(exact) {
            assert!(is.0 != exact.0 && is.1[0] != exact.1[0] && is.1[1] != exact.1[1], "{is:?}");
        }
        assert_eq!(large.exact, none.exact);
        assert!(
            (large.deviation.delta_rms - 0.041).abs() < 1e-6 && large.deviation.epi_rms < 0.1,
            "{:?}",
            large.deviation
        );
        assert!(VirtualRig::new(&RigOptions { lens_error: -1.0, ..options() }).is_err());
    }

    #[test]
    fn without_calibration_error_both_rigs_agree() {
        let rig = VirtualRig::new(&RigOptions { sd_rad: 0.0, ..options() }).unwrap();
        assert_eq!(rig.calibrated, rig.exact);
        assert_eq!(rig.volume, rig.exact_volume);
    }

    #[test]
    fn depth_and_period_change_the_number_of_periods() {
        let periods = |o: RigOptions| VirtualRig::new(&o).unwrap().mean_periods();
        let usual = periods(options());
        assert!(periods(RigOptions { depth_m: 0.05, ..options() }) > 1.8 * usual);
        assert!((periods(RigOptions { period_px: 32.0, ..options() }) - usual / 2.0).abs() < 1e-9);
        let large = periods(RigOptions { size_px: [1280, 1024], ..options() });
        assert!((large - usual).abs() < 0.05 * usual);
    }

    #[test]
    fn options_out_of_range_are_refused_with_their_value() {
        let refused = VirtualRig::new(&RigOptions { depth_m: f64::NAN, ..options() }).unwrap_err();
        assert!(refused.to_string().contains("depth is NaN mm"), "{refused}");
        assert!(VirtualRig::new(&RigOptions { size_px: [0, 512], ..options() }).is_err());
        assert!(VirtualRig::new(&RigOptions { period_px: 0.0, ..options() }).is_err());
    }
}
