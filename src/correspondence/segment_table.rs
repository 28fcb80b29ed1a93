//! The segment table: for every pixel of C1 its epipolar segment in C2, as far as the measurement volume leaves it, and
//! the back-projection phase along it (paper, sections 2.1 and 2.3).
//!
//! In: rig, measurement volume, fringe pattern. Out: 32 bytes a pixel of C1, a map that resamples an image of C2 into the
//! epipolar frame, and the fields of δ that calibration errors cause. Everything that depends on the calibration alone is done here, once, in `f64`.

use nalgebra::Point2;
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use crate::geometry::{
    EpipolarError, EpipolarFrame, EpipolarLine, FringePattern, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3,
};

use super::drift::DriftModes;

/// Share of a segment that is added at either end: the place of the volume is known no better than the calibration.
const VOLUME_MARGIN: f64 = 0.02;

/// Pixels along either axis of which one is asked how its row changes.
const AXIS_STRIDE: usize = 8;

/// Axis of C1's image along which the epipolar lines run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EpipolarAxis {
    /// Along the rows of the image: cameras side by side.
    Horizontal,
    /// Along the columns of the image: one camera above the other.
    Vertical,
}

/// The epipolar segment of one pixel of C1, in the epipolar frame of C2.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Segment {
    /// Ray of the pixel in the frame of C1, scaled to z = 1: x and y.
    pub ray: [f32; 2],
    /// Row, pixels.
    pub row_px: f32,
    /// First column, pixels; beyond `end_px` where there is no segment.
    pub begin_px: f32,
    /// Last column, pixels.
    pub end_px: f32,
    /// Coefficients (a, b, d) of the back-projection phase, see [`Self::phase_turns`].
    pub phase: [f32; 3],
}

impl Segment {
    /// A pixel whose ray misses the volume or whose segment lies outside the image of C2.
    const NONE: Self = Self { ray: [0.0; 2], row_px: 0.0, begin_px: 1.0, end_px: 0.0, phase: [0.0; 3] };

    /// Whether the pixel has no segment.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.begin_px > self.end_px
    }

    /// First and last column, pixels.
    #[must_use]
    #[inline]
    pub fn limits_px(&self) -> [f32; 2] {
        [self.begin_px, self.end_px]
    }

    /// Back-projection phase Φ in turns of the point seen at a column: `(a + b·t) / (1 + d·t)`, t the column from
    /// `begin_px`. Exact for a projector without distortion, to 0.002 turns with.
    #[must_use]
    #[inline]
    pub fn phase_turns(&self, column_px: f32) -> f32 {
        let [a, b, d] = self.phase;
        let t = column_px - self.begin_px;
        (a + b * t) / (1.0 + d * t)
    }

    /// Column at which the back-projection phase has a value, turns; infinite or NaN where it has none.
    #[must_use]
    #[inline]
    pub fn column_of_phase(&self, phase_turns: f32) -> f32 {
        let [a, b, d] = self.phase;
        self.begin_px + (phase_turns - a) / (b - d * phase_turns)
    }

    /// That column, and how many columns the phase takes there for a turn.
    #[inline]
    pub(super) fn column_and_columns_per_turn(&self, phase_turns: f32) -> (f32, f32) {
        let [a, b, d] = self.phase;
        let inverse = 1.0 / (b - d * phase_turns);
        (self.begin_px + (phase_turns - a) * inverse, (b - a * d) * inverse * inverse)
    }
}

/// Where one pixel of the epipolar frame lies in the raw image of C2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct SourcePixel {
    /// Index of the upper left of the four pixels around it; [`Self::OUTSIDE`] where the image does not reach.
    pub index: u32,
    /// Share of the right neighbours, 1/65536.
    pub right: u16,
    /// Share of the lower neighbours, 1/65536.
    pub below: u16,
}

impl SourcePixel {
    /// Index of pixels that the image of C2 does not reach.
    pub const OUTSIDE: u32 = u32::MAX;
    const NONE: Self = Self { index: Self::OUTSIDE, right: 0, below: 0 };
}

/// Hash of everything that a segment table depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(pub [u8; 32]);

/// The lookup table of all epipolar segments of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentTable {
    pub(super) fingerprint: Fingerprint,
    /// Width of C1's image, pixels.
    pub(super) width: usize,
    /// Width and height of C2's image, pixels.
    pub(super) cam2_size_px: [usize; 2],
    /// Width of the epipolar frame, pixels.
    pub(super) epipolar_width: usize,
    /// Direction from the centre of C1 to the centre of C2 in the frame of C1, of length 1.
    pub(super) base: [f32; 3],
    pub(super) modes: Option<DriftModes>,
    pub(super) segments: Vec<Segment>,
    pub(super) sources: Vec<SourcePixel>,
}

