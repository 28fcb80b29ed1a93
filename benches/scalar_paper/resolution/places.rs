//! One point of C2 serves one order (2.2.3).

use super::super::TURN;
use super::Image;
use super::regions::Regions;

/// Absolute phases in one place that differ by more are different orders.
const SAME_ORDER: i32 = TURN / 2;
/// Share of a region that may lose its places before all of it does.
const MAX_LOST_SHARE: f64 = 0.3;
/// A pixel without a place, a place without an owner.
const NONE: u32 = u32::MAX;

/// Which of two claims to a place takes it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Precedence {
    /// That with a level δ, then that of the larger region.
    Foundation,
    /// The nearer to C2.
    Nearness,
}

/// What a pixel says of its place.
struct Claim {
    is_steep: bool,
    region: usize,
    size: u32,
    absolute: i32,
    nearness: f32,
    pixel: usize,
    place: usize,
}

impl Claim {
    fn beats(&self, other: &Self, precedence: Precedence) -> bool {
        match precedence {
            Precedence::Foundation => (!self.is_steep, self.size) > (!other.is_steep, other.size),
            Precedence::Nearness => self.nearness > other.nearness,
        }
    }
}

/// Pixels of regions that do not stand, or whose place another claim takes for another order.
pub(super) fn contested(
    image: &Image<'_>,
    regions: &Regions,
    mut stands: Vec<bool>,
    precedence: Precedence,
) -> Vec<usize> {
    let claims = claims(image, regions);
    let mut losers = lost(image, &claims, &stands, Precedence::Foundation);
    let mut lost_by_region = vec![0_u32; stands.len()];
    losers.iter().for_each(|&claim| lost_by_region[claims[claim].region] += 1);
    for (region, count) in lost_by_region.into_iter().enumerate() {
        stands[region] &= f64::from(count) <= MAX_LOST_SHARE * f64::from(regions.sizes[region]);
    }
    if precedence == Precedence::Nearness {
        losers = lost(image, &claims, &stands, precedence);
    }
    let mut falls: Vec<bool> =
        (0..image.chosen.len()).map(|pixel| regions.of_pixel(pixel).is_some_and(|region| !stands[region])).collect();
    losers.iter().for_each(|&claim| falls[claims[claim].pixel] = true);
    (0..falls.len()).filter(|&pixel| falls[pixel]).collect()
}

/// Claims to places that are claimed, there or beside, for different orders.
fn claims(image: &Image<'_>, regions: &Regions) -> Vec<Claim> {
    let tables = image.tables;
    let (width, last_row) = (tables.epipolar_width, tables.sources.len() / tables.epipolar_width - 1);
    let place = |pixel: usize| {
        let row = ((tables.segments[pixel].row_px + 0.5) as usize).min(last_row);
        let column = ((image.candidate(pixel)?.column_px + 0.5) as usize).min(width - 1);
        Some((row * width + column) as u32)
    };
    let places: Vec<u32> = (0..image.chosen.len()).map(|pixel| place(pixel).unwrap_or(NONE)).collect();
    let mut range = vec![(i32::MAX, i32::MIN); tables.sources.len()];
    for (&absolute, &place) in image.absolute.iter().zip(&places).filter(|(_, place)| **place != NONE) {
        let (low, high) = range[place as usize];
        range[place as usize] = (low.min(absolute), high.max(absolute));
    }
    let is_disputed = |place: usize| {
        let around = &range[place.saturating_sub(1)..(place + 2).min(range.len())];
        let (low, high) = around.iter().fold((i32::MAX, i32::MIN), |(l, h), &(low, high)| (l.min(low), h.max(high)));
        high.saturating_sub(low) > SAME_ORDER
    };
    let claim = |(pixel, &place): (usize, &u32)| {
        let region = regions.of_pixel(pixel).filter(|_| is_disputed(place as usize))?;
        Some(Claim {
            is_steep: regions.is_steep(image, pixel),
            region,
            size: regions.sizes[region],
            absolute: image.absolute[pixel],
            nearness: tables.nearness[pixel],
            pixel,
            place: place as usize,
        })
    };
    places.iter().enumerate().filter_map(claim).collect()
}

/// Claims that lose their place to one of a region that stands.
fn lost(image: &Image<'_>, claims: &[Claim], stands: &[bool], precedence: Precedence) -> Vec<usize> {
    let mut owners = vec![NONE; image.tables.sources.len()];
    for (index, claim) in claims.iter().enumerate().filter(|(_, claim)| stands[claim.region]) {
        let owner = &mut owners[claim.place];
        if claims.get(*owner as usize).is_none_or(|owner| claim.beats(owner, precedence)) {
            *owner = index as u32;
        }
    }
    let loses = |claim: &Claim, place: usize| {
        let owner = owners.get(place).and_then(|&owner| claims.get(owner as usize));
        owner
            .is_some_and(|owner| owner.beats(claim, precedence) && (owner.absolute - claim.absolute).abs() > SAME_ORDER)
    };
    let is_lost = |&index: &usize| {
        let (claim, here) = (&claims[index], claims[index].place);
        loses(claim, here) || (loses(claim, here.wrapping_sub(1)) && loses(claim, here + 1))
    };
    (0..claims.len()).filter(is_lost).collect()
}
