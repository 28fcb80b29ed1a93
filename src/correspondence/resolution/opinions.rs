//! What the decided pixels around the open pixels of a row say about their candidates.

use crate::simd::{Kernel, LANES, Lanes};

use super::super::candidates::DeltaGate;
use super::super::grid::{bits_from, words};
use super::super::search::Lists;
use super::changed::Changed;
use super::continuity::{Axis, Continuity, FAR, Way, are_periods};
use super::decision::{Proposal, Tally, VoteRule};
use super::decisions::Decisions;
use super::support::NEAR;
use super::tallies::{Counting, Tallies};

/// Which walks are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Directions {
    /// Along the epipolar direction.
    Along,
    /// Along and across it.
    AlongAndAcross,
}

/// Who is asked, and how answers are weighed. Planes are those of the image, or of one of its rows if walks lead along rows alone.
#[derive(Clone, Copy)]
pub(super) struct Question<'a> {
    /// Phase of C1, turns · 65536.
    pub(super) phase: &'a [u16],
    /// Axes of the walks that are taken, and where the phase runs on along each.
    pub(super) axes: &'a [Axis],
    pub(super) ways: &'a [Way<'a>],
    pub(super) decisions: Decisions<'a>,
    /// A bit a place: pixels with several candidates.
    pub(super) several: &'a [u32],
    pub(super) rule: VoteRule,
    /// Difference of δ that is tolerated, turns · 65536.
    pub(super) tolerance: i32,
}

/// Asks the neighbours of the open pixels of a row, of those that may have heard something new.
pub(super) struct Ask<'a> {
    pub(super) question: Question<'a>,
    /// The block before the first of the row, in the planes of the question and in those that follow.
    pub(super) first: usize,
    /// A bit a place.
    pub(super) open: &'a [u32],
    pub(super) changed: Changed<'a>,
    /// Of each block of the row, how many pixels before it have several candidates.
    pub(super) before: &'a [u16],
    /// Candidates of those, and which of them they are decided for.
    pub(super) lists: &'a mut Lists,
    pub(super) ballots: &'a mut Ballots,
    /// A bit a place of the row: those that are decided.
    pub(super) decided: &'a mut [u32],
}

impl Kernel for Ask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { question, first, open, changed, before, lists, ballots, decided } = self;
        let mut b = 1;
        while b + 1 < decided.len() {
            let block = first + b;
            let mut asked = open[block];
            if asked != 0 {
                asked &= changed.around(block, question.axes, FAR);
            }
            decided[b] = 0;
            if asked != 0 {
                let of_several = Several { bits: question.several[block], before: usize::from(before[b]) };
                let (ballot, is_open) = ballots.of_block(b);
                if is_open {
                    // What was heard before still holds; only what has changed since is new.
                    question.hear(lanes, block, changed.bits, ballot);
                } else {
                    question.open(lanes, block, open[block], ballot);
                    question.hear(lanes, block, question.decisions.decided, ballot);
                }
                decided[b] = question.decide(lanes, block, asked, of_several, lists, ballot);
            }
            b += 1;
        }
    }
}

/// The pixels of a block that have several candidates.
#[derive(Clone, Copy)]
struct Several {
    /// A bit each.
    bits: u32,
    /// How many there are before the block in its row.
    before: usize,
}

impl Several {
    /// Number of a pixel among those of the row.
    #[inline(always)]
    fn number(self, k: u32) -> usize {
        self.before + (self.bits & ((1 << k) - 1)).count_ones() as usize
    }
}

/// What is said about the pixels of a row, block by block.
#[derive(Clone, Debug, Default)]
pub(super) struct Ballots {
    blocks: Vec<Ballot>,
    /// The number of this row; a block whose ballot is of another has none.
    row: u64,
}

impl Ballots {
    /// Begins anew, with a row of so many blocks.
    pub(super) fn begin(&mut self, blocks: usize) {
        self.blocks.resize(blocks.max(self.blocks.len()), Ballot::default());
        self.row += 1;
    }

