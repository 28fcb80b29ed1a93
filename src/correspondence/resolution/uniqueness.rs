//! One point of C2 serves one order (paper, 2.2.3): two pixels of C1 that claim the same place of C2 with different
//! absolute phases lie on different points of one ray of C2, of which the camera sees only one.

use super::super::neighbourhood::TURN;
use super::Resolver;
use super::regions::Regions;

/// Absolute phases in one place of C2 that differ by more than this are different orders.
const SAME_ORDER: i32 = TURN / 2;

/// The largest region that claims a place of C2.
#[derive(Clone, Copy)]
struct Claim {
    region: u32,
    absolute: i32,
}

/// Pixels whose place of C2 a larger region claims for another order.
pub(super) fn contested(resolver: &Resolver<'_>, regions: &Regions, credible: &[bool]) -> Vec<bool> {
    let [width, height] = resolver.evidence.table.epipolar_size_px();
    let place = |pixel: usize| {
        let row = resolver.evidence.table.segments()[pixel].row_px.round() as usize;
        let column = resolver.chosen_candidate(pixel).column_px.round() as usize;
        row.min(height - 1) * width + column.min(width - 1)
    };
    let claims = claims(resolver, regions, credible, width * height, place);
    let pixels = 0..resolver.absolute.len();
    let mut contested: Vec<bool> = pixels
        .map(|pixel| {
            let Some(region) = regions.region_of(pixel) else { return false };
            let loses = |place: usize| {
                claims.get(place).copied().flatten().is_some_and(|claim| {
                    claim.region as usize != region
                        && regions.sizes[claim.region as usize] > regions.sizes[region]
                        && (claim.absolute - resolver.absolute[pixel]).abs() > SAME_ORDER
                })
            };
            let here = place(pixel);
            // A surface that C2 sees larger than C1 leaves gaps between its claims; a gap between two is claimed too.
            loses(here) || (loses(here.wrapping_sub(1)) && loses(here + 1))
        })
        .collect();
    spread_over_regions(&mut contested, regions);
    contested
}

/// For each place of C2 the claim of the largest credible region.
fn claims(
    resolver: &Resolver<'_>,
    regions: &Regions,
    credible: &[bool],
    places: usize,
    place: impl Fn(usize) -> usize,
) -> Vec<Option<Claim>> {
    let mut claims: Vec<Option<Claim>> = vec![None; places];
    for pixel in 0..resolver.absolute.len() {
        let Some(region) = regions.region_of(pixel).filter(|&r| credible[r]) else { continue };
        let claim = &mut claims[place(pixel)];
        if claim.is_none_or(|c| regions.sizes[region] > regions.sizes[c.region as usize]) {
            *claim = Some(Claim { region: region as u32, absolute: resolver.absolute[pixel] });
        }
    }
    claims
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
