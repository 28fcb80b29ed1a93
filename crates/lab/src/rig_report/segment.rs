//! Epipolar segments of a grid of pixels, and the fringe periods on them.

use serde::Serialize;

use fringeflow::geometry::{Camera, Pixel, Point3, Vector3};

use super::RigSetup;
use super::surface::Surface;

/// Number of parts of a segment that are tested for visibility and light.
const PARTS: usize = 48;

/// Minimum ratio of the near to the far depth. It is needed because a volume around the camera has no near end.
const MIN_DEPTH_RATIO: f64 = 1e-3;

/// The part of the ray of a pixel inside the measurement volume.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// Direction with `z = 1`, so that points are `ray · depth`.
    pub(super) ray: Vector3,
    /// Depth of `Q_min`, metres.
    pub(super) near_m: f64,
    /// Depth of `Q_max`, metres.
    pub(super) far_m: f64,
}

impl Segment {
    /// Returns the segment of a pixel of C1, or `None` if its ray misses the volume.
    pub(super) fn new(setup: &RigSetup, pixel: &Pixel) -> Option<Self> {
        let ray = setup.rig.cam1.ray(pixel)?;
        let (near_m, far_m) = setup.volume.clip(&ray)?;
        Some(Self { ray, near_m: near_m.max(MIN_DEPTH_RATIO * far_m), far_m })
    }

    /// Point at a share (0 to 1) of the depth range from near to far.
    pub(super) fn at_share(&self, share: f64) -> Point3 {
        self.at_depth(self.near_m + share * (self.far_m - self.near_m))
    }

    pub(super) fn at_depth(&self, depth_m: f64) -> Point3 {
        Point3::from(self.ray * depth_m)
    }

    /// Points along the segment, from near to far in equal ratios of depth, so that deep volumes are sampled as finely
    /// near the camera as far away.
    fn points(&self) -> impl Iterator<Item = Point3> + '_ {
        let ratio = self.far_m / self.near_m;
        (0..=PARTS).map(move |i| self.at_depth(self.near_m * ratio.powf(i as f64 / PARTS as f64)))
    }
}

/// Fringe periods on one segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct SegmentPeriods {
    /// Number of periods that C2 sees along the segment on the reference plane.
    pub(super) seen: f64,
    /// Number of fringe orders between the phases of its ends in the projector.
    pub(super) spanned: f64,
}

/// Number n of fringe periods on a segment, over the image.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Periods {
    /// Mean number of periods that C2 sees on a segment, the n of Eq. 1.
    pub mean: f64,
    /// Minimum.
    pub min: f64,
    /// Maximum.
    pub max: f64,
    /// Mean number of fringe orders that a segment spans in the projector: |Φ(`q_max`) − Φ(`q_min`)| / 2π.
    pub orders_spanned_mean: f64,
    /// Maximum number of fringe orders spanned.
    pub orders_spanned_max: f64,
}

/// Returns rows of pixels, `step_px` apart.
pub(super) fn grid(camera: &Camera, step_px: usize) -> Vec<Vec<Pixel>> {
    let step_px = step_px.max(1);
    let positions = |extent: usize| (step_px / 2..extent).step_by(step_px);
    let row = |v: usize| positions(camera.width_px()).map(|u| Pixel::new(u as f64, v as f64)).collect();
    positions(camera.height_px()).map(row).collect()
}

/// Returns the periods on a segment if C2 sees `surface`, or `None` if C2 sees no lit part of it.
pub(super) fn periods(setup: &RigSetup, segment: &Segment, surface: &Surface) -> Option<SegmentPeriods> {
    let eye = setup.rig.centre_of_cam2();
    let phase_seen = |point: Point3| {
        let on_surface = setup.cam2_sees(&point).then(|| surface.intersection(&eye, &point))??;
        setup.lit_phase_turns(&on_surface)
    };
    let phases: Vec<Option<f64>> = segment.points().map(phase_seen).collect();
    let steps = phases.windows(2).filter_map(|pair| Some((pair[1]? - pair[0]?).abs()));
    let seen: f64 = steps.sum();
    let in_projector: Vec<f64> = segment.points().filter_map(|point| setup.phase_turns(&point)).collect();
    let spanned = (in_projector.last()? - in_projector.first()?).abs();
    (seen > 0.0).then_some(SegmentPeriods { seen, spanned })
}

/// Summarizes all segments that have periods.
pub(super) fn summary(all: &[SegmentPeriods]) -> Option<Periods> {
    let count = all.len() as f64;
    (!all.is_empty()).then(|| Periods {
        mean: all.iter().map(|p| p.seen).sum::<f64>() / count,
        min: all.iter().map(|p| p.seen).fold(f64::INFINITY, f64::min),
        max: all.iter().map(|p| p.seen).fold(0.0, f64::max),
        orders_spanned_mean: all.iter().map(|p| p.spanned).sum::<f64>() / count,
        orders_spanned_max: all.iter().map(|p| p.spanned).fold(0.0, f64::max),
    })
}