    /// The ballot of a block, and whether it has been opened.
    #[inline(always)]
    fn of_block(&mut self, b: usize) -> (&mut Ballot, bool) {
        let ballot = &mut self.blocks[b];
        let row = std::mem::replace(&mut ballot.row, self.row);
        (ballot, row == self.row)
    }
}

/// What is said about the pixels of a block.
#[derive(Clone, Debug)]
struct Ballot {
    row: u64,
    /// For each axis, and each side of it, the pixels whose walks are so many steps long and longer.
    reach: [[[u32; FAR as usize]; 2]; 2],
    /// The pixels that have met decided ones, the order that the first of these said, and the pixels to which others said
    /// another.
    met: u32,
    order: [u16; LANES],
    differ: u32,
    /// All decided pixels that each pixel has met.
    all: Tallies,
    /// Room for the candidates of those that have heard different things.
    choices: Vec<Choice>,
}

impl Default for Ballot {
    fn default() -> Self {
        let (reach, order) = ([[[0; FAR as usize]; 2]; 2], [0; LANES]);
        Self { row: 0, reach, met: 0, order, differ: 0, all: Tallies::NONE, choices: Vec::new() }
    }
}

/// One candidate of each pixel of a block, and what was said for it.
#[derive(Clone, Debug)]
struct Choice {
    /// The pixels that have it.
    of: u32,
    number: [u8; LANES],
    order: [u16; LANES],
    delta: [u16; LANES],
    /// Those who say the same.
    tallies: Tallies,
}

impl Choice {
    const NONE: Self = {
        let zero = [0; LANES];
        Self { of: 0, number: [0; LANES], order: zero, delta: zero, tallies: Tallies::NONE }
    };

    /// The candidate of a lane, with what was said for it.
    #[inline(always)]
    fn proposal(&self, lane: usize) -> Proposal {
        Proposal { k: self.number[lane], delta: self.delta[lane] as i16, tally: self.tallies.of(lane) }
    }
}

