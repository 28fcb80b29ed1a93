//! Tracks the hits of pixels from the previous pose. This takes a fifth of the work of tracing them again.
//!
//! In: the view of a pose, and the scene after a small motion. Out: the new hit, as exact as a traced one. It exists if
//! the point that moved to the pixel belongs, together with its neighbours, to a smooth and evenly lit piece of
//! surface. Edges of solids and shadows move with that surface to within a pixel, so nothing can have come in between.
//! All other rays are traced as usual.

use fringeflow::geometry::Pixel;

use super::trace::hit_near;
use super::view::{Centre, Eye, Sample, View};

/// Largest distance of a point from the centre of the pixel that it moved to, pixels: half the diagonal of a pixel.
const MAX_OFF_PX: f64 = 0.72;
/// Radius of the neighbourhood in which a surface must be smooth: if the point stayed in its pixel, and if it came from
/// another pixel. Edges of nearer or farther surfaces move differently.
const NEAR_PX: usize = 1;
const FAR_PX: usize = 2;
/// Maximum number of steps of the search for the point that moved to a pixel.
const MAX_STEPS: usize = 3;
/// Largest distance of neighbours from the tangential plane, millimetres.
const MAX_BEND_MM: f64 = 0.05;
/// Minimum cosine between the normals of neighbours.
const MIN_NORMAL_COSINE: f64 = 0.95;
/// Minimum cosines between the normal and the directions to camera and light. At flatter angles, other surfaces may
/// hide the point.
const MIN_COSINE: f64 = 0.15;

impl Eye<'_> {
    /// Returns what the centre of a pixel sees, or `None` if it must be traced.
    pub(super) fn centre_after(&self, previous: &View, u: usize, v: usize) -> Option<Centre> {
        let pixel = Pixel::new(u as f64, v as f64);
        let [from_u, from_v] = self.pixel_before(previous, &pixel)?;
        let has_moved = [from_u, from_v] != [u, v];
        let reach_px = if has_moved { FAR_PX } else { NEAR_PX };
        let seen = smooth_centre(previous, [from_u, from_v], reach_px)?;
        let ray = self.ray(&pixel)?;
        let hit = hit_near(self.scene, &ray, &seen.hit?)?;
        if -ray.direction.dot(&hit.normal) < MIN_COSINE {
            return None;
        }
        let sample = if seen.sample.reflected > 0.0 {
            self.lit_sample(&hit)?
        } else if has_moved && self.projector_pixel(&hit).is_some() {
            // The border of the projected image does not move with the surface.
            return None;
        } else {
            self.dark_sample(&hit)
        };
        Some(Centre { hit: Some(hit), sample })
    }

    /// Returns the pixel that previously saw the point that has moved to this pixel.
    fn pixel_before(&self, previous: &View, pixel: &Pixel) -> Option<[usize; 2]> {
        let mut source = *pixel;
        for _ in 0..MAX_STEPS {
            let inside = |x: f64, length: usize| (x >= 0.0 && x < length as f64).then_some(x as usize);
            let (u, v) = (inside(source.x, previous.width)?, inside(source.y, previous.height)?);
            let off = self.project(&previous.centres[v * previous.width + u].hit?.point)? - pixel;
            if off.norm() <= MAX_OFF_PX {
                return Some([u, v]);
            }
            source -= off.map(f64::round);
        }
        None
    }

    /// Returns the light at a point that nothing hides from the projector; `None` at flat angles or outside the
    /// projected image.
    fn lit_sample(&self, hit: &super::Hit) -> Option<Sample> {
        let to_light = self.light - hit.point;
        if to_light.dot(&hit.normal) < MIN_COSINE * to_light.norm() {
            return None;
        }
        let pixel = self.projector_pixel(hit)?;
        Some(self.sample_at(hit, &pixel))
    }
}

/// Returns what the centre of a pixel saw, if it and its neighbours belong to one smooth, evenly lit piece of surface.
fn smooth_centre(previous: &View, [u, v]: [usize; 2], reach_px: usize) -> Option<Centre> {
    if u < reach_px || v < reach_px || u + reach_px >= previous.width || v + reach_px >= previous.height {
        return None;
    }
    let middle = previous.centres[v * previous.width + u];
    let hit = middle.hit?;
    let is_lit = |centre: &Centre| centre.sample.reflected > 0.0;
    let belongs = |centre: &Centre| {
        centre.hit.is_some_and(|other| {
            other.surface == hit.surface
                && (other.point - hit.point).dot(&hit.normal).abs() <= MAX_BEND_MM
                && other.normal.dot(&hit.normal) >= MIN_NORMAL_COSINE
        }) && is_lit(centre) == is_lit(&middle)
    };
    let side = 2 * reach_px + 1;
    let mut rows =
        (v - reach_px..=v + reach_px).map(|row| &previous.centres[row * previous.width + u - reach_px..][..side]);
    rows.all(|row| row.iter().all(belongs)).then_some(middle)
}

#[cfg(test)]
mod tests {
    use crate::simulation::sensor::{ImageSeed, Sensor};
    use crate::simulation::virtual_scanner::tests::options;
    use crate::simulation::{Object, RigOptions, SweepOptions, VirtualScanner, VirtualScannerOptions};
    use fringeflow_dataset::CameraId;

    use super::*;

    #[test]
    fn tracked_images_equal_traced_ones() {
        let gentle = SweepOptions::default();
        // Four pixels per image.
        let fast = SweepOptions {
            poses: 64,
            travel_mm: [9.0, 8.0, 1.0],
            turn_deg: [3.0, 4.0, 5.0],
            outside_mm: 100.0,
            ..gentle
        };
        let objects = [Object::Elephant, Object::Machine, Object::Tooth];
        let gentle = objects.map(|object| (object, gentle));
        let fast = [Object::Elephant, Object::Machine, Object::Clutter, Object::Tray].map(|object| (object, fast));
        for (object, sweep) in gentle.into_iter().chain(fast) {
            let rig = RigOptions { size_px: [320, 256], ..options().rig };
            let options = VirtualScannerOptions { object, rig, sweep, ..options() };
            let scanner = VirtualScanner::new(options).unwrap();
            let (resting, rig) = (scanner.scene(), &scanner.rig().exact);
            let scene = |pose| resting.clone().at(scanner.cam1_from_object(pose));
            for camera in CameraId::BOTH {
                let mut view = View::trace(rig, &scene(0), camera, 1).unwrap();
                for pose in 1..6 {
                    view = View::trace_after(&view, rig, &scene(pose), camera, 1).unwrap();
                }
                let traced = View::trace(rig, &scene(5), camera, 1).unwrap();
                let image = |view: &View| {
                    let seed = ImageSeed { seed: 1, camera: 0, image: 0 };
                    Sensor::exposed(None, 1.0).image(view, &scanner.projected(1), seed)
                };
                let (image, expected) = (image(&view), image(&traced));
                let off = image.pixels.iter().zip(&expected.pixels).filter(|(a, b)| a.abs_diff(**b) > 1).count();
                assert!(off <= 2, "{object:?}, {camera:?}: {off} of {} pixels differ", image.pixels.len());
            }
        }
    }
}
