//! The segment table: for every pixel of C1 the epipolar segment in C2 that the measurement volume leaves, and the
//! back-projection phase along it (paper, sections 2.1 and 2.3).
//!
//! In: rig, measurement volume, fringe pattern. Out: both ends of the segment of each pixel of C1, 4 bytes per pixel;
//! smooth quantities as polynomials on patches, less than 2 bytes per pixel; the map that resamples an image of C2 into
//! the epipolar frame, half a byte; the fields of δ that calibration errors cause. Everything that depends on the
//! calibration alone is computed here, once, in `f64`. Code that reads whole images takes [rows](SegmentTable::row).

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::calibration::likely_mistake;
use crate::geometry::{EpipolarFrame, FringePattern, MeasurementVolume, Rig};

use super::drift::DriftModes;
use super::fingerprint::Fingerprint;
use super::patches::{Columns, FieldRow, PATCH_PX, POWERS, Patches};
use super::segment::{Segment, SegmentRow};
use super::segment_builder::Builder;
use super::segment_fields::{
    AT_REFERENCE, DENOMINATOR, FIELDS, NO_LIMITS, RAY_X, RAY_Y, REFERENCE, RISE, ROW, SegmentTableError, padded,
    units_per_px,
};
use super::source_map::SourceMap;
use super::wanted::WantedBlocks;

/// Distance of the sampled pixels, along both axes.
const AXIS_STRIDE: usize = 16;

/// The axis of C1's image along which the epipolar lines run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EpipolarAxis {
    /// Along the rows of the image: cameras side by side.
    Horizontal,
    /// Along the columns of the image: one camera above the other.
    Vertical,
}

/// The lookup table of all epipolar segments of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentTable {
    pub(super) fingerprint: Fingerprint,
    /// Width and height of C1's image, pixels.
    pub(super) size_px: [usize; 2],
    /// Width and height of C2's image, pixels.
    pub(super) cam2_size_px: [usize; 2],
    /// Width and height of the epipolar frame, pixels.
    pub(super) epipolar_size_px: [usize; 2],
    /// Direction from the centre of C1 to the centre of C2 in the frame of C1, of length 1.
    pub(super) base: [f32; 3],
    /// Column of the epipolar frame in which a pixel of C1 sees infinitely far points: that of the first pixel, and the
    /// change per column and per row of C1; pixels.
    pub(super) infinity_px: [f32; 3],
    pub(super) modes: Option<DriftModes>,
    pub(super) fields: Patches<FIELDS>,
    /// Row by row the first columns of all segments, then the last ones, in steps of [`units_per_px`].
    pub(super) limits: Vec<u16>,
    pub(super) sources: SourceMap,
}

impl SegmentTable {
    /// Builds the table, in parallel over rows.
    ///
    /// A patch of 16 × 16 pixels has no segments if the lens of C1 has no ray at its border, or P lights nothing there.
    ///
    /// ```
    /// use fringeflow::correspondence::SegmentTable;
    /// use fringeflow::geometry::{Camera, Distortion, FringePattern, MeasurementVolume, Point3, Pose, Rig, Vector3};
    ///
    /// let camera = Camera::new([100.0; 2], [31.5, 23.5], Distortion::default(), [64, 48]);
    /// let shifted_by = |x_m: f64| Pose::new(Vector3::new(x_m, 0.0, 0.0), Vector3::zeros());
    /// let rig = Rig {
    ///     cam1: camera.clone(),
    ///     cam2: camera.clone(),
    ///     projector: camera,
    ///     cam2_from_cam1: shifted_by(-0.1),
    ///     projector_from_cam1: shifted_by(-0.05),
    /// };
    /// let (min, max) = (Point3::new(-0.2, -0.2, 0.4), Point3::new(0.2, 0.2, 0.6));
    /// let volume = MeasurementVolume::new(Pose::identity(), min, max)?;
    /// let pattern = FringePattern { period_px: 2.0, sign: 1.0, offset_rad: 0.0 };
    /// let table = SegmentTable::build(&rig, &volume, &pattern)?;
    ///
    /// let segment = table.segment(24 * 64 + 40);
    /// let periods = segment.phase_turns(segment.end_px) - segment.phase_turns(segment.begin_px);
    /// assert!((periods.abs() - 2.1).abs() < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The rig has no epipolar frame, C2 never sees the volume, P never lights it, or they would with another pose.
    pub fn build(rig: &Rig, volume: &MeasurementVolume, pattern: &FringePattern) -> Result<Self, SegmentTableError> {
        let frame = EpipolarFrame::new(rig)?;
        if let Some(mistake) = likely_mistake(rig, volume) {
            return Err(SegmentTableError::Mistake(mistake));
        }
        let builder = Builder { rig, volume, pattern, frame: &frame };
        let fields = builder.fields();
        let limits = builder.limits(&fields);
        // Every segment ends behind its beginning.
        if limits.iter().all(|limit| NO_LIMITS.contains(limit)) {
            return Err(builder.why_empty());
        }
        let mut table = Self {
            fingerprint: Fingerprint::new(rig, volume, pattern),
            size_px: [rig.cam1.width_px(), rig.cam1.height_px()],
            cam2_size_px: [rig.cam2.width_px(), rig.cam2.height_px()],
            epipolar_size_px: [frame.width_px(), frame.height_px()],
            base: rig.centre_of_cam2().coords.normalize().cast::<f32>().into(),
            infinity_px: builder.infinity_px(),
            modes: None,
            fields,
            limits,
            sources: SourceMap::new(&frame, &rig.cam2),
        };
        table.modes = DriftModes::new(rig, volume, pattern, &frame, |pixel| table.limits_px(pixel));
        Ok(table)
    }

