//! Computes the exact truth of a rendered scene at another moment. Its object has moved rigidly, as the dataset
//! describes.
//!
//! In: the truth, the setup with the motion, and the moment. Out: the truth at that moment, per pixel of C1.
//!
//! Each point is moved in space. Its points in both images move by the displacement that the calibrated cameras
//! predict: the calibration error shifts the image points, but hardly changes their differences. A pixel takes the
//! nearest of the points that land around its centre (only points of the front surface, if one surface hides another).
//! It follows that surface linearly for the remaining distance, at most half a pixel along each axis. So the truth for
//! the original moment stays the same to the bit.
//!
//! Whether the projector lights a point and C2 sees it is not recomputed: shadows and occlusions shift by only about a
//! pixel when the object rotates by a degree. Surfaces that come into view are unknown.

use nalgebra::{Matrix2, Vector2};

use fringeflow::geometry::{MeasurementVolume, Pixel, Point3, Pose, Vector3};
use fringeflow_dataset::{Motion, RenderedTruth, Setup};

use super::frames::Frames;
use super::pixel_grid::{pixel, point};

/// A truth, and the pixels for which it is complete.
pub(super) struct MovedTruth {
    pub(super) truth: RenderedTruth,
    /// Whether the visible surface of each pixel is known, including pixels that see nothing.
    pub(super) known: Vec<bool>,
}

/// A pixel takes points up to this distance from its centre, pixels. In a grid of pixels, there is always a point
/// within 0.71.
const REACH_PX: f64 = 0.75;
/// A point this far behind another point of the same pixel, in metres, is hidden and belongs to another surface.
const LAYER_M: f64 = 2e-3;
/// A stored point belongs to its pixel if it projects within this distance, pixels. Calibration errors are smaller.
const MAX_OFF_PX: f64 = 5.0;

/// Returns the truth of a scene that moves as in `motion`, at its phase image `image` (fractional between two images).
///
/// Returns `None` if the setup has no volume, whose frame the motion refers to, or if the motion has no poses.
pub(super) fn truth_at(truth: &RenderedTruth, setup: &Setup, motion: &Motion, image: f64) -> Option<MovedTruth> {
    let volume = setup.volume.as_ref()?;
    let frames = Frames::from_setup(setup);
    let scene = Scene { truth, setup, frames, motion: motion.pose_at(image)? };
    let moved: Vec<Option<MovedPoint>> = (0..truth.cam2_px.len()).map(|i| scene.moved(i)).collect();
    let surface = Surface { moved: &moved, width: setup.image_size_px[0] };
    let exact_volume = MeasurementVolume::new(frames.exact_cam1_from_volume, *volume.min(), *volume.max()).ok()?;
    let mut moved_truth =
        MovedTruth { truth: empty_truth(truth), known: truth.cam2_px.iter().map(|q| q[0].is_nan()).collect() };
    for (target, source) in surface.nearest().into_iter().enumerate() {
        let Some(source) = source else { continue };
        let Some(point) = surface.point_at(source, target) else { continue };
        moved_truth.known[target] = true;
        scene.write_pixel(&mut moved_truth.truth, target, source, &point, &exact_volume);
    }
    Some(moved_truth)
}

/// Returns a truth of the same size without points.
fn empty_truth(truth: &RenderedTruth) -> RenderedTruth {
    let count = truth.cam2_px.len();
    let nothing = vec![false; count];
    RenderedTruth {
        cam2_px: vec![[f32::NAN; 2]; count],
        point: vec![[0.0; 3]; count],
        seen_by_cam2: nothing.clone(),
        lit: nothing.clone(),
        in_volume: nothing.clone(),
        measurable: nothing.clone(),
        reference: nothing,
        gray_cam2_px: truth.gray_cam2_px.as_ref().map(|_| vec![[f32::NAN; 2]; count]),
    }
}

/// A point of the truth after the motion.
#[derive(Clone, Copy, Debug)]
struct MovedPoint {
    cam1_px: Pixel,
    cam2_px: Pixel,
    /// In the frame of the exact C1, metres.
    point: Point3,
}

struct Scene<'a> {
    truth: &'a RenderedTruth,
    setup: &'a Setup,
    frames: Frames,
    /// Pose of the object relative to that in the truth, in the frame of the volume.
    motion: Pose,
}

