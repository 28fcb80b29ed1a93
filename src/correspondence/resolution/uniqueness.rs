//! One point of C2 serves one order (paper, 2.2.3): two pixels of C1 that claim the same place of C2 with different
//! absolute phases lie on different points of one ray of C2, of which the camera sees only one.

use rayon::prelude::*;

use crate::simd::{self, Kernel, LANES, Lanes};

use super::super::neighbourhood::TURN;
use super::Resolver;
use super::grid::places_of;
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
    place: u32,
    /// Index of the place of C2 in the epipolar frame.
    in_cam2: u32,
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

/// A bit a place: pixels of regions that do not stand, and pixels whose place of C2 another claim takes for another order.
///
/// A region stands if it is `credible` and better founded claims take no good part of it. Between the pixels of those that
/// stand, `precedence` decides.
pub(super) fn contested(
    resolver: &Resolver<'_>,
    regions: &Regions,
    credible: &[bool],
    precedence: Precedence,
) -> Vec<u32> {
    let claims = Claims::of_disputed_places(resolver, regions, precedence);
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
    let mut contested = regions.places_where(resolver.continuity.grid, |region| !stands[region]);
    lost.iter().for_each(|claim| contested[claim.place as usize / LANES] |= 1 << (claim.place as usize % LANES));
    contested
}

/// Places of C2 that the decided places of C1 have their correspondences in.
struct PlacesInCam2<'a> {
    width: usize,
    /// Row and column of the epipolar frame.
    rows: &'a [u16],
    columns: &'a [u16],
}

impl<'a> PlacesInCam2<'a> {
    fn new(resolver: &'a Resolver<'_>) -> Self {
        let [width, _] = resolver.evidence.table.epipolar_size_px();
        Self { width, rows: &resolver.epipolar_rows, columns: &resolver.decisions.column }
    }

    /// Index in the epipolar frame.
    #[inline]
    fn of(&self, place: usize) -> usize {
        usize::from(self.rows[place]) * self.width + usize::from(self.columns[place]).min(self.width - 1)
    }
}

/// The claims of pixels to the places that are claimed, there or beside, for different orders.
struct Claims {
    claims: Vec<Claim>,
    disputed: Disputed,
}

impl Claims {
    fn of_disputed_places(resolver: &Resolver<'_>, regions: &Regions, precedence: Precedence) -> Self {
        let grid = resolver.continuity.grid;
        let places = PlacesInCam2::new(resolver);
        let disputed = Disputed::of(resolver, &places);
        let steepness = Steepness::new(resolver, regions);
        let table = resolver.evidence.table;
        let claim = |place: usize| {
            let in_cam2 = places.of(place);
            let region = regions.region_of(place).filter(|_| disputed.contains(in_cam2))?;
            Some(Claim {
                steep: steepness.is_steep(place),
                region: region as u32,
                region_size: regions.sizes[region],
                absolute: resolver.decisions.absolute(&resolver.continuity, place),
                nearness: match precedence {
                    Precedence::Foundation => 0.0,
                    Precedence::Nearness => table.nearness_to_cam2(grid.pixel(place)),
                },
                place: place as u32,
                in_cam2: in_cam2 as u32,
            })
        };
        let of_row = |v: usize| resolver.decided_in_row(v).filter_map(claim).collect::<Vec<_>>();
        let rows: Vec<Vec<Claim>> = (0..grid.height()).into_par_iter().map(of_row).collect();
        Self { claims: rows.concat(), disputed }
    }

    /// Claims that lose their place to one of a region that stands.
    fn lost(&self, stands: &[bool], beats: fn(&Claim, &Claim) -> bool) -> Vec<&Claim> {
        let owners = self.owners(stands, beats);
        let loses = |claim: &Claim, in_cam2: usize| {
            self.disputed
                .number_of(in_cam2)
                .and_then(|number| self.claims.get(owners[number] as usize))
                .is_some_and(|owner| beats(owner, claim) && (owner.absolute - claim.absolute).abs() > SAME_ORDER)
        };
        let is_lost = |claim: &&Claim| {
            let here = claim.in_cam2 as usize;
            // A surface that C2 sees larger than C1 leaves gaps between its claims; a gap between two is claimed too.
            loses(claim, here) || (here > 0 && loses(claim, here - 1) && loses(claim, here + 1))
        };
        self.claims.par_iter().filter(is_lost).collect()
    }

