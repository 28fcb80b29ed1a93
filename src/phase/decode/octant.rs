//! Angle and length of the vector (cosine, sine), from the quotient of the smaller and the larger of both. In: words.
//! Out: words. Cost: two short polynomials.

use fringeflow_simd::Lanes;

use super::side_by_side::SideBySide;

/// Coefficients of `4·atan(t)/2π ≈ t·(c0 + c1·t² + …)` on [0, 1], minimax, times 2^15; largest error 0.12 · 2^−16 turn.
const ARCTANGENT: [i16; 5] = [20858, -6890, 3758, -1776, 435];
/// Coefficients of `√(1 + u) − 1 ≈ u·(c0 + c1·u + …)` on [0, 1], minimax, times 2^15; largest error 1e-4.
const ROOT: [i16; 3] = [16309, -3565, 832];

/// The octant of an angle.
pub(super) struct Direction<L: Lanes, const COUNT: usize> {
    /// The sine is the larger.
    pub(super) swapped: [L::Mask; COUNT],
    /// The cosine is negative.
    pub(super) left: [L::Mask; COUNT],
    /// The sine is negative.
    pub(super) below: [L::Mask; COUNT],
}

/// The angle minus `ahead` (turns · 65536), and the square of `share`.
///
/// `share` is the smaller ÷ the larger of cosine and sine, as a fraction of 2^15; 0 for the null vector.
#[inline(always)]
pub(super) fn angle<L: Lanes, const COUNT: usize>(
    blocks: SideBySide<L, COUNT>,
    share: [L::Words; COUNT],
    direction: &Direction<L, COUNT>,
    ahead: u16,
) -> ([L::Words; COUNT], [L::Words; COUNT]) {
    let b = blocks;
    let square = b.times(share, share);
    let octant = b.half_up(b.times(share, polynomial(b, square, &ARCTANGENT)));
    let quadrant = b.select(direction.swapped, b.sub(b.word(16384), octant), octant);
    let half = b.select(direction.left, b.sub(b.word(-32768), quadrant), quadrant);
    let whole = b.select(direction.below, b.sub(b.word(0), half), half);
    (b.sub(whole, b.word(ahead as i16)), square)
}

/// Modulation in its steps: large · √(1 + square), with `large` in steps of 1/256 grey level.
#[inline(always)]
pub(super) fn hypotenuse<L: Lanes, const COUNT: usize>(
    blocks: SideBySide<L, COUNT>,
    large: [L::Words; COUNT],
    square: [L::Words; COUNT],
) -> [L::Words; COUNT] {
    let b = blocks;
    let root = b.add(b.word(-32768), b.times(square, polynomial(b, square, &ROOT)));
    b.times_high(large, root)
}

/// c0 + x·(c1 + x·(c2 + …)), all fractions of 2^15.
#[inline(always)]
fn polynomial<L: Lanes, const COUNT: usize, const DEGREE: usize>(
    blocks: SideBySide<L, COUNT>,
    x: [L::Words; COUNT],
    coefficients: &[i16; DEGREE],
) -> [L::Words; COUNT] {
    // A plain loop: closures of iterators are not always inlined.
    let mut sum = blocks.word(coefficients[DEGREE - 1]);
    let mut k = DEGREE - 1;
    while k > 0 {
        k -= 1;
        sum = blocks.add(blocks.word(coefficients[k]), blocks.times(x, sum));
    }
    sum
}
