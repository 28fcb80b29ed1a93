//! One point of C2 serves one order (paper, 2.2.3): two pixels of C1 that claim the same place of C2 with different
//! absolute phases lie on different points of one ray of C2, of which the camera sees only one.

use rayon::prelude::*;

use crate::simd::LANES;

use super::super::grid::places_of;
use super::super::neighbourhood::TURN;
use super::disputed::{Disputed, PlacesInCam2};
use super::regions::Regions;
use super::scene::Scene;
use super::steepness::Steepness;

/// Absolute phases in one place of C2 that differ by more than this are different orders.
pub(super) const SAME_ORDER: i32 = TURN / 2;

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
#[derive(Clone, Copy, Debug)]
struct Claim {
    /// δ runs steadily through the test, the mark of a wrong order.
    steep: bool,
    region: u32,
    region_size: u32,
    absolute: i32,
    /// How near to C2 its point lies.
    nearness: f32,
    place: u32,
    /// The place of C2, see [`PlacesInCam2`], and its number among those that are disputed.
    in_cam2: u32,
    number: u32,
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

/// Memory in which claims are contested.
#[derive(Clone, Debug, Default)]
pub(super) struct Court {
    disputed: Disputed,
    claims: Claims,
    stands: Vec<bool>,
    lost_by_region: Vec<u32>,
}

impl Court {
    /// Marks, a bit a place, the pixels of regions that do not stand, and pixels whose place of C2 another claim takes for
    /// another order.
    ///
    /// A region stands if it is `credible` and better founded claims take no good part of it. Between the pixels of those that
    /// stand, `precedence` decides.
    pub(super) fn contest(
        &mut self,
        scene: &Scene<'_>,
        regions: &Regions,
        credible: &[bool],
        precedence: Precedence,
        contested: &mut [u32],
    ) {
        let Self { disputed, claims, stands, lost_by_region } = self;
        disputed.find(&PlacesInCam2::new(scene), scene.level);
        claims.gather(scene, regions, disputed, precedence);
        stands.clear();
        stands.extend(credible);
        claims.lose(disputed, stands, Claim::outweighs);
        lost_by_region.clear();
        lost_by_region.resize(stands.len(), 0);
        claims.losers().for_each(|claim| lost_by_region[claim.region as usize] += 1);
        for (region, &count) in lost_by_region.iter().enumerate() {
            stands[region] &= f64::from(count) <= MAX_LOST_SHARE * f64::from(regions.sizes[region]);
        }
        if precedence == Precedence::Nearness {
            claims.lose(disputed, stands, Claim::hides);
        }
        regions.add_places_where(contested, |region| !stands[region]);
        for claim in claims.losers() {
            contested[claim.place as usize / LANES] |= 1 << (claim.place as usize % LANES);
        }
    }
}

/// The claims of pixels to the places that are disputed.
#[derive(Clone, Debug, Default)]
struct Claims {
    of_rows: Vec<Vec<Claim>>,
    all: Vec<Claim>,
    /// For each disputed place the number of the claim, of a region that stands, that no other beats; beyond all where there is
    /// none.
    owners: Vec<u32>,
    /// For each claim whether it loses its place.
    lost: Vec<bool>,
}

impl Claims {
    fn gather(&mut self, scene: &Scene<'_>, regions: &Regions, disputed: &Disputed, precedence: Precedence) {
        let grid = scene.continuity.grid;
        let places = PlacesInCam2::new(scene);
        let steepness = Steepness::new(scene, regions);
        let table = scene.evidence.table;
        let claim = |place: usize| {
            let in_cam2 = places.of(place);
            let number = disputed.number_of(in_cam2)?;
            let region = regions.region_of(place)?;
            Some(Claim {
                steep: steepness.is_steep(place),
                region: region as u32,
                region_size: regions.sizes[region],
                absolute: scene.decisions.absolute(scene.continuity, place),
                nearness: match precedence {
                    Precedence::Foundation => 0.0,
                    Precedence::Nearness => table.nearness_to_cam2(grid.pixel(place)),
                },
                place: place as u32,
                in_cam2: in_cam2 as u32,
                number: number as u32,
            })
        };
        self.of_rows.resize(grid.height(), Vec::new());
        self.of_rows.par_iter_mut().enumerate().for_each(|(v, claims)| {
            claims.clear();
            for block in grid.blocks_of_row(v) {
                let concerned = disputed.concerned(&places, block, scene.decisions.decided[block]);
                claims.extend(places_of(block, concerned).filter_map(claim));
            }
        });
        self.all.clear();
        self.of_rows.iter().for_each(|claims| self.all.extend_from_slice(claims));
    }

    /// Finds the claims that lose their place to one of a region that stands.
    fn lose(&mut self, disputed: &Disputed, stands: &[bool], beats: fn(&Claim, &Claim) -> bool) {
        let Self { all, owners, lost, .. } = self;
        owners.clear();
        owners.resize(disputed.count(), u32::MAX);
        for (index, claim) in all.iter().enumerate().filter(|(_, claim)| stands[claim.region as usize]) {
            let owner = &mut owners[claim.number as usize];
            if all.get(*owner as usize).is_none_or(|owner| beats(claim, owner)) {
                *owner = index as u32;
            }
        }
        let loses_to = |claim: &Claim, number: usize| {
            all.get(owners[number] as usize)
                .is_some_and(|owner| beats(owner, claim) && (owner.absolute - claim.absolute).abs() > SAME_ORDER)
        };
        let loses_at =
            |claim: &Claim, in_cam2: usize| disputed.number_of(in_cam2).is_some_and(|number| loses_to(claim, number));
        let is_lost = |claim: &Claim| {
            let here = claim.in_cam2 as usize;
            // A surface that C2 sees larger than C1 leaves gaps between its claims; a gap between two is claimed too.
            loses_to(claim, claim.number as usize) || (loses_at(claim, here - 1) && loses_at(claim, here + 1))
        };
        all.par_iter().map(is_lost).collect_into_vec(lost);
    }

    /// Claims that lost their places.
    fn losers(&self) -> impl Iterator<Item = &Claim> {
        self.all.iter().zip(&self.lost).filter(|(_, lost)| **lost).map(|(claim, _)| claim)
    }
}