    /// For each disputed place the index of the claim, of a region that stands, that no other beats; beyond all where there
    /// is none.
    fn owners(&self, stands: &[bool], beats: fn(&Claim, &Claim) -> bool) -> Vec<u32> {
        let mut owners = vec![u32::MAX; self.disputed.count()];
        for (index, claim) in self.claims.iter().enumerate().filter(|(_, claim)| stands[claim.region as usize]) {
            let Some(number) = self.disputed.number_of(claim.in_cam2 as usize) else { continue };
            if self.claims.get(owners[number] as usize).is_none_or(|owner| beats(claim, owner)) {
                owners[number] = index as u32;
            }
        }
        owners
    }
}

/// Places of C2 that are claimed, there or beside, for different orders; and a few more, where fringes are narrow.
struct Disputed {
    /// A bit a place, the first that of a place before all.
    bits: Vec<u32>,
    /// Disputed places before those of each word of `bits`, and in the end all.
    before: Vec<u32>,
}

impl Disputed {
    /// Of claims that differ by so much one is remembered, the first to a place: any two that differ by [`SAME_ORDER`] differ
    /// by more than a third of it from each other's first, or these from one another.
    const ALIKE: i32 = SAME_ORDER / 3;
    /// Nobody has claimed the place.
    const FREE: i32 = i32::MIN;

    fn of(resolver: &Resolver<'_>, places: &PlacesInCam2<'_>) -> Self {
        let [width, height] = resolver.evidence.table.epipolar_size_px();
        // A place more on either side.
        let mut first = vec![Self::FREE; (width * height + 2).next_multiple_of(LANES) + LANES];
        let mut bits = vec![0_u32; first.len() / LANES];
        for block in resolver.continuity.grid.blocks_of_image() {
            for place in places_of(block, resolver.decisions.decided[block]) {
                let absolute = resolver.decisions.absolute(&resolver.continuity, place);
                let at = places.of(place) + 1;
                let first = &mut first[at];
                if *first == Self::FREE {
                    *first = absolute;
                } else if are_unlike(*first, absolute) {
                    (at - 1..=at + 1).for_each(|at| bits[at / LANES] |= 1 << (at % LANES));
                }
            }
        }
        simd::run(resolver.level, Beside { first: &first, bits: &mut bits });
        let mut before = vec![0];
        let mut count = 0;
        before.extend(bits.iter().map(|bits| {
            count += bits.count_ones();
            count
        }));
        Self { bits, before }
    }

    /// How many places are disputed.
    fn count(&self) -> usize {
        self.before.last().map_or(0, |&all| all as usize)
    }

    #[inline]
    fn contains(&self, in_cam2: usize) -> bool {
        self.bits[(in_cam2 + 1) / LANES] >> ((in_cam2 + 1) % LANES) & 1 == 1
    }

    /// Number of a place among those that are disputed.
    #[inline]
    fn number_of(&self, in_cam2: usize) -> Option<usize> {
        let (word, bit) = ((in_cam2 + 1) / LANES, (in_cam2 + 1) % LANES);
        let before = self.bits[word] & ((1 << bit) - 1);
        self.contains(in_cam2).then(|| (self.before[word] + before.count_ones()) as usize)
    }
}

/// Whether two claims may be for different orders.
#[inline(always)]
fn are_unlike(a: i32, b: i32) -> bool {
    a.wrapping_sub(b).wrapping_abs() > Disputed::ALIKE
}

/// Marks neighbouring places whose first claims are unlike.
struct Beside<'a> {
    first: &'a [i32],
    bits: &'a mut [u32],
}

impl Kernel for Beside<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let (mut word, mut carry) = (0, 0);
        while word + 1 < self.bits.len() {
            let here = &self.first[word * LANES..][..LANES];
            let next = &self.first[word * LANES + 1..][..LANES];
            let mut unlike = [0_u32; LANES];
            let mut k = 0;
            while k < LANES {
                let both = (here[k] != Disputed::FREE) & (next[k] != Disputed::FREE);
                unlike[k] = u32::from(both & are_unlike(here[k], next[k])) << k;
                k += 1;
            }
            let mut bits = 0;
            let mut k = 0;
            while k < LANES {
                bits |= unlike[k];
                k += 1;
            }
            self.bits[word] |= bits | bits << 1 | carry;
            carry = bits >> (LANES - 1);
            word += 1;
        }
        self.bits[word] |= carry;
    }
}
