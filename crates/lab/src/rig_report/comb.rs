//! The comb: the wrong fringe orders that pass the back-projection test on a locally flat surface, and how often they
//! do.
//!
//! Eq. 1 assumes that δ of a wrong candidate is uniform. On a flat surface it is not: k orders away, δ is close to
//! 2π·k·r, where r is the place of the projector on the base. So the same orders survive over the whole image. Here
//! each case (pixel, depth, tilt of the surface) is computed exactly: along the epipolar line on the surface to the
//! point that C2 sees with the same wrapped phase, back to the ray of C1, and into the projector.
//!
//! A wrong order whose δ also has no slope looks like the true one over a whole part of a surface. Each case is
//! computed at two pixels, and both δ are compared.

use std::f64::consts::{PI, TAU};
use std::ops::AddAssign;

use serde::Serialize;

use fringeflow::geometry::{Point3, Vector3};

use super::RigSetup;
use super::segment::Segment;
use super::surface::Surface;

/// Depths of the true point, as shares of the segment.
const DEPTH_SHARES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Tilts of the surface about the axis perpendicular to base and view, degrees.
const TILTS_DEG: [f64; 5] = [-40.0, -20.0, 0.0, 20.0, 40.0];
/// Index of the tilt that faces the rig.
const FACING: usize = 2;
/// Number of steps of the secant method after which the search for a phase gives up.
const MAX_SECANT_STEPS: usize = 12;
/// Distance of the two pixels between which the slope of δ is measured, pixels: half a tile of the order decision.
pub(super) const SLOPE_DISTANCE_PX: f64 = 8.0;
/// Slope of δ over this distance up to which a wrong order looks like a true one, rad.
const LIKE_TRUE_RAD: f64 = 0.03;
/// Phase error at convergence, periods.
const PHASE_TOLERANCE: f64 = 1e-8;

/// A wrong fringe order.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Tooth {
    /// Fringe orders between the wrong candidate and the true point, not 0.
    pub order: i32,
    /// Share of the cases in which this candidate lies on the segment.
    pub present_share: f64,
    /// Share of the cases in which it also survives |δ| < thr.
    pub surviving_share: f64,
    /// Share of the cases in which δ also has no slope along the surface.
    pub like_true_share: f64,
    /// Mean of |δ| over the cases with this candidate, rad; 0 if there are none.
    pub mean_abs_delta_rad: f64,
    /// |2π·order·r|, wrapped: the value for a distant flat surface, rad.
    pub approximate_abs_delta_rad: f64,
}

/// The wrong fringe orders of a rig.
#[derive(Clone, Debug, Serialize)]
pub struct Comb {
    /// Number of cases evaluated: pixels × depths × tilts in which all three devices see the true point.
    pub cases: u64,
    /// Surviving wrong candidates per true one on flat surfaces; compare with efc.
    pub survivors: f64,
    /// The same on surfaces that face the rig: the worst case for a projector near the middle of the base.
    pub survivors_facing: f64,
    /// Wrong candidates per true one that look like it over a part of the surface, for each tilt, degrees.
    pub like_true: Vec<(f64, f64)>,
    /// One entry for each order from −K to K except 0.
    pub teeth: Vec<Tooth>,
}

/// Sums over the cases of a wrong order.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    present: u64,
    surviving: u64,
    like_true: u64,
    /// Sum of |δ|, periods.
    abs_delta_turns: f64,
}

/// Sums over the cases of a tilt.
#[derive(Clone, Copy, Debug, Default)]
struct TiltCount {
    cases: u64,
    surviving: u64,
    like_true: u64,
}

impl TiltCount {
    /// Wrong orders per case, of those counted.
    fn per_case(&self, count: u64) -> f64 {
        count as f64 / self.cases.max(1) as f64
    }
}

/// Sums over the cases of one or more pixels.
#[derive(Clone, Debug)]
pub(super) struct Tally {
    tilts: [TiltCount; TILTS_DEG.len()],
    /// For orders 1, −1, 2, −2 and so on.
    orders: Vec<Count>,
}

impl Tally {
    pub(super) fn new(max_order: i32) -> Self {
        Self { tilts: Default::default(), orders: vec![Count::default(); 2 * max_order.unsigned_abs() as usize] }
    }

    /// Survivors per case; `None` if there is no case.
    pub(super) fn survivors(&self) -> Option<f64> {
        let surviving: u64 = self.tilts.iter().map(|tilt| tilt.surviving).sum();
        (self.cases() > 0).then(|| surviving as f64 / self.cases() as f64)
    }

    fn cases(&self) -> u64 {
        self.tilts.iter().map(|tilt| tilt.cases).sum()
    }

    fn max_order(&self) -> i32 {
        (self.orders.len() / 2) as i32
    }

