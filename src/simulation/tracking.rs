//! What a pixel sees, from what it saw a moment before: a fifth of the work of tracing it anew.
//!
//! In: the view of a pose, and the scene moved by less than half a pixel. Out: the new hit, as exact as a traced one,
//! where the pixel and its neighbours lay on one smooth, evenly lit piece of surface. Edges of bodies and shadows move no
//! further than the neighbours, so nothing can have come in between; everywhere else rays are traced as ever.

use crate::geometry::Pixel;

use super::trace::hit_near;
use super::view::{Centre, Eye, Sample, View};

/// Furthest that a place may have moved in the image, pixels.
const MAX_MOTION_PX: f64 = 0.5;
/// Furthest that neighbours may lie off the tangential plane, millimetres.
const MAX_BEND_MM: f64 = 0.05;
/// Least cosine between the normals of neighbours.
const MIN_NORMAL_COSINE: f64 = 0.95;
/// Least cosines between the normal and the ways to camera and light: flatter places may come to hide others.
const MIN_COSINE: f64 = 0.15;

impl Eye<'_> {
    /// What the middle of a pixel sees; `None` where only tracing can tell.
    pub(super) fn centre_after(&self, before: &View, u: usize, v: usize) -> Option<Centre> {
        let seen = smooth_centre(before, u, v)?;
        let old = seen.hit?;
        let pixel = Pixel::new(u as f64, v as f64);
        let moved_px = (self.project(&old.point)? - pixel).norm();
        let ray = (moved_px <= MAX_MOTION_PX).then(|| self.ray(&pixel))??;
        let hit = hit_near(self.scene, &ray, &old)?;
        if -ray.direction.dot(&hit.normal) < MIN_COSINE {
            return None;
        }
        let sample = if seen.sample.reflected > 0.0 { self.lit_sample(&hit)? } else { self.dark_sample(&hit) };
        Some(Centre { hit: Some(hit), sample })
    }

    /// How a place is lit that nothing hides from the projector.
    fn lit_sample(&self, hit: &super::Hit) -> Option<Sample> {
        let way = self.light - hit.point;
        if way.dot(&hit.normal) < MIN_COSINE * way.norm() {
            return None;
        }
        let pixel = self.projector_pixel(hit)?;
        Some(self.sample_at(hit, &pixel))
    }
}

/// What the middle of a pixel saw, if it and its neighbours belong to one smooth, evenly lit piece of surface.
fn smooth_centre(before: &View, u: usize, v: usize) -> Option<Centre> {
    if u == 0 || v == 0 || u + 1 >= before.width || v + 1 >= before.height {
        return None;
    }
    let middle = before.centres[v * before.width + u];
    let hit = middle.hit?;
    let is_lit = |centre: &Centre| centre.sample.reflected > 0.0;
    let belongs = |centre: &Centre| {
        centre.hit.is_some_and(|other| {
            other.surface == hit.surface
                && (other.point - hit.point).dot(&hit.normal).abs() <= MAX_BEND_MM
                && other.normal.dot(&hit.normal) >= MIN_NORMAL_COSINE
        }) && is_lit(centre) == is_lit(&middle)
    };
    let rows = [v - 1, v, v + 1].map(|row| &before.centres[row * before.width + u - 1..][..3]);
    rows.into_iter().flatten().all(belongs).then_some(middle)
}

#[cfg(test)]
mod tests {
    use super::super::sensor::{ImageSeed, Sensor};
    use super::super::virtual_scanner::tests::options;
    use super::super::{Object, RigOptions, SweepOptions, VirtualScanner, VirtualScannerOptions};
    use crate::dataset::CameraId;

    use super::*;

    #[test]
    fn images_are_those_of_rays_traced_anew() {
        for object in [Object::Elephant, Object::Machine, Object::Tooth] {
            let rig = RigOptions { size_px: [320, 256], ..options().rig };
            let options = VirtualScannerOptions { object, rig, sweep: SweepOptions::default(), ..options() };
            let scanner = VirtualScanner::new(options).unwrap();
            let (resting, rig) = (scanner.scene(), &scanner.rig().exact);
            let scene = |pose| resting.clone().at(scanner.cam1_from_object(pose));
            for camera in CameraId::BOTH {
                let mut view = View::trace(rig, &scene(0), camera, 1).unwrap();
                for pose in 1..6 {
                    view = View::trace_after(&view, rig, &scene(pose), camera, 1).unwrap();
                }
                let anew = View::trace(rig, &scene(5), camera, 1).unwrap();
                let image = |view: &View| {
                    let seed = ImageSeed { seed: 1, camera: 0, image: 0 };
                    Sensor::exposed(None, 1.0).image(view, &scanner.projected(1), seed)
                };
                let (image, expected) = (image(&view), image(&anew));
                let off = image.pixels.iter().zip(&expected.pixels).filter(|(a, b)| a.abs_diff(**b) > 1).count();
                assert!(off <= 2, "{object:?}, {camera:?}: {off} of {} pixels differ", image.pixels.len());
            }
        }
    }
}
