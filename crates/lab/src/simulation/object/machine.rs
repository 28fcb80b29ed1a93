//! A machine part: a toothed flange with a hub, a ring of countersunk bores and a keyway.

use crate::simulation::solid::{PointMm, Solid, cut, cylinder, length, rounded_box, sector, smooth_union, sphere};

/// A flange of 70 mm diameter, 21 mm high.
pub(super) struct Machine;

const TEETH: f64 = 28.0;
const BORES: f64 = 6.0;
const BORE_RING: f64 = 23.0;
/// All cuts for the shaft lie within the first radius, and all gaps between teeth beyond the second. The bores lie
/// within the third radius of their ring. Millimetres.
const SHAFT_REACH: f64 = 8.7;
const GAP_REACH: f64 = 33.9;
const BORE_REACH: f64 = 4.5;

impl Solid for Machine {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let flange = toothed_flange(point);
        let collar = cylinder(point, [0.0, 0.0], 15.5, [0.0, 13.0], 0.8);
        let hub = cylinder(point, [0.0, 0.0], 11.0, [0.0, 21.0], 0.6);
        let body = smooth_union(smooth_union(flange, collar, 2.0), hub, 1.5);
        // Cuts that do not reach the point are skipped.
        let radius = length(point.x, point.y);
        if radius < SHAFT_REACH {
            cut(body, shaft(point))
        } else if (radius - BORE_RING).abs() < BORE_REACH {
            cut(body, bores(point))
        } else {
            body
        }
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-36.0, -36.0, 0.0), PointMm::new(36.0, 36.0, 21.5))
    }
}

/// Disc with a raised rim and gear teeth.
fn toothed_flange(p: &PointMm) -> f64 {
    let disc = cylinder(p, [0.0, 0.0], 35.0, [0.0, 8.0], 0.5);
    let recess = cylinder(p, [0.0, 0.0], 29.5, [6.0, 12.0], 0.3);
    let ring = cut(disc, recess);
    if length(p.x, p.y) < GAP_REACH {
        return ring;
    }
    let gap = cylinder(&sector(p, TEETH), [36.4, 0.0], 2.4, [-2.0, 12.0], 0.0);
    cut(ring, gap)
}

/// Six screw holes with ball-shaped countersinks.
fn bores(p: &PointMm) -> f64 {
    let p = sector(p, BORES);
    let hole = cylinder(&p, [BORE_RING, 0.0], 2.8, [1.0, 12.0], 0.0);
    hole.min(sphere(&p, PointMm::new(BORE_RING, 0.0, 7.5), 4.4))
}

/// Bore for the shaft with its keyway.
fn shaft(p: &PointMm) -> f64 {
    let bore = cylinder(p, [0.0, 0.0], 6.0, [2.0, 30.0], 0.0);
    bore.min(rounded_box(p, PointMm::new(0.0, 6.0, 16.0), PointMm::new(1.8, 2.4, 14.0), 0.0))
}
