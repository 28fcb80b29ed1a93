//! Whether the decided pixels next to a pixel support what it was decided for: up to three steps to each of four sides.

use crate::simd::{Kernel, LANES, Lanes};

use super::super::grid::{bits_from, words};
use super::changed::Changed;
use super::continuity::{Along, Axis, Continuity, are_periods};
use super::decision::VoteRule;
use super::decisions::Decisions;
use super::tallies::{Counting, Tallies};

/// Steps of a walk.
pub(super) const NEAR: usize = 3;

/// Support by decided pixels.
#[derive(Clone, Copy)]
pub(super) struct Support<'a> {
    pub(super) continuity: &'a Continuity,
    pub(super) decisions: Decisions<'a>,
    pub(super) rule: VoteRule,
    /// Difference of δ that is tolerated, turns · 65536.
    pub(super) tolerance: i32,
}

impl Support<'_> {
    /// Of a block the decided pixels that their neighbours support.
    #[inline(always)]
    pub(super) fn of_block<L: Lanes>(&self, lanes: L, block: usize) -> u32 {
        let decided = self.decisions.decided[block];
        if decided == 0 {
            return 0;
        }
        let mut votes = Votes::new(lanes, self, block);
        votes.add(lanes, self, &self.continuity.row, false);
        votes.add(lanes, self, &self.continuity.row, true);
        votes.add(lanes, self, &self.continuity.column, false);
        votes.add(lanes, self, &self.continuity.column, true);
        votes.supported(lanes, self) & decided
    }
}

/// The pixels that walks from a block have come to, a bit for each that they began from: after one step, two, and three.
#[inline(always)]
fn walks(along: &Along, block: usize, forwards: bool) -> [u32; NEAR] {
    let (here, stride) = (block * LANES, along.stride);
    // A step is told by the first of its two pixels.
    let runs_on = |steps: usize| {
        bits_from(&along.runs_on, if forwards { here + (steps - 1) * stride } else { here - steps * stride })
    };
    let passes =
        |steps: usize| bits_from(&along.passes, if forwards { here + steps * stride } else { here - steps * stride });
    let one = runs_on(1);
    let two = one & runs_on(2) & passes(1);
    [one, two, two & runs_on(3) & passes(2)]
}

/// Votes for the decisions of a block.
struct Votes<L: Lanes> {
    block: usize,
    phase: L::Words,
    /// Orders of the block.
    order: L::Words,
    /// Those who say the same, and those who say anything.
    same: Counting<L>,
    total: L::Words,
}

impl<L: Lanes> Votes<L> {
    #[inline(always)]
    fn new(lanes: L, support: &Support<'_>, block: usize) -> Self {
        let order = lanes.load(words(support.decisions.order, block * LANES));
        let phase = lanes.load(words(&support.continuity.phase, block * LANES));
        Self { block, phase, order, same: Counting::new(lanes), total: lanes.word(0) }
    }

    /// Asks those that the walks to one side have come to.
    #[inline(always)]
    fn add(&mut self, lanes: L, support: &Support<'_>, along: &Along, forwards: bool) {
        let (decisions, here) = (support.decisions, self.block * LANES);
        let here_turns = lanes.load(words(&along.turns, here));
        let (zero, one) = (lanes.word(0), lanes.word(1));
        let walks = walks(along, self.block, forwards);
        let mut step = 0;
        while step < NEAR {
            let distance = (step + 1) * along.stride;
            let place = if forwards { here + distance } else { here - distance };
            let mut asked = walks[step] & bits_from(decisions.decided, place);
            if asked == 0 {
                step += 1;
                continue;
            }
            let turns = lanes.sub(lanes.load(words(&along.turns, place)), here_turns);
            if step + 1 == NEAR {
                // Three of the largest steps are more than a period.
                let phase = lanes.load(words(&support.continuity.phase, place));
                asked &= !are_periods(lanes, self.phase, phase, turns);
            }
            let proposed = lanes.sub(lanes.load(words(decisions.order, place)), turns);
            let agree = lanes.bits(lanes.is_equal(proposed, self.order)) & asked;
            self.total = lanes.add(self.total, lanes.select(lanes.mask(asked), one, zero));
            self.same.add(lanes.mask(agree), lanes.load(words(decisions.delta, place)));
            step += 1;
        }
    }

