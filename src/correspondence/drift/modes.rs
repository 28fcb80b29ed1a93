//! Drift modes: the fields of δ that calibration errors of a rig can cause.
//!
//! In: rig, measurement volume, pattern. Each parameter of the calibration is changed so far that the image of its
//! device moves by a pixel at its border. The change of δ over the volume is a field. The fields of all parameters are
//! strongly correlated; their principal components, a dozen or two, are the modes. The coefficient of a mode is a
//! calibration error in pixels.

use nalgebra::{DMatrix, SymmetricEigen, Translation3, UnitQuaternion};

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::geometry::{
    Camera, Distortion, EpipolarFrame, FringePattern, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3, triangulate,
};

use super::coordinates::{DriftCoordinates, Polynomial, TERMS, monomials};

/// Most modes kept.
pub(super) const MAX_MODES: usize = 20;
/// Root mean square of a mode, turns per pixel (0.0006 rad), below which it is negligible.
const MIN_RMS_TURNS: f64 = 1e-4;
/// Sampling points along x, y and z of the volume.
const SAMPLES: [usize; 3] = [11, 9, 7];
/// How far the samples reach beyond the volume in depth, as share of it: candidates are sought there too.
const DEPTH_MARGIN: f64 = 0.5;
/// Pixels beyond an image in which its distortion is still trusted.
const IMAGE_MARGIN_PX: f64 = 30.0;
/// Change of a parameter, pixels at the border of the image.
const STEP_PX: f64 = 0.3;
/// Parameters of a device: scale of both axes and of one, principal point, distortion k1, k2, p1, p2; then its pose.
const INTRINSIC: usize = 8;
const EXTRINSIC: usize = 6;

/// The drift modes of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct DriftModes {
    pub(super) places: DriftCoordinates,
    /// δ of each mode, turns per pixel of calibration error.
    pub(super) fields: Vec<Polynomial>,
    /// Root mean square of each mode over the volume, turns per pixel.
    pub(super) rms_turns: Vec<f64>,
    pub(super) by_term: ModesByTerm,
}

impl DriftModes {
    /// The terms of a field at a pixel of C1 and a column of the epipolar frame: 1, then δ of each mode, turns per pixel of
    /// calibration error; zero for modes that the rig lacks.
    pub(in crate::correspondence) fn terms(&self, pixel: [usize; 2], column_px: f32) -> FieldTerms {
        self.by_term.terms(pixel, column_px)
    }

    /// Length of the modes of any rig as numbers.
    pub(in crate::correspondence) const NUMBERS: usize = DriftCoordinates::NUMBERS + MAX_MODES * (1 + TERMS);

    /// The modes of a rig. `None` if too few points of the volume are seen by all devices.
    pub(in crate::correspondence) fn new(
        rig: &Rig,
        volume: &MeasurementVolume,
        pattern: &FringePattern,
        frame: &EpipolarFrame,
        limits_px: impl Fn(usize) -> [f32; 2],
    ) -> Option<Self> {
        let places = DriftCoordinates::fit([rig.cam1.width_px(), rig.cam1.height_px()], limits_px)?;
        let samples = Samples::new(rig, volume, pattern, frame, &places);
        let (fields, rms_turns) = samples.principal_fields()?;
        Some(Self { places, by_term: ModesByTerm::new(places, &fields), fields, rms_turns })
    }

    /// As numbers for a file.
    pub(in crate::correspondence) fn to_numbers(&self) -> Vec<f64> {
        let mut numbers = self.places.to_numbers().to_vec();
        for (rms, field) in self.rms_turns.iter().zip(&self.fields) {
            numbers.push(*rms);
            numbers.extend(field);
        }
        numbers.resize(Self::NUMBERS, 0.0);
        numbers
    }

    /// From the numbers of a file. `None` if they are invalid.
    pub(in crate::correspondence) fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let (places, modes) = numbers.split_first_chunk::<{ DriftCoordinates::NUMBERS }>()?;
        let used = modes.chunks_exact(1 + TERMS).take_while(|mode| mode[0] > 0.0);
        let (rms_turns, fields): (Vec<f64>, Vec<Polynomial>) =
            used.map(|mode| (mode[0], std::array::from_fn(|i| mode[1 + i]))).unzip();
        let sound = numbers.len() == Self::NUMBERS && numbers.iter().all(|n| n.is_finite());
        let places = DriftCoordinates::from_numbers(*places);
        (sound && places.scale_px() >= 1.0).then(|| Self {
            places,
            by_term: ModesByTerm::new(places, &fields),
            fields,
            rms_turns,
        })
    }

    /// Mean half length of a segment, pixels of the epipolar frame.
    pub(in crate::correspondence) fn half_segment_px(&self) -> f64 {
        self.places.scale_px()
    }
}

