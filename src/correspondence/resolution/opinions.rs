//! What the decided pixels around the open pixels of a row say about their candidates.

use crate::simd::{Kernel, LANES, Lanes};

use super::super::candidates::DeltaGate;
use super::changed_tiles::ChangedTiles;
use super::continuity::{Axis, CENTRE, Continuity, FAR};
use super::decision::{Proposal, VoteRule};
use super::decisions::Decisions;
use super::grid::{bits_from, words};
use super::lists::Lists;
use super::support::NEAR;

/// Which walks are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Directions {
    /// Along the epipolar direction.
    Along,
    /// Along and across it.
    AlongAndAcross,
}

/// A pixel that is decided: its place, and the candidate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decision {
    pub(super) place: u32,
    pub(super) k: u8,
}

/// Who is asked, and how answers are weighed.
#[derive(Clone, Copy)]
pub(super) struct Question<'a> {
    pub(super) continuity: &'a Continuity,
    pub(super) decisions: &'a Decisions,
    pub(super) lists: &'a Lists<'a>,
    /// Axes of the walks that are taken.
    pub(super) axes: &'a [Axis],
    pub(super) rule: VoteRule,
    /// Difference of δ that is tolerated, turns · 65536.
    pub(super) tolerance: i32,
}

/// Asks the neighbours of the open pixels of some blocks, of those that may have heard something new.
pub(super) struct Ask<'a> {
    pub(super) question: Question<'a>,
    pub(super) blocks: std::ops::Range<usize>,
    /// A bit a place.
    pub(super) open: &'a [u32],
    pub(super) changed: &'a ChangedTiles,
    pub(super) decided: &'a mut Vec<Decision>,
}

impl Kernel for Ask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let mut proposals = Vec::new();
        for block in self.blocks {
            let mut open = self.open[block];
            if open == 0 || !self.changed.reach(block) {
                continue;
            }
            while open != 0 {
                let place = block * LANES + open.trailing_zeros() as usize;
                open &= open - 1;
                if let Some(k) = self.question.ask(lanes, place, &mut proposals) {
                    self.decided.push(Decision { place: place as u32, k });
                }
            }
        }
    }
}

impl Question<'_> {
    #[inline(always)]
    fn ask<L: Lanes>(&self, lanes: L, place: usize, proposals: &mut Vec<Proposal>) -> Option<u8> {
        proposals.clear();
        let mut total = 0;
        let mut axis = 0;
        while axis < self.axes.len() {
            match self.axes[axis] {
                Axis::Row => self.ask_row(lanes, place, proposals, &mut total),
                Axis::Column => self.ask_column(place, proposals, &mut total),
            }
            axis += 1;
        }
        self.rule.choose(proposals, total, self.tolerance).map(|best| best.k)
    }

    #[inline(always)]
    fn ask_row<L: Lanes>(&self, lanes: L, place: usize, proposals: &mut Vec<Proposal>, total: &mut u16) {
        let [left, right] = self.continuity.row_reach(lanes, place);
        // Lanes of those before and after the pixel.
        let before = ((1 << left) - 1) << (CENTRE as u32 - left);
        let after = ((1 << right) - 1) << (CENTRE + 1);
        let asked = (before | after) & bits_from(&self.decisions.decided, place - CENTRE);
        if asked == 0 {
            return;
        }
        self.propose(place, proposals);
        *total += asked.count_ones() as u16;
        let turns = &self.continuity.row.turns;
        let here_turns = lanes.word(turns[place]);
        let turns = lanes.sub(lanes.load(words(turns, place - CENTRE)), here_turns);
        let proposed = lanes.sub(lanes.load(words(&self.decisions.order, place - CENTRE)), turns);
        let delta = lanes.load(words(&self.decisions.delta, place - CENTRE));
        for proposal in proposals {
            let agree = lanes.bits(lanes.is_equal(proposed, lanes.word(proposal.order))) & asked;
            if agree != 0 {
                let delta = lanes.select(lanes.mask(agree), delta, lanes.word(0));
                proposal.tally.votes += agree.count_ones() as u16;
                proposal.tally.delta_sum += lanes.dot(delta, lanes.word(1));
            }
        }
    }

    #[inline(always)]
    fn ask_column(&self, place: usize, proposals: &mut Vec<Proposal>, total: &mut u16) {
        for forwards in [false, true] {
            self.continuity.walk(place, Axis::Column, forwards, FAR as usize, |next, turns| {
                if self.decisions.is_decided(next) {
                    self.propose(place, proposals);
                    *total += 1;
                    let proposed = self.decisions.order[next].wrapping_sub(turns);
                    for proposal in proposals.iter_mut().filter(|proposal| proposal.order == proposed) {
                        proposal.tally.votes += 1;
                        proposal.tally.delta_sum += i32::from(self.decisions.delta[next]);
                    }
                }
            });
        }
    }

    /// Writes down the candidates of a place, once there is somebody to ask.
    #[inline(always)]
    fn propose(&self, place: usize, proposals: &mut Vec<Proposal>) {
        if proposals.is_empty() {
            self.lists.eligible(place, proposals);
        }
    }
}

