//! Where δ changes steadily from pixel to pixel: the mark of a wrong order.

use super::super::neighbourhood::TURN;
use super::regions::{Regions, Run};
use super::scene::Scene;

/// Pixels on either side over which the slope of δ is measured; the margin of the planes has as many rows.
const REACH_PX: usize = 3;

/// Tells where δ changes steadily.
pub(super) struct Steepness<'a> {
    delta: &'a [i16],
    stride: usize,
    regions: &'a Regions,
    /// Change of δ a pixel beyond which it is steep, turns · 65536.
    limit: f64,
}

impl<'a> Steepness<'a> {
    pub(super) fn new(scene: &Scene<'a>, regions: &'a Regions) -> Self {
        let limit = f64::from(scene.evidence.steep_delta_turns) * f64::from(TURN);
        Self { delta: scene.decisions.delta, stride: scene.continuity.grid.stride(), regions, limit }
    }

    /// Whether δ is steep along the rows or the columns at a decided place.
    pub(super) fn is_steep(&self, place: usize) -> bool {
        let Some(run) = self.regions.run_at(place) else { return false };
        // Beside it a run tells, above and below it mostly the links.
        self.is_steep_along(place, 1, run, |_| false)
            || self.is_steep_along(place, self.stride, run, |upper| self.regions.goes_on_below(upper))
    }

    /// Whether the least-squares slope of δ over the pixels of the same region around a place is beyond the limit; with too few
    /// on a side there is none. `run` is that of the place; `is_linked` knows of some places that they are of one region with the
    /// next one a stride on.
    #[inline(always)]
    fn is_steep_along(&self, place: usize, stride: usize, run: &Run, is_linked: impl Fn(usize) -> bool) -> bool {
        let is_of_region =
            |other: usize| run.places().contains(&other) || self.regions.region_of(other) == Some(run.region as usize);
        let (mut first, mut last) = (place, place);
        while first + REACH_PX * stride > place && (is_linked(first - stride) || is_of_region(first - stride)) {
            first -= stride;
        }
        while last < place + REACH_PX * stride && (is_linked(last) || is_of_region(last + stride)) {
            last += stride;
        }
        let steps = (last - first) / stride;
        if steps < REACH_PX {
            return false;
        }
        // Offsets are counted in halves of a pixel from the middle: whole numbers.
        let (mut moment, mut spread) = (0, 0);
        for k in 0..=steps {
            let offset = 2 * k as i32 - steps as i32;
            moment += offset * i32::from(self.delta[first + k * stride]);
            spread += offset * offset;
        }
        (0.5 * f64::from(moment) / (0.25 * f64::from(spread))).abs() > self.limit
    }
}
