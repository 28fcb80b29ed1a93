//! Places of C2 that may be claimed for different orders: looked for band by band of C2, each by itself, with one number a place.

use rayon::prelude::*;

use crate::simd::{self, Kernel, LANES, Lanes, Level};

use super::super::grid::{ones, words};
use super::super::pool::Pool;
use super::continuity::Continuity;
use super::decisions::Decisions;
use super::scene::Scene;
use super::uniqueness::SAME_ORDER;

/// The decided places of C1, and the places of C2 that they have their correspondences in.
#[derive(Clone, Copy)]
pub(super) struct PlacesInCam2<'a> {
    continuity: &'a Continuity,
    decisions: Decisions<'a>,
    /// For each place of C1 the row of the epipolar frame.
    rows: &'a [u16],
    /// Width and height of the epipolar frame, pixels.
    size_px: [usize; 2],
}

impl<'a> PlacesInCam2<'a> {
    pub(super) fn new(scene: &Scene<'a>) -> Self {
        let Scene { continuity, decisions, cam2_row, .. } = *scene;
        Self { continuity, decisions, rows: cam2_row, size_px: scene.evidence.table.epipolar_size_px() }
    }

    /// Number in the epipolar frame, row by row, the place before the first counted as 0.
    #[inline(always)]
    pub(super) fn of(&self, place: usize) -> usize {
        let [width, _] = self.size_px;
        usize::from(self.rows[place]) * width + usize::from(self.decisions.column[place]).min(width - 1) + 1
    }

    /// The same of a block.
    #[inline(always)]
    fn of_block(&self, block: usize) -> [u32; LANES] {
        let (rows, columns) = (words(self.rows, block * LANES), words(self.decisions.column, block * LANES));
        let width = self.size_px[0] as u32;
        let mut places = [0; LANES];
        let mut k = 0;
        while k < LANES {
            let column = u32::from(columns[k]);
            places[k] = u32::from(rows[k]) * width + (if column < width { column } else { width - 1 }) + 1;
            k += 1;
        }
        places
    }
}

/// Words of 32 places of C2 in a band: its claims stay in the cache.
const BAND_WORDS: usize = 2048;

/// Places of C2 that are claimed, there or beside, for different orders; and a few more, where fringes are narrow.
#[derive(Clone, Debug, Default)]
pub(super) struct Disputed {
    /// A bit a place of C2, as [`PlacesInCam2`] counts them.
    bits: Vec<u32>,
    /// Disputed places before those of each word of `bits`, and in the end all.
    before: Vec<u32>,
    /// The least and the greatest place of C2 that the decided pixels of each block, and of each row, of C1 claim.
    of_blocks: Vec<Span>,
    of_rows: Vec<Span>,
    /// For each place of a band, one before and one after it, the absolute phase of the first claim.
    first: Pool<Vec<i32>>,
}

impl Disputed {
    /// Of claims that differ by so much one is remembered, the first to a place: any two that differ by [`SAME_ORDER`] differ
    /// by more than a third of it from each other's first, or these from one another.
    const ALIKE: i32 = SAME_ORDER / 3;
    /// Nobody has claimed the place.
    const FREE: i32 = i32::MIN;

    /// Finds those that the decided pixels of an image dispute.
    pub(super) fn find(&mut self, places: &PlacesInCam2<'_>, level: Level) {
        let grid = places.continuity.grid;
        let Self { bits, before, of_blocks, of_rows, first } = self;
        of_blocks.resize(grid.all_blocks(), Span::NONE);
        of_rows.resize(grid.height(), Span::NONE);
        let spans = grid.rows(of_blocks).par_chunks_mut(grid.blocks).zip(of_rows.par_iter_mut()).enumerate();
        spans.for_each(|(v, (of_blocks, of_row))| {
            *of_row = simd::run(level, SpansOfRow { places, v, of_blocks });
        });
        let [width, height] = places.size_px;
        // A place more on either side.
        bits.resize((width * height + 2).div_ceil(LANES), 0);
        let (of_blocks, of_rows) = (of_blocks.as_slice(), of_rows.as_slice());
        bits.par_chunks_mut(BAND_WORDS).enumerate().for_each_init(
            || first.take(),
            |first, (band, bits)| {
                let begin = (band * BAND_WORDS * LANES) as u32;
                simd::run(level, Band { places, of_blocks, of_rows, begin, bits, first });
            },
        );
        before.clear();
        let mut count = 0;
        before.push(count);
        before.extend(bits.iter().map(|bits| {
            count += bits.count_ones();
            count
        }));
    }

    /// How many places are disputed.
    pub(super) fn count(&self) -> usize {
        self.before.last().map_or(0, |&all| all as usize)
    }