impl Question<'_> {
    /// Writes down how far the walks of some pixels of a block lead.
    #[inline(always)]
    fn open<L: Lanes>(&self, lanes: L, block: usize, open: u32, ballot: &mut Ballot) {
        let mut axis = 0;
        while axis < self.ways.len() {
            let way = &self.ways[axis];
            ballot.reach[axis] =
                [self.reach(lanes, way, block, open, false), self.reach(lanes, way, block, open, true)];
            axis += 1;
        }
        (ballot.met, ballot.differ, ballot.all) = (0, 0, Tallies::NONE);
    }

    /// The pixels whose walks to one side are so many steps long and longer.
    #[inline(always)]
    fn reach<L: Lanes>(&self, lanes: L, way: &Way<'_>, block: usize, of: u32, forwards: bool) -> [u32; FAR as usize] {
        let here = block * LANES;
        let phase = lanes.load(words(self.phase, here));
        let here_turns = lanes.load(words(way.turns, here));
        let mut reach = [0; FAR as usize];
        let (mut alive, mut step) = (of, 1);
        while step <= FAR as usize {
            let distance = step * way.stride;
            let place = if forwards { here + distance } else { here - distance };
            // A step is told by the first of its two pixels.
            let before = if forwards { place - way.stride } else { place + way.stride };
            alive &= bits_from(way.runs_on, if forwards { before } else { place });
            if step > 1 {
                alive &= bits_from(way.passes, before);
            }
            if alive == 0 {
                break;
            }
            // Two of the largest steps are less than a period.
            if step > 2 {
                let turns = lanes.sub(lanes.load(words(way.turns, place)), here_turns);
                alive &= !are_periods(lanes, phase, lanes.load(words(self.phase, place)), turns);
            }
            reach[step - 1] = alive;
            step += 1;
        }
        reach
    }

    /// Of a walk to one side of an axis, so many steps on: the place that the first lane of a block comes to.
    #[inline(always)]
    fn place(&self, block: usize, axis: usize, side: usize, step: usize) -> usize {
        let distance = step * self.ways[axis].stride;
        if side == 1 { block * LANES + distance } else { block * LANES - distance }
    }

    /// Adds what some decided pixels, a bit a place, say about those of a block.
    #[inline(always)]
    fn hear<L: Lanes>(&self, lanes: L, block: usize, who: &[u32], ballot: &mut Ballot) {
        let (mut met, mut differ, mut order) = (ballot.met, ballot.differ, lanes.load(&ballot.order));
        let mut all = Counting::from(lanes, &ballot.all);
        let mut axis = 0;
        while axis < self.ways.len() {
            let way = &self.ways[axis];
            let here_turns = lanes.load(words(way.turns, block * LANES));
            let mut side = 0;
            while side < 2 {
                let mut step = 1;
                while step <= FAR as usize && ballot.reach[axis][side][step - 1] != 0 {
                    let place = self.place(block, axis, side, step);
                    let voters = ballot.reach[axis][side][step - 1] & bits_from(who, place);
                    step += 1;
                    if voters == 0 {
                        continue;
                    }
                    let turns = lanes.sub(lanes.load(words(way.turns, place)), here_turns);
                    let said = lanes.sub(lanes.load(words(self.decisions.order, place)), turns);
                    order = lanes.select(lanes.mask(voters & !met), said, order);
                    met |= voters;
                    differ |= voters & !lanes.bits(lanes.is_equal(said, order));
                    all.add(lanes.mask(voters), lanes.load(words(self.decisions.delta, place)));
                }
                side += 1;
            }
            axis += 1;
        }
        (ballot.met, ballot.differ) = (met, differ);
        lanes.store(order, &mut ballot.order);
        all.store(&mut ballot.all);
    }

    /// Those of some pixels of a block that are decided; writes down for which of their candidates.
    #[inline(always)]
    fn decide<L: Lanes>(
        &self,
        lanes: L,
        block: usize,
        asked: u32,
        of_several: Several,
        lists: &mut Lists,
        ballot: &mut Ballot,
    ) -> u32 {
        let total = lanes.load(&ballot.all.votes);
        let mut enough = asked & lanes.bits(lanes.is_at_least(total, lanes.word(self.rule.min_votes as i16)));
        let torn = enough & ballot.differ;
        let mut used = 0;
        if torn != 0 {
            used = self.propose(lanes, block, torn, of_several, lists, &mut ballot.choices);
            self.count(lanes, block, used, ballot);
        }
        let mut decided = 0;
        while enough != 0 {
            let k = enough.trailing_zeros();
            enough &= enough - 1;
            let best = if torn >> k & 1 == 1 {
                self.choose_of_torn(&ballot.choices[..used], k, ballot.all.votes[k as usize])
            } else {
                self.choose_of_one(block, k, of_several, lists, ballot)
            };
            if let Some(best) = best {
                decided |= 1 << k;
                if of_several.bits >> k & 1 == 1 {
                    lists.decided_for[of_several.number(k)] = best.k;
                }
            }
        }
        decided
    }

    /// The candidate of a pixel that heard of one order.
    #[inline(always)]
    fn choose_of_one(
        &self,
        block: usize,
        k: u32,
        of_several: Several,
        lists: &Lists,
        ballot: &Ballot,
    ) -> Option<Proposal> {
        let lane = k as usize;
        let all = ballot.all.of(lane);
        let proposal = |(k, order, delta): (u8, i16, i16)| {
            let tally = if order == ballot.order[lane] as i16 { all } else { Tally::default() };
            Proposal { k, delta, tally }
        };
        let total = all.votes;
        if of_several.bits >> k & 1 == 1 {
            let candidates = lists.eligible(of_several.number(k)).map(|(k, c)| proposal((k, c.order, c.delta)));
            self.rule.choose(candidates, total, self.tolerance)
        } else {
            let place = block * LANES + lane;
            let candidate = proposal((0, self.decisions.order[place], self.decisions.delta[place]));
            self.rule.choose(std::iter::once(candidate), total, self.tolerance)
        }
    }

    /// The candidate of a pixel that heard of several orders.
    #[inline(always)]
    fn choose_of_torn(&self, choices: &[Choice], k: u32, total: u16) -> Option<Proposal> {
        let proposals = choices.iter().filter(|choice| choice.of >> k & 1 == 1);
        self.rule.choose(proposals.map(|choice| choice.proposal(k as usize)), total, self.tolerance)
    }

    /// Writes down the candidates of some pixels of a block that were not contradicted; yields how many the pixel with the most
    /// has.
    #[inline(always)]
    fn propose<L: Lanes>(
        &self,
        lanes: L,
        block: usize,
        of: u32,
        of_several: Several,
        lists: &Lists,
        choices: &mut Vec<Choice>,
    ) -> usize {
        if choices.is_empty() {
            choices.push(Choice::NONE);
        }
        choices[0] = Choice::NONE;
        choices[0].of = of & !of_several.bits;
        lanes.store(lanes.load(words(self.decisions.order, block * LANES)), &mut choices[0].order);
        lanes.store(lanes.load(words(self.decisions.delta, block * LANES)), &mut choices[0].delta);
        let (mut used, mut rest) = (1, of & of_several.bits);
        while rest != 0 {
            let k = rest.trailing_zeros();
            rest &= rest - 1;
            for (c, (of_list, candidate)) in lists.eligible(of_several.number(k)).enumerate() {
                if c == used {
                    used += 1;
                    if c == choices.len() {
                        choices.push(Choice::NONE);
                    }
                    choices[c] = Choice::NONE;
                }
                let choice = &mut choices[c];
                choice.of |= 1 << k;
                choice.number[k as usize] = of_list;
                choice.order[k as usize] = candidate.order as u16;
                choice.delta[k as usize] = candidate.delta as u16;
            }
        }
        used
    }

    /// Counts what all decided pixels that are met say for each of so many candidates.
    #[inline(always)]
    fn count<L: Lanes>(&self, lanes: L, block: usize, used: usize, ballot: &mut Ballot) {
        let Ballot { reach, choices, .. } = ballot;
        let mut c = 0;
        while c < used {
            let choice = &mut choices[c];
            c += 1;
            let mut tallies = Counting::new(lanes);
            let mut axis = 0;
            while axis < self.ways.len() {
                let way = &self.ways[axis];
                // Along the axis the order less the turns skipped stays the same.
                let here_turns = lanes.load(words(way.turns, block * LANES));
                let wanted = lanes.sub(lanes.load(&choice.order), here_turns);
                let mut step = 0;
                while step < 2 * FAR as usize {
                    let (side, steps) = (step / FAR as usize, step % FAR as usize + 1);
                    step += 1;
                    let reached = reach[axis][side][steps - 1] & choice.of;
                    if reached == 0 {
                        continue;
                    }
                    let place = self.place(block, axis, side, steps);
                    let voters = reached & bits_from(self.decisions.decided, place);
                    let said =
                        lanes.sub(lanes.load(words(self.decisions.order, place)), lanes.load(words(way.turns, place)));
                    let agree = lanes.bits(lanes.is_equal(said, wanted)) & voters;
                    if agree == 0 {
                        continue;
                    }
                    tallies.add(lanes.mask(agree), lanes.load(words(self.decisions.delta, place)));
                }
                axis += 1;
            }
            tallies.store(&mut choice.tallies);
        }
    }
}