    /// Adds a candidate with this δ, and with this one beside, turns.
    fn add_candidate(&mut self, tilt: usize, order: i32, delta: f64, beside: Option<f64>, threshold_turns: f64) {
        let count = &mut self.orders[order_index(order)];
        let survives = delta.abs() < threshold_turns;
        let slope = beside.map(|beside| beside - delta).map(|rise| TAU * (rise - rise.round()).abs());
        let is_like_true = survives && slope.is_some_and(|slope| slope < LIKE_TRUE_RAD);
        count.present += 1;
        count.surviving += u64::from(survives);
        count.like_true += u64::from(is_like_true);
        count.abs_delta_turns += delta.abs();
        self.tilts[tilt].surviving += u64::from(survives);
        self.tilts[tilt].like_true += u64::from(is_like_true);
    }
}

impl AddAssign<&Self> for Tally {
    fn add_assign(&mut self, other: &Self) {
        for (mine, theirs) in self.orders.iter_mut().zip(&other.orders) {
            mine.present += theirs.present;
            mine.surviving += theirs.surviving;
            mine.like_true += theirs.like_true;
            mine.abs_delta_turns += theirs.abs_delta_turns;
        }
        for (mine, theirs) in self.tilts.iter_mut().zip(&other.tilts) {
            mine.cases += theirs.cases;
            mine.surviving += theirs.surviving;
            mine.like_true += theirs.like_true;
        }
    }
}

/// Returns the index of an order in a tally.
fn order_index(order: i32) -> usize {
    2 * (order.unsigned_abs() as usize - 1) + usize::from(order < 0)
}

/// Data shared by all cases of a rig.
pub(super) struct Cases<'a> {
    setup: &'a RigSetup,
    normals: Vec<Vector3>,
    cam2: Point3,
    eyes: [Point3; 3],
    threshold_turns: f64,
    max_order: i32,
}

impl<'a> Cases<'a> {
    pub(super) fn new(setup: &'a RigSetup, threshold_rad: f64, max_order: i32) -> Self {
        let cam2 = setup.rig.centre_of_cam2();
        Self {
            setup,
            normals: Surface::tilted_normals(setup, &TILTS_DEG.map(f64::to_radians)),
            cam2,
            eyes: [Point3::origin(), cam2, setup.rig.centre_of_projector()],
            threshold_turns: threshold_rad / TAU,
            max_order,
        }
    }

    /// Computes the tally of one pixel, with the segment of one beside it.
    pub(super) fn pixel_tally(&self, segment: &Segment, beside: Option<&Segment>) -> Tally {
        let mut tally = Tally::new(self.max_order);
        for point in DEPTH_SHARES.map(|share| segment.at_share(share)) {
            let Some(phase) = self.setup.lit_phase_turns(&point).filter(|_| self.setup.cam2_sees(&point)) else {
                continue;
            };
            for (tilt, &normal) in self.normals.iter().enumerate() {
                self.add_case(&mut tally, tilt, segment, beside, &Surface { point, normal }, phase);
            }
        }
        tally
    }

    /// Adds one case: the flat `surface` through the true point. `phase` is the phase of that point, periods.
    fn add_case(
        &self,
        tally: &mut Tally,
        tilt: usize,
        segment: &Segment,
        beside: Option<&Segment>,
        surface: &Surface,
        phase: f64,
    ) {
        if !surface.has_all_on_one_side(&self.eyes) {
            return;
        }
        let Some(deltas) = self.deltas(segment, surface, phase) else { return };
        tally.tilts[tilt].cases += 1;
        // The slope matters for orders that survive.
        let survives = |(_, delta): &(i32, f64)| delta.abs() < self.threshold_turns;
        let beside = beside.filter(|_| deltas.iter().any(survives)).and_then(|segment| {
            let point = surface.intersection(&Point3::origin(), &segment.at_share(0.5))?;
            let phase = self.setup.lit_phase_turns(&point)?;
            self.deltas(segment, &Surface { point, ..*surface }, phase)
        });
        for (order, delta) in deltas {
            let same = beside.iter().flatten().find(|(other, _)| *other == order);
            tally.add_candidate(tilt, order, delta, same.map(|(_, delta)| *delta), self.threshold_turns);
        }
    }

    /// δ of the wrong orders of a pixel that sees a flat surface, turns. `phase` is the phase of its true point, periods.
    fn deltas(&self, segment: &Segment, surface: &Surface, phase: f64) -> Option<Vec<(i32, f64)>> {
        let trace = Trace::new(self, segment, surface, phase)?;
        let mut deltas = Vec::new();
        for sense in [1, -1] {
            // The place of the last candidate is the start of the search for the next order.
            let mut place_m = 0.0;
            // Phase and depth are monotone along the trace: after the first missing candidate there are no more.
            for order in (1..=self.max_order).map(|k| sense * k) {
                let Some((found_m, candidate)) = trace.candidate(self, segment, place_m, f64::from(order)) else {
                    break;
                };
                place_m = found_m;
                let Some(back) = self.setup.lit_phase_turns(&candidate) else { break };
                let delta = back - phase;
                deltas.push((order, delta - delta.round()));
            }
        }
        Some(deltas)
    }
}