impl Scene<'_> {
    /// Returns the point of a pixel after the motion, or `None` if the pixel has none.
    fn moved(&self, i: usize) -> Option<MovedPoint> {
        let width = self.setup.image_size_px[0];
        let (centre, cam2_px) = (Pixel::new((i % width) as f64, (i / width) as f64), pixel(self.truth.cam2_px[i]));
        if !cam2_px.x.is_finite() {
            return None;
        }
        let exact = self.frames.exact_cam1_from_volume;
        let before = exact.inverse() * point(self.truth.point[i], self.frames.unit_m);
        let after = self.motion * before;
        let [seen_before, seen_after] = [before, after].map(|point| self.frames.cam1_from_volume * point);
        let rig = &self.setup.rig;
        let in_cam1 = rig.cam1.project(&seen_before).filter(|seen| (seen - centre).norm() <= MAX_OFF_PX)?;
        // Use only differences of two projections, in which the calibration error cancels.
        let cam1_px = centre + (rig.cam1.project(&seen_after)? - in_cam1);
        let cam2_px = cam2_px + (rig.project_cam2(&seen_after)? - rig.project_cam2(&seen_before)?);
        Some(MovedPoint { cam1_px, cam2_px, point: exact * after })
    }

    /// Writes the truth of pixel `target`, which sees `point` on the surface that pixel `source` saw.
    fn write_pixel(
        &self,
        to: &mut RenderedTruth,
        target: usize,
        source: usize,
        point: &MovedPoint,
        volume: &MeasurementVolume,
    ) {
        let from = self.truth;
        to.cam2_px[target] = point.cam2_px.coords.map(|c| c as f32).into();
        to.point[target] = (point.point.coords / self.frames.unit_m).map(|c| c as f32).into();
        to.seen_by_cam2[target] = from.seen_by_cam2[source] && self.setup.rig.cam2.sees(&point.cam2_px);
        to.lit[target] = from.lit[source];
        to.in_volume[target] = volume.contains(&point.point);
        to.measurable[target] = to.seen_by_cam2[target] && to.lit[target] && to.in_volume[target];
        to.reference[target] = from.reference[source] && to.measurable[target];
        if let (Some(to_gray), Some(gray)) = (&mut to.gray_cam2_px, &from.gray_cam2_px) {
            let displacement = point.cam2_px - pixel(from.cam2_px[source]);
            to_gray[target] = (pixel(gray[source]) + displacement).coords.map(|c| c as f32).into();
        }
    }
}

/// The moved points, indexed by their original pixels.
struct Surface<'a> {
    moved: &'a [Option<MovedPoint>],
    width: usize,
}

/// Change from one pixel to the next, along an axis of the image of C1 before the motion.
struct Slope {
    cam1_px: Vector2<f64>,
    cam2_px: Vector2<f64>,
    point: Vector3,
}

