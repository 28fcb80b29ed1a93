//! A set of teeth: a plaster arch with fourteen teeth, incisors to molars.

use crate::simulation::solid::{PointMm, RoundCone, Solid, rounded_box, smooth_cut, smooth_union, sphere};

/// An arch of 66 mm × 54 mm, 22 mm high.
pub(super) struct Teeth {
    /// Bars of the alveolar ridge that holds the teeth.
    ridge: Vec<RoundCone>,
    teeth: Vec<Tooth>,
}

/// A tooth in its place.
struct Tooth {
    centre: PointMm,
    /// Sine and cosine of the direction along the arch.
    along: [f64; 2],
    /// Half width along the arch, half depth across.
    half: [f64; 2],
    cusps: &'static [[f64; 2]],
    /// Groove along the arch, between the inner and the outer cusps.
    fissure: RoundCone,
}

/// Half width along the arch, half depth across, and height of the crown, from second molar to central incisor,
/// millimetres.
const SIZES: [[f64; 3]; 7] = [
    [4.6, 4.7, 17.0],
    [4.8, 4.8, 17.6],
    [3.5, 4.2, 18.4],
    [3.5, 4.2, 18.8],
    [3.6, 3.6, 20.4],
    [3.3, 2.8, 19.8],
    [4.2, 3.0, 20.6],
];
/// Cusps of molars, premolars, canines and incisors as shares of half width and half depth.
const MOLAR: &[[f64; 2]] = &[[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]];
const PREMOLAR: &[[f64; 2]] = &[[0.0, -0.5], [0.0, 0.5]];
const CANINE: &[[f64; 2]] = &[[0.0, 0.0]];
const INCISOR: &[[f64; 2]] = &[];

/// Half width of the arch at its back and its length, millimetres.
const ARCH: [f64; 2] = [26.0, 43.0];
/// Position of the back of the arch along y.
const BACK_Y: f64 = -21.0;
/// Height at which the crowns emerge from the ridge.
const RIDGE_Z: f64 = 8.5;
const RIDGE_RADIUS: f64 = 6.2;
/// Radius of a ball that encloses a tooth, centred in the middle of crown and root; and the depth of that centre below
/// the top of the crown, millimetres.
const REACH: f64 = 11.0;
const MIDDLE_DEPTH: f64 = 6.0;
/// Distances are clamped to this value. No fillet reaches farther, and clamping saves most of the work.
const FAR: f64 = 2.5;

impl Teeth {
    pub(super) fn new() -> Self {
        let places = places();
        let ridge = places.windows(2).map(|p| RoundCone::new((p[0].0, RIDGE_RADIUS), (p[1].0, RIDGE_RADIUS))).collect();
        let teeth = places.iter().enumerate().map(|(i, &(centre, turn_rad))| {
            let rank = i.min(13 - i);
            let [half_width, half_depth, height] = SIZES[rank];
            let cusps = match rank {
                0 | 1 => MOLAR,
                2 | 3 => PREMOLAR,
                4 => CANINE,
                _ => INCISOR,
            };
            let centre = PointMm::new(centre.x, centre.y, height);
            let [from, to] = [-1.1, 1.1].map(|side| (PointMm::new(side * half_width, 0.0, 0.2), 0.9));
            Tooth {
                centre,
                along: turn_rad.sin_cos().into(),
                half: [half_width, half_depth],
                cusps,
                fissure: RoundCone::new(from, to),
            }
        });
        Self { ridge, teeth: teeth.collect() }
    }
}

/// Returns positions on the ridge and directions along the arch: the teeth are side by side on half an ellipse.
fn places() -> Vec<(PointMm, f64)> {
    let steps = 4000;
    let on_arch = |i: usize| {
        let angle = std::f64::consts::PI * i as f64 / f64::from(steps);
        PointMm::new(-ARCH[0] * angle.cos(), BACK_Y + ARCH[1] * angle.sin(), RIDGE_Z - 4.0)
    };
    // The arc length of an ellipse has no closed form, so positions are looked up in a table of it.
    let mut lengths = vec![0.0];
    for i in 0..steps as usize {
        lengths.push(lengths[i] + (on_arch(i + 1) - on_arch(i)).norm());
    }
    let half_widths: Vec<f64> = (0..14_usize).map(|i| SIZES[i.min(13 - i)][0]).collect();
    let stretch = lengths[steps as usize] / (2.0 * half_widths.iter().sum::<f64>());
    let mut start = 0.0;
    let mut placed = Vec::new();
    for half in half_widths {
        let i = lengths.partition_point(|&l| l < start + half * stretch).clamp(1, steps as usize - 1);
        let along = on_arch(i + 1) - on_arch(i - 1);
        placed.push((on_arch(i), along.y.atan2(along.x)));
        start += 2.0 * half * stretch;
    }
    placed
}

impl Tooth {
    fn distance(&self, point: &PointMm) -> f64 {
        let middle = self.centre - PointMm::z() * MIDDLE_DEPTH;
        if (point - middle).norm_squared() > (REACH + FAR) * (REACH + FAR) {
            return FAR;
        }
        let (offset, [sin, cos]) = (point - self.centre, self.along);
        let p = PointMm::new(cos * offset.x + sin * offset.y, cos * offset.y - sin * offset.x, offset.z);
        let [width, depth] = self.half;
        let crown = rounded_box(
            &p,
            PointMm::new(0.0, 0.0, -MIDDLE_DEPTH),
            PointMm::new(width, depth, MIDDLE_DEPTH),
            depth.min(2.6),
        );
        let cusp =
            |[x, y]: [f64; 2]| sphere(&p, PointMm::new(x * width, y * depth, -1.3), 0.38 * width.min(depth) + 0.3);
        let body = self.cusps.iter().fold(crown, |body, &at| smooth_union(body, cusp(at), 1.2));
        if self.cusps.len() < 2 {
            return body;
        }
        smooth_cut(body, self.fissure.distance(&p), 0.9)
    }
}

impl Solid for Teeth {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let along_ridge = self.ridge.iter().map(|bar| bar.axis_distance_squared(point)).fold(f64::INFINITY, f64::min);
        let ridge = along_ridge.sqrt() - RIDGE_RADIUS;
        let base = rounded_box(point, PointMm::new(0.0, -1.0, 1.5), PointMm::new(33.5, 27.5, 1.5), 1.0);
        let plaster = smooth_union(ridge, base, 4.0);
        let teeth = self.teeth.iter().map(|t| t.distance(point)).fold(FAR, f64::min);
        smooth_union(plaster, teeth, 1.5)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-36.0, -32.0, 0.0), PointMm::new(36.0, 32.0, 22.5))
    }
}