    /// Those with enough votes.
    #[inline(always)]
    fn supported(&self, lanes: L, support: &Support<'_>) -> u32 {
        let ([mut total, mut delta], mut same) = ([[0_u16; LANES]; 2], Tallies::NONE);
        self.same.store(&mut same);
        lanes.store(self.total, &mut total);
        lanes.store(lanes.load(words(support.decisions.delta, self.block * LANES)), &mut delta);
        let mut supported = 0;
        let mut k = 0;
        while k < LANES {
            let is = support.rule.supports(same.of(k), total[k], delta[k] as i16, support.tolerance);
            supported |= u32::from(is) << k;
            k += 1;
        }
        supported
    }
}

/// Which decided pixels of a row their neighbours do not support.
pub(super) struct UnsupportedInRow<'a> {
    pub(super) support: Support<'a>,
    /// The block before the first of the row.
    pub(super) first: usize,
    /// Those near a change are asked; all if there is none.
    pub(super) changed: Option<Changed<'a>>,
    pub(super) unsupported: &'a mut [u32],
}

impl Kernel for UnsupportedInRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let mut b = 1;
        while b + 1 < self.unsupported.len() {
            let block = self.first + b;
            let mut asked = self.support.decisions.decided[block];
            if let Some(changed) = self.changed
                && asked != 0
            {
                asked &= changed.around(block, &[Axis::Row, Axis::Column], NEAR as u32);
            }
            self.unsupported[b] = if asked == 0 { 0 } else { asked & !self.support.of_block(lanes, block) };
            b += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::simd::{self, Level};

    use super::super::super::grid::bit;
    use super::super::decision::Tally;
    use super::super::test_scene::TestScene;
    use super::*;

    struct OfBlock<'a>(Support<'a>, usize);

    impl Kernel for OfBlock<'_> {
        type Output = u32;

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) -> u32 {
            self.0.of_block(lanes, self.1)
        }
    }

    /// Whether a place is supported, by walks.
    fn is_supported(support: &Support<'_>, place: usize) -> bool {
        let (mut tally, mut total) = (Tally::default(), 0);
        for (axis, forwards) in [(Axis::Row, false), (Axis::Row, true), (Axis::Column, false), (Axis::Column, true)] {
            support.continuity.walk(place, axis, forwards, NEAR, |next, turns| {
                if support.decisions.is_decided(next) {
                    let same = support.decisions.order[next].wrapping_sub(turns) == support.decisions.order[place];
                    total += 1;
                    tally.votes += u16::from(same);
                    tally.delta_sum += if same { i32::from(support.decisions.delta[next]) } else { 0 };
                }
            });
        }
        support.rule.supports(tally, total, support.decisions.delta[place], support.tolerance)
    }

    #[test]
    fn blocks_are_supported_as_walks_say() {
        let scene = TestScene::new(150, 60);
        for (min_votes, tolerance) in [(1, 40), (3, 100), (3, 65536), (6, 200)] {
            let rule = VoteRule::strict(min_votes);
            let support = Support { continuity: &scene.continuity, decisions: scene.decisions(), rule, tolerance };
            let mut counts = [0; 2];
            for level in Level::ALL {
                let blocks = scene.continuity.grid.all_blocks();
                let mut supported = vec![0; blocks];
                for block in scene.continuity.grid.blocks_of_image() {
                    supported[block] = simd::run(level, OfBlock(support, block));
                }
                for place in scene.places(&scene.decided, true) {
                    let expected = is_supported(&support, place);
                    assert_eq!(bit(&supported, place), expected, "{level:?} {place}");
                    counts[usize::from(expected)] += 1;
                }
            }
            assert!(counts.iter().all(|&count| count > 300), "{counts:?}");
        }
    }
}
