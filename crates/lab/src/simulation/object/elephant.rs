//! A toy elephant lying on its side, seen from its left.

use crate::simulation::solid::{PointMm, RoundCone, Solid, ellipsoid, smooth_cut, smooth_union, sphere};

/// An elephant 74 mm long, 22 mm thick.
pub(super) struct Elephant {
    trunk: Vec<RoundCone>,
    tusk: RoundCone,
    legs: [RoundCone; 4],
    tail: RoundCone,
}

/// Positions and radii along the trunk, from head to tip.
const TRUNK: [[f64; 4]; 5] = [
    [-25.0, 8.0, 11.0, 5.4],
    [-31.5, 0.0, 11.0, 4.3],
    [-33.0, -9.0, 11.0, 3.5],
    [-31.0, -16.0, 11.0, 2.9],
    [-26.5, -19.5, 11.0, 2.5],
];
/// Hip or shoulder (x, y, z), foot (x, y, z).
const LEGS: [[f64; 6]; 4] = [
    [-9.0, -5.0, 14.5, -11.5, -26.0, 14.8],
    [-3.0, -5.0, 7.0, -2.0, -26.0, 6.5],
    [19.0, -4.0, 14.5, 18.5, -26.0, 14.8],
    [23.0, -4.0, 7.0, 27.5, -25.5, 6.5],
];

/// Greatest y of the legs, smallest x of the tail, greatest x of trunk and tusk.
const LEGS_TOP: f64 = 2.0;
const TAIL_BEGIN: f64 = 31.5;
const TRUNK_END: f64 = -19.5;
/// Fillets between these parts and the rest.
const LEG_FILLET: f64 = 2.0;
const TAIL_FILLET: f64 = 1.5;
const TRUNK_FILLET: f64 = 1.5;
/// Least slope of the field of a bar.
const BAR_SLOPE: f64 = 0.95;

/// Fillet between head and body. It does not affect the body farther than this from the head.
const NECK_FILLET: f64 = 3.0;

/// Fillet between ear and body.
const EAR_FILLET: f64 = 0.8;

/// Returns a lower bound of the distance to the ear, from a ball around it. Outside the ball, the field of the ear is
/// above the fillet, but far below the distance.
fn ear_lower_bound(p: &PointMm) -> f64 {
    sphere(p, PointMm::new(-11.0, 11.0, 18.8), 14.1)
}

/// Returns a lower bound of the distance field of the head, from a ball around head, trunk and tusk. Fields of
/// ellipsoids rise by at least four fifths of the distance, and fillets subtract at most 2 mm.
fn head_lower_bound(p: &PointMm) -> f64 {
    0.8 * sphere(p, PointMm::new(-24.0, 1.5, 12.0), 27.0) - 2.5
}

impl Elephant {
    pub(super) fn new() -> Self {
        let ball = |[x, y, z, radius]: [f64; 4]| (PointMm::new(x, y, z), radius);
        let leg = |[x, y, z, foot_x, foot_y, foot_z]: [f64; 6]| {
            RoundCone::new(ball([x, y, z, 6.0]), ball([foot_x, foot_y, foot_z, 4.6]))
        };
        Self {
            trunk: TRUNK.windows(2).map(|pair| RoundCone::new(ball(pair[0]), ball(pair[1]))).collect(),
            tusk: RoundCone::new(ball([-24.0, 2.0, 16.0, 1.7]), ball([-33.0, -4.0, 18.0, 0.8])),
            legs: LEGS.map(leg),
            tail: RoundCone::new(ball([33.0, 7.0, 11.0, 1.5]), ball([37.0, -6.0, 11.5, 1.0])),
        }
    }

    fn head(&self, p: &PointMm) -> f64 {
        let skull = ellipsoid(p, PointMm::new(-20.0, 13.5, 11.0), PointMm::new(10.5, 11.5, 9.5));
        let cheek = smooth_union(skull, sphere(p, PointMm::new(-24.0, 7.0, 11.0), 7.0), 3.0);
        let bars_are_near = BAR_SLOPE * (p.x - TRUNK_END) < cheek + TRUNK_FILLET;
        let head = if bars_are_near {
            let head = self.trunk.iter().fold(cheek, |head, bar| smooth_union(head, bar.distance(p), TRUNK_FILLET));
            smooth_union(head, self.tusk.distance(p), 0.6)
        } else {
            cheek
        };
        smooth_union(head, sphere(p, PointMm::new(-25.5, 13.5, 18.6), 1.3), 0.3)
    }
}

impl Solid for Elephant {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let chest = torso(point);
        let body = if head_lower_bound(point) < chest + NECK_FILLET {
            smooth_union(chest, self.head(point), NECK_FILLET)
        } else {
            chest
        };
        // A part that is farther than its fillet does not change the field.
        let body = if BAR_SLOPE * (point.y - LEGS_TOP) < body + LEG_FILLET {
            self.legs.iter().fold(body, |body, leg| smooth_union(body, leg.distance(point), LEG_FILLET))
        } else {
            body
        };
        let body =
            if ear_lower_bound(point) < body + EAR_FILLET { smooth_union(ear(point), body, EAR_FILLET) } else { body };
        let whole = if BAR_SLOPE * (TAIL_BEGIN - point.x) < body + TAIL_FILLET {
            smooth_union(body, self.tail.distance(point), TAIL_FILLET)
        } else {
            body
        };
        whole.max(-point.z)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-39.0, -32.0, 0.0), PointMm::new(40.0, 30.0, 23.0))
    }
}

fn torso(p: &PointMm) -> f64 {
    let chest = ellipsoid(p, PointMm::new(-1.0, 5.0, 10.8), PointMm::new(17.0, 16.0, 10.8));
    let rump = ellipsoid(p, PointMm::new(18.0, 4.5, 10.5), PointMm::new(16.0, 15.0, 10.5));
    smooth_union(chest, rump, 4.0)
}

/// The left ear: a hollowed flap that stands off the head.
fn ear(p: &PointMm) -> f64 {
    let flap = ellipsoid(p, PointMm::new(-11.0, 11.0, 18.8), PointMm::new(8.5, 11.0, 2.9));
    let hollow = ellipsoid(p, PointMm::new(-11.5, 11.0, 23.0), PointMm::new(6.5, 9.0, 2.6));
    smooth_cut(flap, hollow, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fields_of_its_parts_stay_above_their_bounds() {
        let elephant = Elephant::new();
        for i in 0..40_000_u32 {
            let at = |step: f64| 200.0 * (step * f64::from(i)).fract() - 100.0;
            let point = PointMm::new(at(0.819_172_5), at(0.671_043_6), at(0.549_700_5));
            assert!(elephant.head(&point) > head_lower_bound(&point), "{point}");
            let [above, before] = [point.y - LEGS_TOP, TAIL_BEGIN - point.x].map(|away| BAR_SLOPE * away);
            assert!(elephant.legs.iter().all(|leg| above <= 0.0 || leg.distance(&point) >= above), "{point}");
            assert!(before <= 0.0 || elephant.tail.distance(&point) >= before, "{point}");
            let behind = BAR_SLOPE * (point.x - TRUNK_END);
            let mut bars = elephant.trunk.iter().chain([&elephant.tusk]);
            assert!(behind <= 0.0 || bars.all(|bar| bar.distance(&point) >= behind), "{point}");
            // Near the body, where fillets begin, the field of the ear is above them.
            let bound = ear_lower_bound(&point);
            assert!(bound < EAR_FILLET || ear(&point) > EAR_FILLET, "{point}");
        }
    }
}
