//! Fits a surface to the points of its region, and leaves out what the standard allows, and what is no part of it.
//!
//! VDI/VDE 2634 lets at most 0.3 % of the points be left out. Points far from the surface (a wrong fringe order, a part
//! of the stand) would pull the fit away, so they are left out even if they are more; then [`LeftOut::exceeds`] says that
//! the figures are none of the standard.

use fringeflow::geometry::Point3;

use super::statistics::range;

/// Largest share of the points that may be left out.
pub const ALLOWED_SHARE: f64 = 0.003;
/// Most rounds of fitting and choosing. The choice usually stays after three.
const MAX_ROUNDS: usize = 12;

/// The points of a region, and which of them the fit left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct LeftOut {
    /// Points of the region.
    pub points: usize,
    /// Points that the fit used.
    pub used: usize,
    /// Points left out because they are far from the surface. The others are the outermost.
    pub far: usize,
}

impl LeftOut {
    /// Share of the points that was left out.
    #[must_use]
    pub fn share(&self) -> f64 {
        (self.points - self.used) as f64 / self.points.max(1) as f64
    }

    /// Whether more is left out than the standard allows.
    #[must_use]
    pub fn exceeds(&self) -> bool {
        self.far > allowed(self.points)
    }
}

fn allowed(points: usize) -> usize {
    (ALLOWED_SHARE * points as f64) as usize
}

/// A fitted surface, with the points that it used.
pub(super) struct Fitted<S> {
    pub(super) surface: S,
    /// Indices of the used points within the region, ascending.
    pub(super) used: Vec<usize>,
    pub(super) left_out: LeftOut,
    /// Range of the distances of the used points, metres: PF or F of the standard.
    pub(super) range_m: f64,
}

/// Fits a surface to the points of a region, again and again, each time without its outermost points.
pub(super) fn fit<S: Clone>(
    region: &[Point3],
    start: S,
    far_m: f64,
    fit: impl Fn(&[Point3], &S) -> Option<S>,
    distance_m: impl Fn(&S, &Point3) -> f64,
) -> Option<Fitted<S>> {
    let mut surface = start;
    let mut used = Vec::new();
    for _ in 0..MAX_ROUNDS {
        let next = nearest(region, far_m, |point| distance_m(&surface, point));
        if next == used {
            break;
        }
        used = next;
        let points: Vec<Point3> = used.iter().map(|&i| region[i]).collect();
        surface = fit(&points, &surface)?;
    }
    let far = region.iter().filter(|point| distance_m(&surface, point).abs() > far_m).count();
    let range_m = range(used.iter().map(|&i| distance_m(&surface, &region[i])));
    let left_out = LeftOut { points: region.len(), used: used.len(), far };
    Some(Fitted { surface, used, left_out, range_m })
}

/// The points nearest to the surface: all but the allowed share, and none that is far.
fn nearest(region: &[Point3], far_m: f64, distance_m: impl Fn(&Point3) -> f64) -> Vec<usize> {
    let mut order: Vec<(f64, usize)> =
        region.iter().enumerate().map(|(i, point)| (distance_m(point).abs(), i)).collect();
    // Equal distances are told apart by their place, so the choice is one.
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let kept = region.len() - allowed(region.len());
    let mut used: Vec<usize> =
        order.into_iter().take(kept).take_while(|(distance, _)| *distance <= far_m).map(|(_, i)| i).collect();
    used.sort_unstable();
    used
}