/// Intersection of the epipolar plane of a pixel with a surface.
struct Trace {
    origin: Point3,
    direction: Vector3,
    phase: f64,
    /// Metres along the line per period of phase, at the true point.
    metres_per_turn: f64,
    /// Normal to the ray of C1 in the epipolar plane.
    across_ray: Vector3,
}

impl Trace {
    fn new(cases: &Cases, segment: &Segment, surface: &Surface, phase: f64) -> Option<Self> {
        let epipolar_normal = segment.ray.cross(&cases.cam2.coords);
        let direction = surface.normal.cross(&epipolar_normal).try_normalize(1e-12)?;
        let step_m = 1e-4 * segment.far_m;
        let turns = cases.setup.phase_turns(&(surface.point + direction * step_m))? - phase;
        let metres_per_turn = step_m / turns;
        metres_per_turn.is_finite().then(|| Self {
            origin: surface.point,
            direction,
            phase,
            metres_per_turn,
            across_ray: epipolar_normal.cross(&segment.ray),
        })
    }

    /// Returns the candidate `order` periods away: its place on the trace, and the point that C1 and C2 would
    /// triangulate.
    fn candidate(&self, cases: &Cases, segment: &Segment, from_m: f64, order: f64) -> Option<(f64, Point3)> {
        let place_m = self.place_of_phase(cases.setup, from_m, self.phase + order)?;
        let on_surface = self.origin + self.direction * place_m;
        cases.setup.lit_phase_turns(&on_surface)?;
        let candidate = self.on_ray(cases, segment, &on_surface)?;
        cases.setup.cam2_sees(&candidate).then_some((place_m, candidate))
    }

    /// Finds the place where the phase is `target` periods, by the secant method starting at `from_m`.
    fn place_of_phase(&self, setup: &RigSetup, from_m: f64, target: f64) -> Option<f64> {
        let error_at = |place_m: f64| Some(setup.phase_turns(&(self.origin + self.direction * place_m))? - target);
        let (mut before_m, mut before) = (from_m, error_at(from_m)?);
        let mut place_m = from_m - before * self.metres_per_turn;
        for _ in 0..MAX_SECANT_STEPS {
            let error = error_at(place_m)?;
            if error.abs() < PHASE_TOLERANCE {
                return Some(place_m);
            }
            let next_m = place_m - error * (place_m - before_m) / (error - before);
            (before_m, before, place_m) = (place_m, error, next_m);
            if !place_m.is_finite() {
                return None;
            }
        }
        None
    }

    /// Intersects the ray of C2 through a point of the trace with the ray of C1. Returns `None` if the intersection is
    /// not on the segment.
    fn on_ray(&self, cases: &Cases, segment: &Segment, on_surface: &Point3) -> Option<Point3> {
        let direction = on_surface - cases.cam2;
        let distance = -self.across_ray.dot(&cases.cam2.coords) / self.across_ray.dot(&direction);
        let candidate = cases.cam2 + direction * distance;
        (distance > 0.0 && (segment.near_m..=segment.far_m).contains(&candidate.z)).then_some(candidate)
    }
}

/// Computes the comb of all cases of a rig, with the projector at `place_on_base`.
pub(super) fn summary(tally: &Tally, place_on_base: f64) -> Option<Comb> {
    let survivors = tally.survivors()?;
    let max_order = tally.max_order();
    let cases = tally.cases() as f64;
    let tooth = |order: i32| {
        let Count { present, surviving, like_true, abs_delta_turns } = tally.orders[order_index(order)];
        Tooth {
            order,
            present_share: present as f64 / cases,
            surviving_share: surviving as f64 / cases,
            like_true_share: like_true as f64 / cases,
            mean_abs_delta_rad: if present == 0 { 0.0 } else { TAU * abs_delta_turns / present as f64 },
            approximate_abs_delta_rad: wrapped(TAU * f64::from(order) * place_on_base).abs(),
        }
    };
    let teeth = (-max_order..=max_order).filter(|&order| order != 0).map(tooth).collect();
    let facing = &tally.tilts[FACING];
    let survivors_facing = facing.per_case(facing.surviving);
    let tilts = TILTS_DEG.into_iter().zip(&tally.tilts);
    let like_true = tilts.map(|(tilt_deg, tilt)| (tilt_deg, tilt.per_case(tilt.like_true))).collect();
    Some(Comb { cases: tally.cases(), survivors, survivors_facing, like_true, teeth })
}

/// Wraps an angle to [−π, π).
fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}