/// On how many of its four sides a decided place has decided ones near that say the same, with a δ that passes the test.
pub(super) fn sides(continuity: &Continuity, decisions: Decisions<'_>, place: usize, gate: &DeltaGate) -> usize {
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
    use rayon::prelude::*;

    use crate::simd::{self, Level};

    use super::super::super::candidates::Candidate;
    use super::super::super::grid::bit;
    use super::super::test_scene::TestScene;
    use super::*;

    /// What a pixel is decided for, by walks.
    fn choice(
        continuity: &Continuity,
        question: &Question<'_>,
        place: usize,
        eligible: impl Iterator<Item = (u8, Candidate)>,
    ) -> Option<u8> {
        let tally = Tally::default();
        let mut proposals: Vec<(i16, Proposal)> =
            eligible.map(|(k, c)| (c.order, Proposal { k, delta: c.delta, tally })).collect();
        let mut total = 0;
        for &axis in question.axes {
            for forwards in [false, true] {
                continuity.walk(place, axis, forwards, FAR as usize, |next, turns| {
                    if question.decisions.is_decided(next) {
                        total += 1;
                        let proposed = question.decisions.order[next].wrapping_sub(turns);
                        for (_, proposal) in proposals.iter_mut().filter(|(order, _)| *order == proposed) {
                            proposal.tally.votes += 1;
                            proposal.tally.delta_sum += i32::from(question.decisions.delta[next]);
                        }
                    }
                });
            }
        }
        question.rule.choose(proposals.into_iter().map(|(_, p)| p), total, question.tolerance).map(|best| best.k)
    }

    #[test]
    fn open_pixels_are_asked_as_walks_say() {
        let mut scene = TestScene::new(150, 60);
        let grid = scene.continuity.grid;
        let open_places: Vec<usize> = scene.places(&scene.decided, false);
        let mut open = vec![0; grid.all_blocks()];
        let any = scene.candidates.any.clone();
        let open_places: Vec<usize> = open_places.into_iter().filter(|&place| bit(&any, place)).collect();
        open_places.iter().for_each(|&place| open[place / LANES] |= 1 << (place % LANES));
        // Every ninth has lost its second candidate.
        scene.candidates.rows().enumerate().for_each(|(v, row)| {
            let ninth =
                open_places.iter().filter(|place| place.is_multiple_of(9)).map(|&place| grid.column_and_row(place));
            for u in ninth.filter(|[_, of_row]| *of_row == v).map(|[u, _]| u) {
                if row.several[u / LANES + 1] >> (u % LANES) & 1 == 1 {
                    let number = row.number(u);
                    row.lists.decided_for[number] = 1;
                    assert!(row.lists.exclude(number));
                }
            }
        });
        let everywhere = vec![u32::MAX; grid.all_blocks()];
        for axes in [&[Axis::Row][..], &[Axis::Column], &[Axis::Row, Axis::Column]] {
            for (rule, tolerance) in [(VoteRule::strict(3), 150), (VoteRule::LENIENT, 65536)] {
                let (continuity, candidates) = (&scene.continuity, &scene.candidates);
                let (decisions, several) = (scene.decisions(), candidates.several.as_slice());
                let ways: Vec<_> = axes.iter().map(|&axis| continuity.along(axis).everywhere()).collect();
                let (phase, ways) = (&*continuity.phase, ways.as_slice());
                let question = Question { phase, axes, ways, decisions, several, rule, tolerance };
                let eligible = |place: usize| {
                    let left =
                        move |(k, _): &(u8, Candidate)| !place.is_multiple_of(9) || !bit(several, place) || *k != 1;
                    (0..).zip(candidates.of(grid.pixel(place)).to_vec()).filter(left)
                };
                let expected: Vec<(usize, u8)> = open_places
                    .iter()
                    .filter_map(|&place| Some((place, choice(continuity, &question, place, eligible(place))?)))
                    .collect();
                assert!(expected.len() > 100, "{}", expected.len());
                for level in Level::ALL {
                    let (mut lists, mut ballots) = (candidates.lists.clone(), Ballots::default());
                    let mut decided = vec![0; grid.all_blocks()];
                    for (v, lists) in lists.iter_mut().enumerate() {
                        let first = grid.blocks_of_row(v).start - 1;
                        let row = first..first + grid.blocks;
                        ballots.begin(grid.blocks);
                        let ask = Ask {
                            question,
                            first,
                            open: &open,
                            changed: Changed { grid, bits: &everywhere },
                            before: &candidates.before[row.clone()],
                            lists,
                            ballots: &mut ballots,
                            decided: &mut decided[row],
                        };
                        simd::run(level, ask);
                    }
                    let chosen = |place: usize| {
                        let block = place / LANES;
                        let below = several[block] & ((1 << (place % LANES)) - 1);
                        let number = usize::from(candidates.before[block]) + below.count_ones() as usize;
                        let [_, v] = grid.column_and_row(place);
                        if bit(several, place) { lists[v].decided_for[number] } else { 0 }
                    };
                    let decided: Vec<(usize, u8)> =
                        scene.places(&decided, true).into_iter().map(|place| (place, chosen(place))).collect();
                    assert_eq!(decided, expected, "{level:?} {axes:?}");
                }
            }
        }
    }
}
