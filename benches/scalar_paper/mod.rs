//! The method as the paper states it, in plain scalar code of one thread: what the library is compared with.
//!
//! In: the images, the lookup tables of the rig, mean and sd of δ. Out: a point for each accepted pixel. Steps as in the paper:
//! wrapped phase by one arctangent a pixel (2.1), every column of the epipolar segment looked at (2.3), the back-projection
//! test with 3·sd (2.1), reference correspondences (2.2.1), decisions by Eq. (2) along and then across the epipolar direction
//! (2.2.2), contradictions (2.2.3), triangulation. The paper leaves the numbers of its steps 2.2 open: the library's stand in
//! `resolution`, so that what it makes of bits and vectors has to come to the same decisions.

mod candidates;
mod phase;
mod resolution;

use fringeflow::correspondence::{DeltaGate, DeltaStatistics, EpipolarAxis, SegmentTable};
use fringeflow::geometry::{EpipolarFrame, Pixel, Rig, Vector3};

pub(crate) use candidates::Candidate;
use candidates::Candidates;
use phase::Phases;

/// One turn of phase.
const TURN: i32 = 65536;

/// The lookup tables, made before the measurement (2.3).
pub(crate) struct Tables {
    size_px: [usize; 2],
    /// Per pixel of C1.
    segments: Vec<Segment>,
    /// Per pixel of the epipolar frame of C2: index, and shares of the right and lower neighbours; `None` beyond the image.
    sources: Vec<Option<(usize, [f32; 2])>>,
    epipolar_width: usize,
    /// Axis of the image of C1 that the epipolar lines are closest to.
    axis: EpipolarAxis,
    /// Per pixel of C1 how near to C2 it sees its points.
    nearness: Vec<f32>,
    frame: EpipolarFrame,
}

/// Epipolar segment of a pixel, and the back-projection phase along it.
#[derive(Clone, Copy)]
struct Segment {
    is_none: bool,
    ray: [f32; 2],
    row_px: f32,
    /// First and last column.
    limits_px: [f32; 2],
    /// Of (a + b·s) / (1 + d·s), turns, s the column from the reference.
    phase: [f32; 3],
    reference_px: f32,
}

/// What δ is judged by.
pub(crate) struct Limits {
    /// Mean of δ of true candidates, and how far they are from it at most (3·sd), turns.
    mean: f32,
    threshold: f32,
    /// How far from it a candidate may be that its neighbours decide, turns.
    readmission: f32,
    /// Difference of δ between neighbours of one surface that is tolerated, turns · 65536.
    tolerance: i32,
    /// Change of δ a pixel that is steep, turns · 65536.
    steep: f64,
}

/// What became of the pixels.
pub(crate) struct Accepted {
    /// The chosen candidate of each pixel.
    pub(crate) chosen: Vec<Option<Candidate>>,
    /// Points of the pixels that have one, frame of C1, metres.
    pub(crate) points_m: Vec<[f32; 3]>,
}

impl Limits {
    /// Those that follow from what was measured of δ, for images of a width.
    pub(crate) fn of(delta: &DeltaStatistics, readmission: &DeltaGate, width_px: usize) -> Self {
        let DeltaGate { mean_turns: mean, threshold_turns: threshold } = delta.gate();
        Self {
            mean,
            threshold,
            readmission: readmission.threshold_turns,
            tolerance: (delta.tolerance_turns() * TURN as f32) as i32,
            steep: f64::from(delta.steep_turns(width_px)) * f64::from(TURN),
        }
    }

    /// The back-projection test.
    fn passes(&self, delta: i32) -> bool {
        self.is_within(self.threshold, delta)
    }

    fn is_within(&self, turns: f32, delta: i32) -> bool {
        (delta as f32 / TURN as f32 - self.mean).abs() < turns
    }
}

impl Tables {
    /// Takes the tables over from the library's.
    pub(crate) fn of(rig: &Rig, table: &SegmentTable) -> Self {
        let (frame, size_px) = (EpipolarFrame::new(rig).unwrap(), table.size_px());
        let segment = |pixel: usize| {
            let s = table.segment(pixel);
            Segment {
                is_none: s.is_none(),
                ray: s.ray,
                row_px: s.row_px,
                limits_px: s.limits_px(),
                reference_px: s.reference_px,
                phase: s.phase,
            }
        };
        let [width, height] = [rig.cam2.width_px(), rig.cam2.height_px()];
        let [epipolar_width, epipolar_height] = table.epipolar_size_px();
        let source = |place: usize| {
            let (column, row) = (place % epipolar_width, place / epipolar_width);
            let raw = frame.cam2_pixel(&Pixel::new(column as f64, row as f64))?;
            let inside = raw.x >= 0.0 && raw.y >= 0.0 && raw.x < (width - 1) as f64 && raw.y < (height - 1) as f64;
            let (u, v) = (raw.x.floor(), raw.y.floor());
            inside.then(|| (v as usize * width + u as usize, [(raw.x - u) as f32, (raw.y - v) as f32]))
        };
        Self {
            size_px,
            segments: (0..size_px[0] * size_px[1]).map(segment).collect(),
            sources: (0..epipolar_width * epipolar_height).map(source).collect(),
            epipolar_width,
            axis: table.epipolar_axis(),
            nearness: (0..size_px[0] * size_px[1]).map(|pixel| table.nearness_to_cam2(pixel)).collect(),
            frame,
        }
    }

    /// The whole way from the images of both cameras, one slice of bytes an image.
    pub(crate) fn reconstruct(&self, images: [&[&[u8]]; 2], shifts_rad: &[f64], limits: &Limits) -> Accepted {
        let [cam1, cam2] = images.map(|images| Phases::decode(images, shifts_rad));
        let cam2 = cam2.resampled(self.size_px[0], &self.sources);
        let candidates = Candidates::of(&cam1, &cam2, self, limits);
        let chosen = resolution::resolve(&cam1, &candidates, self, limits);
        let points_m =
            chosen.iter().zip(&self.segments).filter_map(|(c, s)| self.triangulate(s, c.as_ref()?)).collect();
        Accepted { chosen, points_m }
    }

    fn triangulate(&self, segment: &Segment, candidate: &Candidate) -> Option<[f32; 3]> {
        let [x, y] = segment.ray.map(f64::from);
        let ray = Vector3::new(x, y, 1.0);
        let depth_m = self.frame.line(&ray)?.depth_of_column(f64::from(candidate.column_px));
        (depth_m > 0.0 && depth_m.is_finite()).then(|| (ray * depth_m).cast::<f32>().into())
    }
}