    /// The decided pixels of a block of C1 that claim disputed places.
    #[inline]
    pub(super) fn concerned(&self, places: &PlacesInCam2<'_>, block: usize, decided: u32) -> u32 {
        let Span { least, greatest } = self.of_blocks[block];
        let words = least as usize / LANES..greatest as usize / LANES + 1;
        if least > greatest || self.bits[words].iter().all(|&bits| bits == 0) {
            return 0;
        }
        let places = places.of_block(block);
        ones(decided).fold(0, |concerned, k| {
            let is_disputed = self.bits[places[k] as usize / LANES] >> (places[k] % LANES as u32) & 1;
            concerned | is_disputed << k
        })
    }

    /// Number of a place of C2 among those that are disputed.
    #[inline]
    pub(super) fn number_of(&self, in_cam2: usize) -> Option<usize> {
        let (word, bit) = (in_cam2 / LANES, in_cam2 % LANES);
        let before = self.bits[word] & ((1 << bit) - 1);
        (self.bits[word] >> bit & 1 == 1).then(|| (self.before[word] + before.count_ones()) as usize)
    }
}

/// Whether two claims may be for different orders.
#[inline(always)]
fn are_unlike(a: i32, b: i32) -> bool {
    a.wrapping_sub(b).wrapping_abs() > Disputed::ALIKE
}

/// From one place of C2 to another.
#[derive(Clone, Copy, Debug)]
struct Span {
    least: u32,
    greatest: u32,
}

impl Span {
    const NONE: Self = Self { least: u32::MAX, greatest: 0 };

    #[inline(always)]
    fn join(&mut self, other: Self) {
        self.least = self.least.min(other.least);
        self.greatest = self.greatest.max(other.greatest);
    }

    #[inline(always)]
    fn meets(&self, other: Self) -> bool {
        self.least <= other.greatest && other.least <= self.greatest
    }
}

/// The spans of a row of C1.
struct SpansOfRow<'a> {
    places: &'a PlacesInCam2<'a>,
    v: usize,
    of_blocks: &'a mut [Span],
}

impl Kernel for SpansOfRow<'_> {
    type Output = Span;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Span {
        let mut of_row = Span::NONE;
        let first = self.places.continuity.grid.blocks_of_row(self.v).start - 1;
        let mut b = 1;
        while b + 1 < self.of_blocks.len() {
            let mut span = Span::NONE;
            let decided = self.places.decisions.decided[first + b];
            if decided != 0 {
                let places = self.places.of_block(first + b);
                let (mut least, mut greatest) = ([0; LANES], [0; LANES]);
                let mut k = 0;
                while k < LANES {
                    let is_decided = (decided >> k & 1).wrapping_neg();
                    least[k] = places[k] | !is_decided;
                    greatest[k] = places[k] & is_decided;
                    k += 1;
                }
                let mut half = LANES / 2;
                while half > 0 {
                    let mut k = 0;
                    while k < half {
                        least[k] = least[k].min(least[k + half]);
                        greatest[k] = greatest[k].max(greatest[k + half]);
                        k += 1;
                    }
                    half /= 2;
                }
                span = Span { least: least[0], greatest: greatest[0] };
            }
            self.of_blocks[b] = span;
            of_row.join(span);
            b += 1;
        }
        of_row
    }
}

/// Finds the disputed places of a band of C2.
struct Band<'a> {
    places: &'a PlacesInCam2<'a>,
    of_blocks: &'a [Span],
    of_rows: &'a [Span],
    /// First place of the band.
    begin: u32,
    bits: &'a mut [u32],
    /// Room for the first claims.
    first: &'a mut Vec<i32>,
}

impl Kernel for Band<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { places, of_blocks, of_rows, begin, bits, first } = self;
        let grid = places.continuity.grid;
        bits.fill(0);
        first.clear();
        first.resize(bits.len() * LANES + 2, Disputed::FREE);
        // The places that `first` knows of.
        let band = Span { least: begin.saturating_sub(1), greatest: begin + (bits.len() * LANES) as u32 };
        let mut v = 0;
        while v < of_rows.len() {
            if of_rows[v].meets(band) {
                for block in grid.blocks_of_row(v) {
                    if of_blocks[block].meets(band) {
                        claim(places, block, begin, first, bits);
                    }
                }
            }
            v += 1;
        }
        mark_beside(first, bits);
    }
}

