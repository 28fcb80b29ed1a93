//! One point of C2 serves one order (paper, 2.2.3): two pixels of C1 that claim the same place of C2 with different
//! absolute phases lie on different points of one ray of C2, of which the camera sees only one.

use rayon::prelude::*;

use super::super::neighbourhood::TURN;
use super::super::places::Places;
use super::Resolver;
use super::regions::Regions;
use super::steepness::Steepness;

/// Absolute phases in one place of C2 that differ by more than this are different orders.
const SAME_ORDER: i32 = TURN / 2;

/// Share of a region that may lose its places before the whole region does.
const MAX_LOST_SHARE: f64 = 0.3;

/// Which of two claims to one place of C2 takes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precedence {
    /// The one with a level δ, then the one of the larger region. While decisions still change, nothing else would do: the
    /// pixels of a right region, hidden by a nearer wrong one, would be decided anew and join it.
    Foundation,
    /// The nearer to C2, which hides the other: between regions that stand, as both do.
    Nearness,
}

/// What a pixel brings forward for its place of C2.
#[derive(Clone, Copy)]
struct Claim {
    /// δ runs steadily through the test, the mark of a wrong order.
    steep: bool,
    region: u32,
    region_size: u32,
    absolute: i32,
    /// How near to C2 its point lies.
    nearness: f32,
    pixel: u32,
    /// Index of the place in the epipolar frame.
    place: u32,
}

impl Claim {
    /// Whether it is better founded.
    fn outweighs(&self, other: &Self) -> bool {
        (!self.steep, self.region_size) > (!other.steep, other.region_size)
    }

    /// Whether its point hides the other's from C2.
    fn hides(&self, other: &Self) -> bool {
        self.nearness > other.nearness
    }
}

/// Pixels of regions that do not stand, and pixels whose place of C2 another claim takes for another order.
///
/// A region stands if it is `credible` and better founded claims take no good part of it. Between the pixels of those that
/// stand, `precedence` decides.
pub(super) fn contested(
    resolver: &Resolver<'_>,
    regions: &Regions,
    credible: &[bool],
    precedence: Precedence,
) -> Vec<bool> {
    let claims = Claims::of_disputed_places(resolver, regions);
    let mut stands = credible.to_vec();
    let lost = claims.lost(&stands, Claim::outweighs);
    let mut lost_by_region = vec![0_u32; stands.len()];
    lost.iter().for_each(|claim| lost_by_region[claim.region as usize] += 1);
    for (region, count) in lost_by_region.into_iter().enumerate() {
        stands[region] &= f64::from(count) <= MAX_LOST_SHARE * f64::from(regions.sizes[region]);
    }
    let lost = match precedence {
        Precedence::Foundation => lost,
        Precedence::Nearness => claims.lost(&stands, Claim::hides),
    };
    let fallen = |pixel: usize| regions.region_of(pixel).is_some_and(|region| !stands[region]);
    let mut contested: Vec<bool> = (0..resolver.absolute.len()).into_par_iter().map(fallen).collect();
    lost.iter().for_each(|claim| contested[claim.pixel as usize] = true);
    contested
}

/// The claims of pixels to the places that are claimed, there or beside, for different orders.
struct Claims {
    claims: Vec<Claim>,
    /// Number of all places.
    places: usize,
}

impl Claims {
    fn of_disputed_places(resolver: &Resolver<'_>, regions: &Regions) -> Self {
        let table = resolver.evidence.table;
        let [width, height] = table.epipolar_size_px();
        let column_px = |pixel: usize| Some(resolver.chosen_candidate(pixel).column_px);
        let places = Places::of(table, |pixel| regions.region_of(pixel).and_then(|_| column_px(pixel)));
        let disputed = disputed(&resolver.absolute, &places.of_pixels, width * height);
        let steepness = Steepness::new(resolver, regions);
        let claim = |pixel: usize| {
            let place = places.of_pixels[pixel];
            let region = regions.region_of(pixel).filter(|_| disputed[place as usize])?;
            Some(Claim {
                steep: steepness.is_steep(pixel),
                region: region as u32,
                region_size: regions.sizes[region],
                absolute: resolver.absolute[pixel],
                nearness: places.nearness[pixel],
                pixel: pixel as u32,
                place,
            })
        };
        let claims = (0..resolver.absolute.len()).into_par_iter().filter_map(claim).collect();
        Self { claims, places: width * height }
    }

    /// Claims that lose their place to one of a region that stands.
    fn lost(&self, stands: &[bool], beats: fn(&Claim, &Claim) -> bool) -> Vec<&Claim> {
        let owners = self.owners(stands, beats);
        let loses = |claim: &Claim, place: usize| {
            owners
                .get(place)
                .and_then(|&owner| self.claims.get(owner as usize))
                .is_some_and(|owner| beats(owner, claim) && (owner.absolute - claim.absolute).abs() > SAME_ORDER)
        };
        let is_lost = |claim: &&Claim| {
            let here = claim.place as usize;
            // A surface that C2 sees larger than C1 leaves gaps between its claims; a gap between two is claimed too.
            loses(claim, here) || (loses(claim, here.wrapping_sub(1)) && loses(claim, here + 1))
        };
        self.claims.par_iter().filter(is_lost).collect()
    }

    /// For each place the index of the claim, of a region that stands, that no other beats; beyond all where there is none.
    fn owners(&self, stands: &[bool], beats: fn(&Claim, &Claim) -> bool) -> Vec<u32> {
        let mut owners = vec![u32::MAX; self.places];
        for (index, claim) in self.claims.iter().enumerate().filter(|(_, claim)| stands[claim.region as usize]) {
            let owner = &mut owners[claim.place as usize];
            if self.claims.get(*owner as usize).is_none_or(|owner| beats(claim, owner)) {
                *owner = index as u32;
            }
        }
        owners
    }
}

/// Places of C2 that pixels claim, there or beside, for different orders.
fn disputed(absolute: &[i32], places: &[u32], count: usize) -> Vec<bool> {
    let mut range = vec![(i32::MAX, i32::MIN); count];
    for (&absolute, &place) in absolute.iter().zip(places).filter(|&(_, &place)| place != Places::NOWHERE) {
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