/// The terms of a field of δ: that of its mean, and those of the modes.
pub(in crate::correspondence) type FieldTerms = [f64; 1 + MAX_MODES];
/// Modes evaluated at once: enough to keep the pipeline full.
const GROUP: usize = 32;

/// All modes, term by term, for fast evaluation.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ModesByTerm {
    places: DriftCoordinates,
    /// Factors of each term; zero for missing modes.
    factors: Vec<[f64; GROUP]>,
}

impl ModesByTerm {
    fn new(places: DriftCoordinates, fields: &[Polynomial]) -> Self {
        let mut factors = vec![[0.0; GROUP]; TERMS];
        for (k, mode) in fields.iter().enumerate() {
            factors.iter_mut().zip(mode).for_each(|(of_term, factor)| of_term[k] = *factor);
        }
        Self { places, factors }
    }

    fn terms(&self, [u, v]: [usize; 2], column_px: f32) -> FieldTerms {
        let place = self.places.place(u as f64, v as f64, f64::from(column_px));
        let of_modes = fringeflow_simd::run(Level::in_use(), ModeKernel { factors: &self.factors, place });
        std::array::from_fn(|k| if k == 0 { 1.0 } else { of_modes[k - 1] })
    }
}

/// Evaluates all modes at a place.
struct ModeKernel<'a> {
    factors: &'a [[f64; GROUP]],
    place: [f64; 3],
}

impl Kernel for ModeKernel<'_> {
    type Output = [f64; GROUP];

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> [f64; GROUP] {
        let mut sums = [0.0; GROUP];
        for (factors, monomial) in self.factors.iter().zip(monomials(self.place)) {
            for k in 0..GROUP {
                sums[k] += factors[k] * monomial;
            }
        }
        sums
    }
}

/// Sampling points in the volume: where the devices see them, and the monomials there.
struct Samples<'a> {
    rig: &'a Rig,
    pattern: &'a FringePattern,
    /// Pixel of C1, pixel of C2, and absolute phase in turns.
    seen: Vec<(Pixel, Pixel, f64)>,
    monomials: DMatrix<f64>,
    /// Distance of the volume from C1, metres.
    distance_m: f64,
}

impl<'a> Samples<'a> {
    fn new(
        rig: &'a Rig,
        volume: &MeasurementVolume,
        pattern: &'a FringePattern,
        frame: &EpipolarFrame,
        places: &DriftCoordinates,
    ) -> Self {
        let mut seen = Vec::new();
        let mut rows = Vec::new();
        for point in points(volume) {
            let Some((p, q, lit)) = seen_by_all(rig, &point) else { continue };
            let Some(line) = rig.cam1.ray(&p).and_then(|ray| frame.line(&ray)) else { continue };
            rows.push(monomials(places.place(p.x, p.y, line.column_of_depth(point.z))));
            seen.push((p, q, pattern.phase_turns(lit.x)));
        }
        let monomials = DMatrix::from_fn(rows.len(), TERMS, |i, j| rows[i][j]);
        let distance_m = (volume.cam1_from_volume() * nalgebra::center(volume.min(), volume.max())).coords.norm();
        Self { rig, pattern, seen, monomials, distance_m }
    }

    /// The field of δ if the true rig is the `changed` one, turns; `None` if a point is lost.
    fn field(&self, changed: &Rig) -> Option<Vec<f64>> {
        let delta = |(p, q, phase_turns): &(Pixel, Pixel, f64)| {
            let point = triangulate(changed, p, q)?.point_cam1;
            Some(self.pattern.phase_turns(changed.project_projector(&point)?.x) - phase_turns)
        };
        self.seen.iter().map(delta).collect()
    }

    /// Modes and their root mean squares, the strongest first.
    fn principal_fields(&self) -> Option<(Vec<Polynomial>, Vec<f64>)> {
        let count = self.seen.len();
        if count < 2 * TERMS {
            return None;
        }
        let centred = |mut field: Vec<f64>| {
            let mean = field.iter().sum::<f64>() / count as f64;
            // The mean of δ is estimated by itself.
            field.iter_mut().for_each(|d| *d = (*d - mean) / STEP_PX);
            field
        };
        let fields: Vec<Vec<f64>> =
            changed_rigs(self.rig, self.distance_m).iter().filter_map(|rig| self.field(rig)).map(centred).collect();
        let fields = DMatrix::from_fn(count, fields.len(), |i, j| fields[j][i]);
        let transposed = self.monomials.transpose();
        // Each field as a polynomial, by least squares.
        let normal = &transposed * &self.monomials + DMatrix::identity(TERMS, TERMS) * 1e-6;
        let polynomials = normal.cholesky()?.solve(&(transposed * fields));
        let smooth = &self.monomials * &polynomials;
        // Principal components of the fields over the samples.
        let eigen = SymmetricEigen::new(smooth.transpose() * &smooth / count as f64);
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let rms = |&k: &usize| eigen.eigenvalues[k].max(0.0).sqrt();
        let kept = order.iter().filter(|k| rms(k) >= MIN_RMS_TURNS).take(MAX_MODES);
        let mode = |k: &usize| {
            let coefficients = &polynomials * eigen.eigenvectors.column(*k);
            (std::array::from_fn(|i| coefficients[i]), rms(k))
        };
        Some(kept.map(mode).unzip())
    }
}