/// Why no segment table can be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SegmentTableError {
    /// The rig has no epipolar frame.
    #[error(transparent)]
    Epipolar(#[from] EpipolarError),
    /// No pixel of C1 has a segment.
    #[error(
        "the measurement volume is never seen: {hit} of {pixels} pixels of camera 1 look into it, and camera 2 sees none \
         of these; check the volume's pose and the unit"
    )]
    NeverSeen {
        /// Pixels of C1 whose ray meets the volume.
        hit: usize,
        /// Pixels of C1.
        pixels: usize,
    },
    /// The projector never lights the volume.
    #[error("the projector does not look at the measurement volume; check Rp, Tp and the volume's pose")]
    NeverLit,
}

impl SegmentTable {
    /// Computes the table, in parallel over rows.
    ///
    /// # Errors
    /// A rig without epipolar frame, or a volume that C2 never sees or P never lights.
    pub fn build(rig: &Rig, volume: &MeasurementVolume, pattern: &FringePattern) -> Result<Self, SegmentTableError> {
        let frame = EpipolarFrame::new(rig)?;
        let (width, height) = (rig.cam1.width_px(), rig.cam1.height_px());
        let builder = Builder { rig, volume, pattern, frame: &frame };
        let mut segments = vec![Segment::NONE; width * height];
        segments.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
            for (u, segment) in row.iter_mut().enumerate() {
                *segment = builder.segment(u, v).unwrap_or(Segment::NONE);
            }
        });
        if segments.iter().all(Segment::is_none) {
            return Err(builder.why_none());
        }
        let mut sources = vec![SourcePixel::NONE; frame.width_px() * frame.height_px()];
        sources.par_chunks_mut(frame.width_px()).enumerate().for_each(|(row, sources)| {
            for (column, source) in sources.iter_mut().enumerate() {
                *source = builder.source(column, row).unwrap_or(SourcePixel::NONE);
            }
        });
        let fingerprint = Fingerprint::of(rig, volume, pattern);
        let cam2_size_px = [rig.cam2.width_px(), rig.cam2.height_px()];
        let base = rig.centre_of_cam2().coords.normalize().cast::<f32>().into();
        let modes = DriftModes::of(rig, volume, pattern, &frame, &segments);
        Ok(Self { fingerprint, width, cam2_size_px, epipolar_width: frame.width_px(), base, modes, segments, sources })
    }

    /// Segments of all pixels of C1, row by row.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// Width and height of C1's image, pixels.
    #[must_use]
    pub fn size_px(&self) -> [usize; 2] {
        [self.width, self.segments.len() / self.width]
    }

    /// Width and height of the epipolar frame, pixels.
    #[must_use]
    pub fn epipolar_size_px(&self) -> [usize; 2] {
        [self.epipolar_width, self.sources.len() / self.epipolar_width]
    }

    /// Where the pixels of the epipolar frame lie in C2, row by row.
    #[must_use]
    pub fn sources(&self) -> &[SourcePixel] {
        &self.sources
    }

    /// The axis of C1's image that epipolar lines are closest to: the one along which the row changes less.
    #[must_use]
    pub fn epipolar_axis(&self) -> EpipolarAxis {
        let (mut along_rows, mut along_columns) = (0.0_f64, 0.0_f64);
        let change = |a: usize, b: usize| {
            let (a, b) = (&self.segments[a], &self.segments[b]);
            if a.is_none() || b.is_none() { 0.0 } else { f64::from((a.row_px - b.row_px).abs()) }
        };
        // A fraction of the pixels tells.
        let rows = (0..self.segments.len().saturating_sub(self.width)).step_by(AXIS_STRIDE * self.width);
        for i in rows.flat_map(|row| (row..row + self.width - 1).step_by(AXIS_STRIDE)) {
            along_rows += change(i, i + 1);
            along_columns += change(i, i + self.width);
        }
        if along_rows <= along_columns { EpipolarAxis::Horizontal } else { EpipolarAxis::Vertical }
    }

    /// How near to C2 a pixel of C1 sees its point, among all pixels that see one in the same place of C2: the larger, the
    /// nearer. It is the cosine of the angle between the ray of the pixel and the base; in the triangle of the two
    /// centres and a point that comes nearer on its ray of C2, this angle shrinks.
    #[must_use]
    #[inline]
    pub fn nearness_to_cam2(&self, pixel: usize) -> f32 {
        let [x, y] = self.segments[pixel].ray;
        let [bx, by, bz] = self.base;
        (x * bx + y * by + bz) / (x * x + y * y + 1.0).sqrt()
    }

    /// The fields of δ that errors of the calibration can cause; `None` where the volume is too small to tell.
    #[must_use]
    pub fn drift_modes(&self) -> Option<&DriftModes> {
        self.modes.as_ref()
    }

    /// What the table was computed for.
    #[must_use]
    pub fn fingerprint(&self) -> Fingerprint {
        self.fingerprint
    }
}

struct Builder<'a> {
    rig: &'a Rig,
    volume: &'a MeasurementVolume,
    pattern: &'a FringePattern,
    frame: &'a EpipolarFrame,
}

