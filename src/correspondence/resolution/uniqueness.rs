//! One point of C2 serves one order (paper, 2.2.3): two pixels of C1 that claim the same place of C2 with different
//! absolute phases lie on different points of one ray of C2, of which the camera sees only one.

use rayon::prelude::*;

use super::super::neighbourhood::TURN;
use super::Resolver;
use super::regions::Regions;

/// Absolute phases in one place of C2 that differ by more than this are different orders.
const SAME_ORDER: i32 = TURN / 2;

/// Place of a pixel without decision.
const NOWHERE: u32 = u32::MAX;
/// Pixels on either side over which the slope of δ is measured.
const REACH_PX: isize = 3;

/// What a pixel brings forward for its place of C2.
#[derive(Clone, Copy)]
struct Claim {
    /// δ runs steadily through the test, the mark of a wrong order.
    steep: bool,
    region: u32,
    region_size: u32,
    absolute: i32,
}

impl Claim {
    fn outweighs(&self, other: &Self) -> bool {
        (!self.steep, self.region_size) > (!other.steep, other.region_size)
    }
}

/// Pixels whose place of C2 a better founded claim takes for another order.
pub(super) fn contested(resolver: &Resolver<'_>, regions: &Regions, credible: &[bool]) -> Vec<bool> {
    let [width, height] = resolver.evidence.table.epipolar_size_px();
    let places: Vec<u32> = (0..resolver.absolute.len())
        .into_par_iter()
        .map(|pixel| {
            if regions.region_of(pixel).is_none() {
                return NOWHERE;
            }
            let row = resolver.evidence.table.segments()[pixel].row_px.round() as usize;
            let column = resolver.chosen_candidate(pixel).column_px.round() as usize;
            (row.min(height - 1) * width + column.min(width - 1)) as u32
        })
        .collect();
    let steep = Steepness::new(resolver, regions);
    let disputed = disputed(&resolver.absolute, &places, width * height);
    let claims: Vec<Option<Claim>> = (0..resolver.absolute.len())
        .into_par_iter()
        .map(|pixel| {
            let region = regions.region_of(pixel)?;
            let (region_size, absolute) = (regions.sizes[region], resolver.absolute[pixel]);
            // Nobody asks where there is no dispute.
            let steep = disputed[places[pixel] as usize] && steep.is_steep(pixel);
            Some(Claim { steep, region: region as u32, region_size, absolute })
        })
        .collect();
    let owners = owners(&claims, credible, &places, width * height);
    let mut contested: Vec<bool> = (0..claims.len())
        .into_par_iter()
        .map(|pixel| {
            let Some(claim) = &claims[pixel] else { return false };
            let loses =
                |place: usize| {
                    owners.get(place).copied().flatten().is_some_and(|owner| {
                        owner.outweighs(claim) && (owner.absolute - claim.absolute).abs() > SAME_ORDER
                    })
                };
            let here = places[pixel] as usize;
            // A surface that C2 sees larger than C1 leaves gaps between its claims; a gap between two is claimed too.
            loses(here) || (loses(here.wrapping_sub(1)) && loses(here + 1))
        })
        .collect();
    spread_over_regions(&mut contested, regions);
    contested
}

/// Places of C2 that pixels claim, there or beside, for different orders.
fn disputed(absolute: &[i32], places: &[u32], count: usize) -> Vec<bool> {
    let mut range = vec![(i32::MAX, i32::MIN); count];
    for (&absolute, &place) in absolute.iter().zip(places).filter(|&(_, &place)| place != NOWHERE) {
        let (low, high) = &mut range[place as usize];
        (*low, *high) = ((*low).min(absolute), (*high).max(absolute));
    }
    let span = |around: &[(i32, i32)]| {
        let (low, high) = around.iter().fold((i32::MAX, i32::MIN), |(l, h), &(low, high)| (l.min(low), h.max(high)));
        high.saturating_sub(low)
    };
    (0..count)
        .into_par_iter()
        .map(|place| span(&range[place.saturating_sub(1)..(place + 2).min(count)]) > SAME_ORDER)
        .collect()
}

/// For each place of C2 the best founded claim of a credible region.
fn owners(claims: &[Option<Claim>], credible: &[bool], places: &[u32], count: usize) -> Vec<Option<Claim>> {
    let mut owners: Vec<Option<Claim>> = vec![None; count];
    for (claim, &place) in claims.iter().zip(places) {
        let Some(claim) = claim.filter(|c| credible[c.region as usize]) else { continue };
        let owner = &mut owners[place as usize];
        if owner.is_none_or(|o| claim.outweighs(&o)) {
            *owner = Some(claim);
        }
    }
    owners
}

/// Tells where δ changes steadily.
struct Steepness<'a> {
    resolver: &'a Resolver<'a>,
    regions: &'a Regions,
    /// Change of δ a pixel beyond which it is steep, turns · 65536.
    limit: f64,
}

impl<'a> Steepness<'a> {
    fn new(resolver: &'a Resolver<'_>, regions: &'a Regions) -> Self {
        let limit = f64::from(resolver.evidence.steep_delta_turns) * f64::from(TURN);
        Self { resolver, regions, limit }
    }

    /// Whether δ is steep along the rows or the columns at a pixel.
    fn is_steep(&self, pixel: usize) -> bool {
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

/// A region of which three tenths are contested is contested as a whole.
fn spread_over_regions(contested: &mut [bool], regions: &Regions) {
    let mut counts = vec![0_u64; regions.sizes.len()];
    for pixel in (0..contested.len()).filter(|&p| contested[p]) {
        if let Some(region) = regions.region_of(pixel) {
            counts[region] += 1;
        }
    }
    for (pixel, contested) in contested.iter_mut().enumerate() {
        if let Some(region) = regions.region_of(pixel) {
            *contested |= 10 * counts[region] > 3 * u64::from(regions.sizes[region]);
        }
    }
}