    /// The segment of a pixel of C1, bit for bit as by [`Self::row`], which is much faster for whole rows.
    #[must_use]
    pub fn segment(&self, pixel: usize) -> Segment {
        let (u, v) = self.column_and_row(pixel);
        let fields = self.fields.row(v);
        let [a, rise, d] = [AT_REFERENCE, RISE, DENOMINATOR].map(|field| fields.at(field, u));
        let [begin_px, end_px] = self.limits_px(pixel);
        Segment {
            row_px: fields.at(ROW, u),
            begin_px,
            end_px,
            reference_px: fields.at(REFERENCE, u),
            phase: [a, rise + a * d, d],
        }
    }

    /// Fills in the segments of row `v` of C1.
    pub fn row(&self, v: usize, row: &mut SegmentRow) {
        self.fill_row(v, None, row);
    }

    /// Fills in the segments of the wanted pixels of row `v` of C1.
    pub(super) fn row_where(&self, v: usize, wanted: &WantedBlocks, row: &mut SegmentRow) {
        self.fill_row(v, Some(wanted.blocks()), row);
    }

    fn fill_row(&self, v: usize, wanted: Option<&[bool]>, row: &mut SegmentRow) {
        let patches = self.size_px[0].div_ceil(PATCH_PX);
        row.resize(patches);
        let (begin, end) = self.limits_of_row(v);
        let per_px = 1.0 / units_per_px(self.epipolar_size_px[0]) as f32;
        fringeflow_simd::run(
            Level::in_use(),
            RowKernel { fields: self.fields.row(v), wanted, begin, end, per_px, row },
        );
    }

    /// Index of the pixel of the epipolar frame nearest to a column and row, pixels: a place of C2.
    #[inline]
    pub(super) fn place(&self, [column_px, row_px]: [f32; 2]) -> u32 {
        let [columns, rows] = self.epipolar_size_px.map(|side| side as u32);
        ((row_px + 0.5) as u32).min(rows - 1) * columns + ((column_px + 0.5) as u32).min(columns - 1)
    }

    /// Ray of a pixel in the frame of C1, scaled to z = 1: x and y.
    #[must_use]
    #[inline]
    pub fn ray(&self, pixel: usize) -> [f32; 2] {
        let (u, v) = self.column_and_row(pixel);
        let fields = self.fields.row(v);
        [fields.at(RAY_X, u), fields.at(RAY_Y, u)]
    }