impl Surface<'_> {
    /// Returns, for each pixel, the original pixel of the point that it now sees.
    fn nearest(&self) -> Vec<Option<usize>> {
        // First find the depth of the front surface at each pixel, then the nearest point of that surface.
        let mut front_m = vec![f64::INFINITY; self.moved.len()];
        self.for_each_in_reach(|target, _, moved, _| front_m[target] = moved.point.z.min(front_m[target]));
        let mut nearest = vec![(f64::INFINITY, None); self.moved.len()];
        self.for_each_in_reach(|target, source, moved, distance_px| {
            if moved.point.z <= front_m[target] + LAYER_M && distance_px < nearest[target].0 {
                nearest[target] = (distance_px, Some(source));
            }
        });
        nearest.into_iter().map(|(_, source)| source).collect()
    }

    /// Calls `call` for each point and each pixel in its reach, with the pixel, the original pixel, the point, and the
    /// distance in pixels.
    fn for_each_in_reach(&self, mut call: impl FnMut(usize, usize, &MovedPoint, f64)) {
        let height = self.moved.len() / self.width.max(1);
        for (source, moved) in self.moved.iter().enumerate() {
            let Some(moved) = moved else { continue };
            let [left, top] = [moved.cam1_px.x, moved.cam1_px.y].map(f64::floor);
            for (du, dv) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                let centre = Pixel::new(left + du, top + dv);
                let distance_px = (centre - moved.cam1_px).norm();
                let is_inside =
                    centre.x >= 0.0 && centre.y >= 0.0 && centre.x < self.width as f64 && centre.y < height as f64;
                if is_inside && distance_px <= REACH_PX {
                    call(centre.y as usize * self.width + centre.x as usize, source, moved, distance_px);
                }
            }
        }
    }

    /// Returns the point that pixel `target` now sees on the surface that pixel `source` saw.
    fn point_at(&self, source: usize, target: usize) -> Option<MovedPoint> {
        let own = (*self.moved.get(source)?)?;
        let (column, row, height) = (source % self.width, source / self.width, self.moved.len() / self.width);
        let along_u = self.slope(&own, source, 1, [column > 0, column + 1 < self.width], Vector2::x());
        let along_v = self.slope(&own, source, self.width, [row > 0, row + 1 < height], Vector2::y());
        let centre = Pixel::new((target % self.width) as f64, (target / self.width) as f64);
        let steps = Matrix2::from_columns(&[along_u.cam1_px, along_v.cam1_px]).try_inverse()? * (centre - own.cam1_px);
        Some(MovedPoint {
            cam1_px: centre,
            cam2_px: own.cam2_px + along_u.cam2_px * steps.x + along_v.cam2_px * steps.y,
            point: own.point + along_u.point * steps.x + along_v.point * steps.y,
        })
    }

    /// Returns the slope at a pixel, from the neighbours at `−step` and `+step` on the same surface. Without such
    /// neighbours, both images are assumed to move equally.
    fn slope(&self, own: &MovedPoint, source: usize, step: usize, inside: [bool; 2], axis: Vector2<f64>) -> Slope {
        let neighbour = |is_inside: bool, i: usize| {
            let other = is_inside.then(|| self.moved.get(i).copied().flatten()).flatten();
            other.filter(|other| (other.point.z - own.point.z).abs() <= LAYER_M)
        };
        let (before, after) = (neighbour(inside[0], source.wrapping_sub(step)), neighbour(inside[1], source + step));
        let pixels = f64::from(u8::from(before.is_some()) + u8::from(after.is_some()));
        if pixels == 0.0 {
            return Slope { cam1_px: axis, cam2_px: axis, point: Vector3::zeros() };
        }
        let (before, after) = (before.unwrap_or(*own), after.unwrap_or(*own));
        Slope {
            cam1_px: (after.cam1_px - before.cam1_px) / pixels,
            cam2_px: (after.cam2_px - before.cam2_px) / pixels,
            point: (after.point - before.point) / pixels,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::{
        Board, MotionOptions, NoiseLevel, Object, RigOptions, Scene, Simulation, SimulationOptions, Staging, View,
        truth,
    };
    use fringeflow::calibration::Unit;
    use fringeflow_dataset::{CameraId, Dataset};

    const SIZE_PX: [usize; 2] = [320, 256];

    /// Returns the truth of a moving object, its setup, and the exact truth at the pose of an image.
    fn moving(object: Object, image: usize) -> (RenderedTruth, Setup, RenderedTruth) {
        let usual = SimulationOptions::usual(object);
        let options = SimulationOptions {
            board: Board::Visible,
            rig: RigOptions { size_px: SIZE_PX, seed: 3, ..usual.rig },
            steps: 4,
            gray: false,
            noise: NoiseLevel::None,
            supersampling: 1,
            seed: 3,
            ..usual
        };
        let motion =
            MotionOptions { mm_per_image: 0.2, deg_per_image: 0.04, cycles: 4, blur: 0.0, tremor: 0.0, seed: 1 };
        let simulation = Simulation::staged(options, Staging { motion: Some(motion), ..Staging::default() }).unwrap();
        let folder = tempfile::tempdir().unwrap();
        simulation.write(&folder.path().join("set"), || ()).unwrap();
        let setup = Dataset::open(&folder.path().join("set"), None).unwrap().setup;
        let rig = simulation.rig();
        let scene = Scene::from_object(object, Board::Visible, &rig.exact_volume);
        let cam1_from_volume = rig.exact_volume.cam1_from_volume();
        let motion = simulation.motion().unwrap().poses[image];
        let pose = cam1_from_volume * motion * cam1_from_volume.inverse() * scene.cam1_from_object();
        let scene = scene.at(pose);
        let view = View::trace(&rig.exact, &scene, CameraId::Cam1, 1).unwrap();
        let exact = truth(&rig.exact, &rig.exact_volume, &scene, &view, Unit::Millimetre);
        (simulation.truth().clone(), setup, exact)
    }

    #[test]
    fn it_equals_the_traced_truth_of_the_moved_object() {
        for object in [Object::Nose, Object::Machine] {
            let image = 1;
            let (before, setup, exact) = moving(object, image);
            let found = truth_at(&before, &setup, setup.motion.as_ref().unwrap(), image as f64).unwrap();
            let (mut compared, mut off_px, mut off_mm, mut apart) = (0, 0, 0, 0);
            for i in 0..exact.reference.len() {
                apart += usize::from(exact.reference[i] != found.truth.reference[i]);
                if !(exact.reference[i] && found.truth.reference[i]) {
                    continue;
                }
                compared += 1;
                let [here, there] = [&found.truth, &exact].map(|truth| (pixel(truth.cam2_px[i]), truth.point[i]));
                off_px += usize::from((here.0 - there.0).norm() > 0.05);
                off_mm += usize::from((point(here.1, 1.0) - point(there.1, 1.0)).norm() > 0.03);
            }
            assert!(compared > 20_000, "{object:?}: {compared} compared");
            assert!(apart * 25 < compared, "{object:?}: {apart} of {compared} are reference in one truth only");
            assert!(off_px * 25 < compared, "{object:?}: {off_px} of {compared} are off in C2");
            assert!(off_mm * 25 < compared, "{object:?}: {off_mm} of {compared} are off in space");
        }
    }

    #[test]
    fn at_the_original_moment_the_truth_stays_the_same() {
        let (before, setup, _) = moving(Object::Tooth, 0);
        let motion = setup.motion.as_ref().unwrap();
        let found = truth_at(&before, &setup, motion, motion.reference).unwrap();
        let same = |i: &usize| {
            let [a, b] = [&before, &found.truth].map(|t| (t.reference[*i], t.lit[*i], t.seen_by_cam2[*i]));
            let off = (pixel(before.cam2_px[*i]) - pixel(found.truth.cam2_px[*i])).norm();
            a == b && (off < 1e-3 || off.is_nan())
        };
        assert_eq!((0..before.reference.len()).filter(|i| !same(i)).count(), 0);
    }
}
