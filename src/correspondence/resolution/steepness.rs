//! Where δ changes steadily from pixel to pixel: the mark of a wrong order.

use super::super::neighbourhood::TURN;
use super::Resolver;
use super::regions::Regions;

/// Pixels on either side over which the slope of δ is measured.
const REACH_PX: isize = 3;

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

    /// Whether δ is steep along the rows or the columns at a pixel.
    pub(super) fn is_steep(&self, pixel: usize) -> bool {
        let width = self.resolver.evidence.cam1.width as isize;
        [1, width].into_iter().any(|stride| self.slope(pixel, stride).is_some_and(|slope| slope.abs() > self.limit))
    }

    /// Least-squares slope of δ over the pixels of the same region around a pixel; `None` with too few on a side.
    fn slope(&self, pixel: usize, stride: isize) -> Option<f64> {
        let same = |next: usize| self.regions.region_of(next) == self.regions.region_of(pixel);
        let reach = |direction: isize| {
            let steps = 1..=REACH_PX;
            steps.take_while(|k| pixel.checked_add_signed(direction * k * stride).is_some_and(&same)).count() as isize
        };
        let (before, after) = (reach(-1), reach(1));
        if before + after < REACH_PX {
            return None;
        }
        let centre = 0.5 * (after - before) as f64;
        let (mut moment, mut spread) = (0.0, 0.0);
        for k in -before..=after {
            let offset = k as f64 - centre;
            moment += offset * f64::from(self.resolver.delta[pixel.wrapping_add_signed(k * stride)]);
            spread += offset * offset;
        }
        Some(moment / spread)
    }
}