/// Points all over the volume and some way before and behind it, frame of C1, metres.
fn points(volume: &MeasurementVolume) -> impl Iterator<Item = Point3> + '_ {
    let extent = volume.max() - volume.min();
    let [nx, ny, nz] = SAMPLES;
    (0..nx * ny * nz).map(move |i| {
        let share = |place: usize, count: usize| (place as f64 + 0.5) / count as f64;
        let depth = share(i / (nx * ny), nz) * (1.0 + 2.0 * DEPTH_MARGIN) - DEPTH_MARGIN;
        let shares = Vector3::new(share(i % nx, nx), share(i / nx % ny, ny), depth);
        volume.cam1_from_volume() * (volume.min() + extent.component_mul(&shares))
    })
}

/// Where C1, C2 and P see a point, if all do.
fn seen_by_all(rig: &Rig, point: &Point3) -> Option<(Pixel, Pixel, Pixel)> {
    let near = |camera: &Camera, pixel: &Pixel| {
        let (right, bottom) = (camera.width_px() as f64, camera.height_px() as f64);
        let range = |limit: f64| -IMAGE_MARGIN_PX..limit + IMAGE_MARGIN_PX;
        range(right).contains(&pixel.x) && range(bottom).contains(&pixel.y)
    };
    let (p, q, lit) = (rig.cam1.project(point)?, rig.project_cam2(point)?, rig.project_projector(point)?);
    let all = near(&rig.cam1, &p) && near(&rig.cam2, &q) && near(&rig.projector, &lit);
    all.then_some((p, q, lit))
}

/// Copies of the rig, each with one parameter of one device changed. The pose of C1 defines the frame and stays.
fn changed_rigs(rig: &Rig, distance_m: f64) -> Vec<Rig> {
    let mut rigs = Vec::new();
    for parameter in 0..INTRINSIC {
        rigs.push(Rig { cam1: changed_camera(&rig.cam1, parameter), ..*rig });
        rigs.push(Rig { cam2: changed_camera(&rig.cam2, parameter), ..*rig });
        rigs.push(Rig { projector: changed_camera(&rig.projector, parameter), ..*rig });
    }
    for parameter in 0..EXTRINSIC {
        let cam2_from_cam1 = changed_pose(&rig.cam2_from_cam1, &rig.cam2, parameter, distance_m);
        rigs.push(Rig { cam2_from_cam1, ..*rig });
        let projector_from_cam1 = changed_pose(&rig.projector_from_cam1, &rig.projector, parameter, distance_m);
        rigs.push(Rig { projector_from_cam1, ..*rig });
    }
    rigs
}

fn changed_camera(camera: &Camera, parameter: usize) -> Camera {
    let (mut focal_px, mut principal_px) = (camera.focal_px(), camera.principal_px());
    let mut lens: Distortion = *camera.distortion();
    let border_px = camera.width_px() as f64 / 2.0;
    let border = border_px / focal_px[0];
    let step = STEP_PX / focal_px[0];
    match parameter {
        0 => focal_px = focal_px.map(|f| f * (1.0 + STEP_PX / border_px)),
        1 => focal_px[1] *= 1.0 + STEP_PX / border_px,
        2 => principal_px[0] += STEP_PX,
        3 => principal_px[1] += STEP_PX,
        4 => lens.radial[0] += step / border.powi(3),
        5 => lens.radial[1] += step / border.powi(5),
        6 => lens.tangential[0] += step / border.powi(2),
        _ => lens.tangential[1] += step / border.powi(2),
    }
    let size_px = [camera.width_px(), camera.height_px()];
    Camera::new(focal_px, principal_px, lens, size_px).with_skew(camera.skew_px())
}

fn changed_pose(pose: &Pose, camera: &Camera, parameter: usize, distance_m: f64) -> Pose {
    let step = STEP_PX / camera.focal_px()[0];
    let at_border = STEP_PX / (camera.width_px() as f64 / 2.0);
    let (mut turn, mut shift) = (Vector3::zeros(), Vector3::zeros());
    match parameter {
        0 | 1 => turn[parameter] = step,
        2 => turn.z = at_border,
        3 | 4 => shift[parameter - 3] = step * distance_m,
        _ => shift.z = at_border * distance_m,
    }
    Pose::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn)) * pose
}