/// On how many of its four sides a decided place has decided ones near that say the same, with a δ that passes the test.
pub(super) fn sides(continuity: &Continuity, decisions: &Decisions, place: usize, gate: &DeltaGate) -> usize {
    let sides = [(Axis::Row, false), (Axis::Row, true), (Axis::Column, false), (Axis::Column, true)];
    let has_support = |&(axis, forwards): &(Axis, bool)| {
        let mut has = false;
        continuity.walk(place, axis, forwards, NEAR, |next, turns| {
            has |= decisions.is_decided(next)
                && decisions.order[next].wrapping_sub(turns) == decisions.order[place]
                && gate.passes(decisions.delta[next]);
        });
        has
    };
    sides.iter().filter(|side| has_support(side)).count()
}

#[cfg(test)]
mod tests {
    use crate::simd::{self, Level};

    use super::super::test_scene::TestScene;
    use super::*;

    /// What a pixel is decided for, by walks.
    fn choice(question: &Question<'_>, place: usize) -> Option<u8> {
        let (mut proposals, mut total) = (Vec::new(), 0);
        question.lists.eligible(place, &mut proposals);
        for &axis in question.axes {
            for forwards in [false, true] {
                question.continuity.walk(place, axis, forwards, FAR as usize, |next, turns| {
                    if question.decisions.is_decided(next) {
                        total += 1;
                        let proposed = question.decisions.order[next].wrapping_sub(turns);
                        for proposal in proposals.iter_mut().filter(|proposal| proposal.order == proposed) {
                            proposal.tally.votes += 1;
                            proposal.tally.delta_sum += i32::from(question.decisions.delta[next]);
                        }
                    }
                });
            }
        }
        question.rule.choose(&proposals, total, question.tolerance).map(|best| best.k)
    }

    #[test]
    fn rows_are_asked_as_walks_say() {
        let scene = TestScene::new(150, 60);
        let grid = scene.continuity.grid;
        let mut lists = Lists::new(&scene.lists, grid);
        let open_places = scene.places(&scene.decisions.decided, false);
        for &place in open_places.iter().filter(|&place| place % 9 == 0) {
            assert!(lists.of(place).is_empty() || lists.exclude(place, 1));
        }
        let mut open = vec![0; grid.all_blocks()];
        open_places.iter().for_each(|&place| open[place / LANES] |= 1 << (place % LANES));
        let changed = ChangedTiles::new(grid, true);
        for axes in [&[Axis::Row][..], &[Axis::Column], &[Axis::Row, Axis::Column]] {
            for (rule, tolerance) in [(VoteRule::strict(3), 150), (VoteRule::LENIENT, 65536)] {
                let (continuity, decisions, lists) = (&scene.continuity, &scene.decisions, &lists);
                let question = Question { continuity, decisions, lists, axes, rule, tolerance };
                let expected: Vec<(usize, u8)> =
                    open_places.iter().filter_map(|&place| Some((place, choice(&question, place)?))).collect();
                assert!(expected.len() > 100, "{}", expected.len());
                for level in Level::ALL {
                    let mut decided = Vec::new();
                    for v in 0..60 {
                        let blocks = grid.blocks_of_row(v);
                        let (open, changed) = (&open, &changed);
                        simd::run(level, Ask { question, blocks, open, changed, decided: &mut decided });
                    }
                    let decided: Vec<(usize, u8)> = decided.iter().map(|d| (d.place as usize, d.k)).collect();
                    assert_eq!(decided, expected, "{level:?} {axes:?}");
                }
            }
        }
    }
}
