//! Computes a segment table: the smooth fields at their nodes, and both ends of every segment.

use nalgebra::Matrix3;
use rayon::prelude::*;

use crate::geometry::{EpipolarFrame, FringePattern, MeasurementVolume, Pixel, Point3, Rig, Vector3};

use super::patches::{Nodes, Patches};
use super::segment_fields::{FIELDS, NO_LIMITS, RAY_X, RAY_Y, ROW, SegmentTableError, padded, units_per_px};

/// Share of a segment by which either end is extended: the position of the volume is known no better than the
/// calibration.
const VOLUME_MARGIN: f64 = 0.02;
/// Rise of Φ over the volume, turns, at which half of the bend by distortion is neglected. Where a ray runs along a
/// fringe, Φ hardly rises and does not determine its denominator.
const LEAST_RISE_TURNS: f64 = 0.05;
/// Nearest depth of a volume that reaches the camera, as share of its farthest one.
const MIN_DEPTH_SHARE: f64 = 0.05;
/// Greatest half extent of a volume in inverse depth, relative to its middle: the segment ends before infinity.
const MAX_HALF_EXTENT: f64 = 0.9;
/// Least inverse depth of the middle surface, relative to its mean: it must not reach infinity.
const MIN_INVERSE_DEPTH: f64 = 0.1;

/// Distance of the pixels of C1, along both axes, to which the columns at infinity are fitted.
const STRIDE: usize = 16;

/// Computes the parts of a table for one rig.
pub(super) struct Builder<'a> {
    pub(super) rig: &'a Rig,
    pub(super) volume: &'a MeasurementVolume,
    pub(super) pattern: &'a FringePattern,
    pub(super) frame: &'a EpipolarFrame,
}