impl Builder<'_> {
    fn segment(&self, u: usize, v: usize) -> Option<Segment> {
        let ray = self.rig.cam1.ray(&Pixel::new(u as f64, v as f64))?;
        let (near_m, far_m) = self.volume.clip(&ray)?;
        let line = self.frame.line(&ray)?;
        let last_row = self.frame.height_px() as f64 - 1.0;
        if !(0.0..=last_row).contains(&line.row_px) {
            return None;
        }
        let (a, b) = (line.column_of_depth(near_m), line.column_of_depth(far_m));
        // The margin must not reach beyond infinity.
        let margin = (VOLUME_MARGIN * (a - b).abs()).min(0.5 * (b - line.column_at_infinity_px).abs());
        let begin = (a.min(b) - margin).max(0.0);
        let end = (a.max(b) + margin).min(self.frame.width_px() as f64 - 1.0);
        if begin >= end {
            return None;
        }
        Some(Segment {
            ray: [ray.x as f32, ray.y as f32],
            row_px: line.row_px as f32,
            begin_px: begin as f32,
            end_px: end as f32,
            phase: self.phase_coefficients(&ray, &line, begin, end)?.map(|c| c as f32),
        })
    }

    /// Linear-fractional function through the back-projection phases at begin, middle and end of a segment.
    fn phase_coefficients(&self, ray: &Vector3, line: &EpipolarLine, begin: f64, end: f64) -> Option<[f64; 3]> {
        let phase = |column: f64| self.back_projected_turns(ray, line.depth_of_column(column));
        let (half, whole) = (0.5 * (end - begin), end - begin);
        let (first, middle, last) = (phase(begin)?, phase(begin + half)?, phase(end)?);
        let (to_middle, to_last) = ((middle - first) / half, (last - first) / whole);
        // A projector at C1 lights each of its rays with one phase: no denominator is needed or determined.
        let d = if (last - middle).abs() > 1e-9 { (to_middle - to_last) / (last - middle) } else { 0.0 };
        Some([first, to_last + last * d, d])
    }

    /// Absolute phase at which P would light the point of a ray at a depth, turns.
    fn back_projected_turns(&self, ray: &Vector3, depth_m: f64) -> Option<f64> {
        let column = self.rig.project_projector(&Point3::from(ray * depth_m))?.x;
        Some(self.pattern.phase_turns(column))
    }

    fn source(&self, column: usize, row: usize) -> Option<SourcePixel> {
        let cam2 = &self.rig.cam2;
        let raw = self.frame.cam2_pixel(&Point2::new(column as f64, row as f64))?;
        let (u, v) = (raw.x.floor(), raw.y.floor());
        let inside = u >= 0.0 && v >= 0.0 && u < (cam2.width_px() - 1) as f64 && v < (cam2.height_px() - 1) as f64;
        inside.then(|| SourcePixel {
            index: (v as usize * cam2.width_px() + u as usize) as u32,
            right: share(raw.x - u),
            below: share(raw.y - v),
        })
    }

    /// Which of the constraints leaves nothing.
    fn why_none(&self) -> SegmentTableError {
        let (width, height) = (self.rig.cam1.width_px(), self.rig.cam1.height_px());
        let ray = |i: usize| self.rig.cam1.ray(&Pixel::new((i % width) as f64, (i / width) as f64));
        let hits: Vec<(Vector3, f64)> = (0..width * height)
            .filter_map(|i| ray(i).and_then(|r| self.volume.clip(&r).map(|(near, far)| (r, 0.5 * (near + far)))))
            .collect();
        let lit = hits.iter().any(|(ray, depth_m)| self.back_projected_turns(ray, *depth_m).is_some());
        if !hits.is_empty() && !lit {
            return SegmentTableError::NeverLit;
        }
        SegmentTableError::NeverSeen { hit: hits.len(), pixels: width * height }
    }
}

/// A share in [0, 1) as a 16-bit fraction.
fn share(fraction: f64) -> u16 {
    (fraction * 65536.0) as u16
}

impl std::fmt::Display for Fingerprint {
    /// As hexadecimal digits.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl Fingerprint {
    /// Hash of calibration, measurement volume, pattern and image sizes.
    #[must_use]
    pub fn of(rig: &Rig, volume: &MeasurementVolume, pattern: &FringePattern) -> Self {
        let mut hash = Sha256::new();
        let mut add = |values: &[f64]| values.iter().for_each(|v| hash.update(v.to_le_bytes()));
        for camera in [&rig.cam1, &rig.cam2, &rig.projector] {
            add(&camera.focal_px());
            add(&camera.principal_px());
            add(&[camera.skew_px(), camera.width_px() as f64, camera.height_px() as f64]);
            add(&camera.distortion().to_opencv());
        }
        for pose in [&rig.cam2_from_cam1, &rig.projector_from_cam1, volume.cam1_from_volume()] {
            add(&pose_numbers(pose));
        }
        add(volume.min().coords.as_slice());
        add(volume.max().coords.as_slice());
        add(&[pattern.period_px, pattern.sign, pattern.offset_rad]);
        Self(hash.finalize().into())
    }
}

fn pose_numbers(pose: &Pose) -> [f64; 7] {
    let (q, t) = (pose.rotation.coords, pose.translation.vector);
    [q.x, q.y, q.z, q.w, t.x, t.y, t.z]
}
