//! Where δ changes steadily from pixel to pixel: the mark of a wrong order.

use super::super::neighbourhood::TURN;
use super::Resolver;
use super::regions::Regions;

/// Pixels on either side over which the slope of δ is measured; the margin of the planes has as many rows.
const REACH_PX: usize = 3;

/// Tells where δ changes steadily.
pub(super) struct Steepness<'a> {
    resolver: &'a Resolver<'a>,
    regions: &'a Regions,
    /// Change of δ a pixel beyond which it is steep, turns · 65536.
    limit: f64,
}

impl<'a> Steepness<'a> {
    pub(super) fn new(resolver: &'a Resolver<'_>, regions: &'a Regions) -> Self {
        let limit = f64::from(resolver.evidence.steep_delta_turns) * f64::from(TURN);
        Self { resolver, regions, limit }
    }

    /// Whether δ is steep along the rows or the columns at a decided place.
    pub(super) fn is_steep(&self, place: usize) -> bool {
        let stride = self.resolver.continuity.grid.stride();
        [1, stride].into_iter().any(|stride| self.slope(place, stride).is_some_and(|slope| slope.abs() > self.limit))
    }

    /// Least-squares slope of δ over the pixels of the same region around a place; `None` with too few on a side.
    fn slope(&self, place: usize, stride: usize) -> Option<f64> {
        let steps = 1..=REACH_PX;
        let before = steps.clone().take_while(|k| self.regions.are_one(place, place - k * stride)).count();
        let after = steps.take_while(|k| self.regions.are_one(place, place + k * stride)).count();
        if before + after < REACH_PX {
            return None;
        }
        let centre = 0.5 * (after as f64 - before as f64);
        let (mut moment, mut spread) = (0.0, 0.0);
        for k in 0..=before + after {
            let offset = k as f64 - before as f64 - centre;
            moment += offset * f64::from(self.resolver.decisions.delta[place - before * stride + k * stride]);
            spread += offset * offset;
        }
        Some(moment / spread)
    }
}