impl Builder<'_> {
    /// The fields of the pixels of C1.
    pub(super) fn fields(&self) -> Patches<FIELDS> {
        let nodes = Nodes::from_size_px(self.size_px());
        let rays = nodes.map(|u, v| self.rig.cam1.ray(&Pixel::new(u, v)));
        let middle = MiddleSurface::new(self.volume, &rays);
        let values: Vec<_> = rays.par_iter().map(|ray| self.fields_of(ray.as_ref()?, &middle)).collect();
        let mut undefined = [0.0; FIELDS];
        undefined[ROW] = -1.0;
        Patches::through(nodes, &values, undefined)
    }

    fn size_px(&self) -> [usize; 2] {
        [self.rig.cam1.width_px(), self.rig.cam1.height_px()]
    }

    /// The fields of one ray. `None` if it has no epipolar line, or P does not light the volume along it.
    fn fields_of(&self, ray: &Vector3, middle: &MiddleSurface) -> Option<[f64; FIELDS]> {
        let line = self.frame.line(ray)?;
        let inverse_depth = middle.inverse_depth(ray);
        let half_px = line.column_per_inverse_depth * inverse_depth * middle.half_extent;
        let phase = |place: f64| {
            let depth_m = 1.0 / (inverse_depth * (1.0 + middle.half_extent * place));
            self.back_projected_turns(ray, depth_m)
        };
        let [before, at, after] = [phase(-1.0)?, phase(0.0)?, phase(1.0)?];
        let rise = after - before;
        // Without distortion d is known from the geometry: Φ is as far from its pole as the centre of the projector is
        // away.
        let of_pinhole = middle.half_extent * self.share_of_projector_depth(ray, inverse_depth);
        // Distortion bends Φ beyond the pinhole model; the denominator absorbs as much as the rise of Φ can tell.
        let bend = 2.0 * at - before - after - of_pinhole * rise;
        let d = of_pinhole + bend * rise / (rise * rise + LEAST_RISE_TURNS * LEAST_RISE_TURNS);
        // The curve goes through all three points.
        let slope = 0.5 * rise + d * (0.5 * (after + before) - at);
        let reference_px = line.column_of_depth(1.0 / inverse_depth);
        Some([ray.x, ray.y, line.row_px, reference_px, at, slope / half_px, d / half_px])
    }

    /// Relative change of the depth seen by P per relative change of inverse depth. Φ of a pinhole projector is a
    /// quotient of two linear functions of inverse depth, and this is the slope of the denominator.
    fn share_of_projector_depth(&self, ray: &Vector3, inverse_depth: f64) -> f64 {
        let pose = &self.rig.projector_from_cam1;
        let moved = pose.translation.vector.z * inverse_depth;
        moved / ((pose.rotation * ray).z + moved)
    }

    /// Absolute phase at which P lights the point of a ray at a depth, turns.
    fn back_projected_turns(&self, ray: &Vector3, depth_m: f64) -> Option<f64> {
        let column = self.rig.project_projector(&Point3::from(ray * depth_m))?.x;
        Some(self.pattern.phase_turns(column))
    }

    /// First and last columns of the segments of all pixels, row by row: first all first columns, then all last ones.
    pub(super) fn limits(&self, fields: &Patches<FIELDS>) -> Vec<u16> {
        let [width, height] = self.size_px();
        let clip = self.volume.ray_clipper();
        let last_row = (self.frame.height_px() - 1) as f32;
        let last_px = (self.frame.width_px() - 1) as f64;
        let units = f64::from(units_per_px(self.frame.width_px()));
        let ends = |x: f32, y: f32, row_px: f32| -> Option<[u16; 2]> {
            let ray = Vector3::new(f64::from(x), f64::from(y), 1.0);
            let (near_m, far_m) = clip.clip(&ray)?;
            if !(0.0..=last_row).contains(&row_px) {
                return None;
            }
            let line = self.frame.line(&ray)?;
            let (a, b) = (line.column_of_depth(near_m), line.column_of_depth(far_m));
            // The margin must not reach beyond infinity.
            let margin = (VOLUME_MARGIN * (a - b).abs()).min(0.5 * (b - line.column_at_infinity_px).abs());
            let begin = (a.min(b) - margin).max(0.0);
            let end = (a.max(b) + margin).min(last_px);
            (begin < end).then(|| [(begin * units).floor() as u16, (end * units).ceil() as u16])
        };
        let stride = padded(width);
        let mut limits = vec![0; 2 * stride * height];
        limits.par_chunks_mut(2 * stride).enumerate().for_each(|(v, row)| {
            let fields = fields.row(v);
            let (begin, end) = row.split_at_mut(stride);
            for u in 0..stride {
                let [x, y, row_px] = [RAY_X, RAY_Y, ROW].map(|field| fields.at(field, u));
                [begin[u], end[u]] = if u < width { ends(x, y, row_px).unwrap_or(NO_LIMITS) } else { NO_LIMITS };
            }
        });
        limits
    }

    /// Least-squares plane through the columns in which C1 sees infinitely far points.
    pub(super) fn infinity_px(&self) -> [f32; 3] {
        let [width, height] = self.size_px();
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (u, v) in (0..height).step_by(STRIDE).flat_map(|v| (0..width).step_by(STRIDE).map(move |u| (u, v))) {
            let ray = self.rig.cam1.ray(&Pixel::new(u as f64, v as f64));
            if let Some(line) = ray.and_then(|ray| self.frame.line(&ray)) {
                let row = Vector3::new(1.0, u as f64, v as f64);
                normal += row * row.transpose();
                right += row * line.column_at_infinity_px;
            }
        }
        normal += Matrix3::identity() * 1e-9;
        normal.cholesky().map_or([0.0; 3], |normal| normal.solve(&right).cast::<f32>().into())
    }

    /// Returns the reason why no pixel has a segment.
    pub(super) fn why_empty(&self) -> SegmentTableError {
        let [width, height] = self.size_px();
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

/// The middle of the measurement volume as C1 sees it, as a plane: smooth where the volume itself has edges.
struct MiddleSurface {
    /// Inverse depth of a ray with z = 1 is the product of both, 1/m.
    plane: Vector3,
    mean_inverse_depth: f64,
    /// How far the volume reaches before and behind the plane, as share of its inverse depth.
    half_extent: f64,
}

impl MiddleSurface {
    /// Fits the plane to the rays that meet the volume, weighted by their length in it. If none does, the plane lies at
    /// the depth of the centre.
    fn new(volume: &MeasurementVolume, rays: &[Option<Vector3>]) -> Self {
        let clip = volume.ray_clipper();
        let inverse_depths = |ray: &Vector3| {
            let (near_m, far_m) = clip.clip(ray)?;
            Some((1.0 / near_m.max(MIN_DEPTH_SHARE * far_m), 1.0 / far_m))
        };
        let met: Vec<(Vector3, f64, f64)> =
            rays.iter().flatten().filter_map(|ray| inverse_depths(ray).map(|(near, far)| (*ray, near, far))).collect();
        let (mut normal, mut right, mut weights) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
        for (ray, near, far) in &met {
            let weight = near - far;
            normal += ray * ray.transpose() * weight;
            right += ray * (0.5 * (near + far) * weight);
            weights += weight;
        }
        let centre = volume.cam1_from_volume() * nalgebra::center(volume.min(), volume.max());
        let of_centre = 1.0 / centre.z.max(f64::MIN_POSITIVE);
        // A volume seen in a single line of pixels leaves the plane undetermined; it stays level there.
        let level = Vector3::z() * (right.z / weights);
        let turned = (normal + Matrix3::identity() * (1e-9 * weights)).cholesky();
        let plane = match turned {
            Some(turned) if weights > 0.0 => level + turned.solve(&(right - normal * level)),
            _ => Vector3::z() * of_centre,
        };
        let mean_inverse_depth = if weights > 0.0 { right.z / weights } else { of_centre };
        let mut surface = Self { plane, mean_inverse_depth, half_extent: 0.0 };
        let extent = |(ray, near, far): &(Vector3, f64, f64)| {
            let middle = surface.inverse_depth(ray);
            (near / middle - 1.0).max(1.0 - far / middle)
        };
        surface.half_extent = met.iter().map(extent).fold(1e-3, f64::max).min(MAX_HALF_EXTENT);
        surface
    }

    fn inverse_depth(&self, ray: &Vector3) -> f64 {
        self.plane.dot(ray).max(MIN_INVERSE_DEPTH * self.mean_inverse_depth)
    }
}