/// Enters the claims of a block of C1, as far as they are to places of a band, and marks those that differ from the first.
#[inline(always)]
fn claim(places: &PlacesInCam2<'_>, block: usize, begin: u32, first: &mut [i32], bits: &mut [u32]) {
    let in_cam2 = places.of_block(block);
    let phase = words(&places.continuity.phase, block * LANES);
    let order = words(places.decisions.order, block * LANES);
    let mut absolute = [0; LANES];
    let mut k = 0;
    while k < LANES {
        absolute[k] = (i32::from(order[k] as i16) << 16) + i32::from(phase[k]);
        k += 1;
    }
    let mut decided = places.decisions.decided[block];
    while decided != 0 {
        let k = decided.trailing_zeros() as usize;
        decided &= decided - 1;
        let at = (in_cam2[k] + 1).wrapping_sub(begin) as usize;
        let Some(first) = first.get_mut(at) else { continue };
        if *first == Disputed::FREE {
            *first = absolute[k];
        } else if are_unlike(*first, absolute[k]) {
            // The place is bit `at` − 1 of the band; those before the first and behind the last bit are none.
            [at.wrapping_sub(2), at.wrapping_sub(1), at].into_iter().for_each(|bit| mark(bits, bit));
        }
    }
}

#[inline(always)]
fn mark(bits: &mut [u32], bit: usize) {
    if let Some(word) = bits.get_mut(bit / LANES) {
        *word |= 1 << (bit % LANES);
    }
}

/// Marks neighbouring places whose first claims are unlike.
#[inline(always)]
fn mark_beside(first: &[i32], bits: &mut [u32]) {
    let before = first[0] != Disputed::FREE && first[1] != Disputed::FREE && are_unlike(first[0], first[1]);
    let mut carry = u32::from(before);
    let mut word = 0;
    while word < bits.len() {
        let here = &first[word * LANES + 1..][..LANES];
        let next = &first[word * LANES + 2..][..LANES];
        let mut unlike = [0_u32; LANES];
        let mut k = 0;
        while k < LANES {
            let both = (here[k] != Disputed::FREE) & (next[k] != Disputed::FREE);
            unlike[k] = u32::from(both & are_unlike(here[k], next[k])) << k;
            k += 1;
        }
        let mut of_word = 0;
        let mut k = 0;
        while k < LANES {
            of_word |= unlike[k];
            k += 1;
        }
        bits[word] |= of_word | of_word << 1 | carry;
        carry = of_word >> (LANES - 1);
        word += 1;
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::super::test_scene::TestScene;
    use super::*;

    #[test]
    fn places_that_are_claimed_for_different_orders_are_disputed_at_every_level() {
        let mut scene = TestScene::new(150, 60);
        // Rows of C2 that reach into a second band; columns that rise along rows of C1, but that the last ones are the places of
        // earlier ones again, or those beside them.
        let size_px = [1200, 60];
        let grid = scene.continuity.grid;
        let mut rows = vec![0; grid.places()];
        for place in scene.places(&scene.candidates.any, true) {
            let [u, v] = grid.column_and_row(place);
            rows[place] = v as u16;
            scene.candidates.column[place] = (if u < 110 { 7 * u } else { 7 * (u - 100) + v % 2 }) as u16;
        }
        let decisions = scene.decisions();
        let places = PlacesInCam2 { continuity: &scene.continuity, decisions, rows: &rows, size_px };
        let decided = scene.places(&scene.decided, true);
        let mut claims = BTreeMap::<usize, Vec<i32>>::new();
        for &place in &decided {
            claims.entry(places.of(place)).or_default().push(decisions.absolute(&scene.continuity, place));
        }
        let differ = |a: &[i32], b: &[i32]| a.iter().any(|a| b.iter().any(|b| (a - b).abs() > SAME_ORDER));
        let mut expected = Vec::new();
        for (&at, here) in &claims {
            let beside = [at - 1, at + 1].map(|beside| claims.get(&beside).is_some_and(|there| differ(here, there)));
            if differ(here, here) || beside.contains(&true) {
                expected.push(at);
            }
        }
        assert!(expected.len() > 200 && claims.len() > 2 * expected.len(), "{} {}", expected.len(), claims.len());
        let mut all = Vec::new();
        for level in Level::ALL {
            let mut disputed = Disputed::default();
            disputed.find(&places, level);
            assert!(expected.iter().all(|&at| disputed.number_of(at).is_some()), "{level:?}");
            for block in grid.blocks_of_image() {
                let concerned = disputed.concerned(&places, block, scene.decided[block]);
                for k in ones(scene.decided[block]) {
                    let is_disputed = disputed.number_of(places.of(block * LANES + k)).is_some();
                    assert_eq!(concerned >> k & 1 == 1, is_disputed);
                }
            }
            all.push(disputed.bits);
        }
        assert!(all[0] == all[1] && all[1] == all[2]);
    }
}