    /// Rays and epipolar rows of row `v` of C1.
    #[must_use]
    #[inline(always)]
    pub fn rays(&self, v: usize) -> RayRow<'_> {
        RayRow { fields: self.fields.row(v), columns: Columns::new() }
    }

    /// First and last column of the segment of a pixel. The first exceeds the last if there is no segment.
    #[must_use]
    #[inline]
    pub fn limits_px(&self, pixel: usize) -> [f32; 2] {
        let (u, v) = self.column_and_row(pixel);
        let (begin, end) = self.limits_of_row(v);
        let per_px = 1.0 / units_per_px(self.epipolar_size_px[0]) as f32;
        [begin[u], end[u]].map(|units| f32::from(units) * per_px)
    }

    /// Whether a pixel of C1 has a segment.
    #[must_use]
    #[inline]
    pub fn has_segment(&self, pixel: usize) -> bool {
        let [begin_px, end_px] = self.limits_px(pixel);
        begin_px <= end_px
    }

    /// Marks the pixels of row `v` of C1 that have a segment by 1, others by 0.
    pub(super) fn mark_segments(&self, v: usize, has_segment: &mut [u8]) {
        let (begin, end) = self.limits_of_row(v);
        for ((has_segment, begin), end) in has_segment.iter_mut().zip(begin).zip(end) {
            *has_segment = u8::from(begin <= end);
        }
    }

    /// Row of the epipolar frame in which a pixel of C1 has its segment, pixels.
    #[must_use]
    #[inline]
    pub fn row_px(&self, pixel: usize) -> f32 {
        let (u, v) = self.column_and_row(pixel);
        self.fields.row(v).at(ROW, u)
    }

    /// First and last columns of the segments of a row, in steps of [`units_per_px`].
    #[inline]
    fn limits_of_row(&self, v: usize) -> (&[u16], &[u16]) {
        let width = padded(self.size_px[0]);
        self.limits[2 * width * v..2 * width * (v + 1)].split_at(width)
    }

    #[inline]
    fn column_and_row(&self, pixel: usize) -> (usize, usize) {
        (pixel % self.size_px[0], pixel / self.size_px[0])
    }

    /// Width and height of C1's image, pixels.
    #[must_use]
    pub fn size_px(&self) -> [usize; 2] {
        self.size_px
    }

    /// Width and height of the epipolar frame, pixels.
    #[must_use]
    pub fn epipolar_size_px(&self) -> [usize; 2] {
        self.epipolar_size_px
    }

    /// The axis of C1's image closest to the epipolar lines: the one along which the epipolar row changes less.
    #[must_use]
    pub fn epipolar_axis(&self) -> EpipolarAxis {
        let (mut along_rows, mut along_columns) = (0.0_f64, 0.0_f64);
        let change = |a: usize, b: usize| {
            let both = self.has_segment(a) && self.has_segment(b);
            if both { f64::from((self.row_px(a) - self.row_px(b)).abs()) } else { 0.0 }
        };
        let [width, height] = self.size_px;
        // A sample of the pixels is enough.
        for v in (0..height.saturating_sub(1)).step_by(AXIS_STRIDE) {
            for u in (0..width.saturating_sub(1)).step_by(AXIS_STRIDE) {
                let i = v * width + u;
                along_rows += change(i, i + 1);
                along_columns += change(i, i + width);
            }
        }
        if along_rows <= along_columns { EpipolarAxis::Horizontal } else { EpipolarAxis::Vertical }
    }

    /// How near to C2 the point of a pixel of C1 lies, among all pixels whose point C2 sees in the same place: larger
    /// is nearer. It is the cosine of the angle between the ray of the pixel and the base. In the triangle of both
    /// camera centres and the point, this angle shrinks as the point moves towards C2 along its ray.
    #[must_use]
    #[inline]
    pub fn nearness_to_cam2(&self, pixel: usize) -> f32 {
        let ([x, y], [bx, by, bz]) = (self.ray(pixel), self.base);
        (x * bx + y * by + bz) / (x * x + y * y + 1.0).sqrt()
    }

    /// The fields of δ that calibration errors can cause. `None` if the volume is too small to sample them.
    #[must_use]
    pub fn drift_modes(&self) -> Option<&DriftModes> {
        self.modes.as_ref()
    }

    /// The rig that the table was built for.
    #[must_use]
    pub fn fingerprint(&self) -> Fingerprint {
        self.fingerprint
    }
}

/// Rays of C1 along a row of pixels, and the epipolar rows that they are seen in.
#[derive(Clone, Copy)]
pub struct RayRow<'a> {
    fields: FieldRow<'a, FIELDS>,
    columns: Columns,
}

impl RayRow<'_> {
    /// Pixels per patch.
    pub const PIXELS: usize = PATCH_PX;

    /// Rays, x and y at z = 1, and epipolar rows, pixels, of the k-th patch of the row; bit for bit as by
    /// [`SegmentTable::ray`] and [`SegmentTable::row`].
    #[must_use]
    #[inline(always)]
    pub fn patch(&self, k: usize) -> [[f32; PATCH_PX]; 3] {
        let Self { fields, columns } = self;
        [fields.patch(RAY_X, k, columns), fields.patch(RAY_Y, k, columns), fields.patch(ROW, k, columns)]
    }
}

/// Computes a row of segments.
struct RowKernel<'a> {
    fields: FieldRow<'a, FIELDS>,
    /// Which patches are wanted; `None` for all.
    wanted: Option<&'a [bool]>,
    begin: &'a [u16],
    end: &'a [u16],
    /// Pixels per step of the limits.
    per_px: f32,
    row: &'a mut SegmentRow,
}

impl Kernel for RowKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { fields, wanted, begin, end, per_px, row } = self;
        fields.along_row(&mut row.along_row);
        let along_row = (&row.along_row[..], wanted);
        fill(&mut row.row_px, along_row, ROW);
        fill(&mut row.reference_px, along_row, REFERENCE);
        fill(&mut row.a, along_row, AT_REFERENCE);
        fill(&mut row.b, along_row, RISE);
        fill(&mut row.d, along_row, DENOMINATOR);
        for ((b, a), d) in row.b.iter_mut().zip(&row.a).zip(&row.d) {
            *b += a * d;
        }
        for (px, &units) in row.begin_px.iter_mut().zip(begin) {
            *px = f32::from(units) * per_px;
        }
        for (px, &units) in row.end_px.iter_mut().zip(end) {
            *px = f32::from(units) * per_px;
        }
    }
}

/// Evaluates a field along a row.
#[inline(always)]
fn fill(out: &mut [f32], (along_row, wanted): (&[[[f32; POWERS]; FIELDS]], Option<&[bool]>), field: usize) {
    let columns = Columns::new();
    for (i, (out, coefficients)) in out.as_chunks_mut().0.iter_mut().zip(along_row).enumerate() {
        if wanted.is_none_or(|wanted| wanted[i]) {
            *out = columns.values(&coefficients[field]);
        }
    }
}
