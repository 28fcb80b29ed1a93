//! What the decided pixels around a pixel say about its fringe order: Eq. (2) of the paper.
//!
//! The back-projection phase makes the phase of a correspondence absolute: u = φ_p + order. Around p the wrapped phase of
//! C1 is unwrapped along straight walks, left and right along the epipolar direction and up and down across it, for less
//! than one period as Eq. (2) demands and only as long as it runs on without a jump. A decided pixel k met after a phase
//! rise s says: if p and k lie on one surface, then u_p = u_k − s. That is Eq. (2) with both inequalities in one: k comes
//! before p in C1 and c(k) before q in C2, by the same phase, less than 2π. In whole numbers it holds exactly or not at
//! all.

use crate::phase::PhaseMap;

use super::segment_table::EpipolarAxis;

/// Absolute phase of a pixel that is not decided.
pub(super) const UNDECIDED: i32 = i32::MIN;
/// One turn of phase.
pub(super) const TURN: i32 = 65536;
/// Largest phase step between neighbours of one surface; a surface seen at a grazing angle may come close to it.
pub(super) const MAX_STEP: i32 = 24576;
/// Largest change of the step from one pixel to the next on one surface (22°). Across a depth edge the wrapped phase
/// jumps by anything: three quarters of such jumps would pass [`MAX_STEP`] alone, one in eight passes this too.
pub(super) const MAX_STEP_CHANGE: i32 = 4000;
/// Different orders of one pixel that are told apart; a fifth opinion is noise.
const MAX_OPINIONS: usize = 4;

/// What the decided pixels look like from their neighbours: absolute phases, and δ beside them.
#[derive(Clone, Copy)]
pub(super) struct Decided<'a> {
    /// Absolute phase of each pixel, turns · 65536, or [`UNDECIDED`].
    pub(super) absolute: &'a [i32],
    /// δ of each decided pixel, turns · 65536.
    pub(super) delta: &'a [i16],
}

/// What decided pixels say to an absolute phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Support {
    /// How many propose it.
    votes: u16,
    /// Sum of δ of those who do.
    delta_sum: i32,
    /// How many propose anything.
    pub(super) total: u16,
}

impl Support {
    /// How many propose it, with a δ that differs from `delta` by no more than `tolerance`: over one surface δ changes
    /// slowly.
    pub(super) fn votes_with(&self, delta: i16, tolerance: i32) -> u16 {
        let votes = i32::from(self.votes);
        let off = self.delta_sum - i32::from(delta) * votes;
        if off.abs() <= tolerance.saturating_mul(votes) { self.votes } else { 0 }
    }
}

/// An absolute phase that decided pixels propose.
#[derive(Clone, Copy, Debug, Default)]
struct Proposal {
    absolute: i32,
    votes: u16,
    /// Sum of δ of those who propose it.
    delta_sum: i32,
}

/// Absolute phases proposed for a pixel and how many decided pixels propose each.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Opinions {
    proposals: [Proposal; MAX_OPINIONS],
    count: usize,
    /// All opinions, those that found no place among the proposals included.
    total: u16,
}

impl Opinions {
    fn add(&mut self, absolute: i32, delta: i16) {
        self.total += 1;
        let known = self.proposals[..self.count].iter().position(|p| p.absolute == absolute);
        let place = known.unwrap_or(self.count);
        if let Some(proposal) = self.proposals.get_mut(place) {
            self.count = self.count.max(place + 1);
            proposal.absolute = absolute;
            proposal.votes += 1;
            proposal.delta_sum += i32::from(delta);
        }
    }

    /// What they say to an absolute phase.
    pub(super) fn support(&self, absolute: i32) -> Support {
        let proposal = self.proposals[..self.count].iter().find(|p| p.absolute == absolute);
        let Proposal { votes, delta_sum, .. } = proposal.copied().unwrap_or_default();
        Support { votes, delta_sum, total: self.total }
    }
}

/// The walks around the pixels of an image.
pub(super) struct Neighbourhood<'a> {
    pub(super) map: &'a PhaseMap,
    pub(super) axis: EpipolarAxis,
}

/// How far a walk goes, pixels, if nothing ends it before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// To ask whether a decision fits its neighbours.
    Near = 3,
    /// To find decided pixels; a period is seldom longer, and one period is all that Eq. (2) uses.
    Far = 16,
}

/// Which walks are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Directions {
    /// Along the epipolar direction.
    Along,
    /// Along and across it.
    AlongAndAcross,
}

impl Neighbourhood<'_> {
    /// Collects what decided pixels around a pixel propose.
    pub(super) fn opinions(
        &self,
        pixel: usize,
        decided: Decided<'_>,
        directions: Directions,
        reach: Reach,
    ) -> Opinions {
        let mut opinions = Opinions::default();
        self.ask(pixel, decided, directions, reach, |absolute, delta| opinions.add(absolute, delta));
        opinions
    }

    /// What decided pixels near a pixel say to one absolute phase.
    pub(super) fn support(&self, pixel: usize, decided: Decided<'_>, absolute: i32) -> Support {
        let mut support = Support::default();
        self.ask(pixel, decided, Directions::AlongAndAcross, Reach::Near, |proposed, delta| {
            let same = proposed == absolute;
            support.total += 1;
            support.votes += u16::from(same);
            support.delta_sum += if same { i32::from(delta) } else { 0 };
        });
        support
    }

    /// On how many of its four sides a pixel has near decided ones that propose an absolute phase, with a δ that `counts`.
    pub(super) fn sides(
        &self,
        pixel: usize,
        decided: Decided<'_>,
        absolute: i32,
        counts: impl Fn(i16) -> bool,
    ) -> usize {
        self.walks(pixel, Directions::AlongAndAcross, Reach::Near)
            .into_iter()
            .filter(|&(stride, room)| {
                let mut has_support = false;
                self.walk(pixel, stride, room, decided, &mut |proposed, delta| {
                    has_support |= proposed == absolute && counts(delta);
                });
                has_support
            })
            .count()
    }

    /// Tells of the absolute phase that each decided pixel around a pixel proposes, and of its δ.
    #[inline]
    fn ask(
        &self,
        pixel: usize,
        decided: Decided<'_>,
        directions: Directions,
        reach: Reach,
        mut tell: impl FnMut(i32, i16),
    ) {
        for (stride, room) in self.walks(pixel, directions, reach) {
            self.walk(pixel, stride, room, decided, &mut tell);
        }
    }

    /// Stride and length of the walks to the four sides of a pixel; of length zero where none is taken.
    #[inline]
    fn walks(&self, pixel: usize, directions: Directions, reach: Reach) -> [(isize, usize); 4] {
        let (width, height) = (self.map.width, self.map.height);
        let (u, v) = (pixel % width, pixel / width);
        let taken = |axis| directions == Directions::AlongAndAcross || self.axis == axis;
        let room = |axis, pixels: usize| if taken(axis) { pixels.min(reach as usize) } else { 0 };
        let (horizontal, vertical) = (EpipolarAxis::Horizontal, EpipolarAxis::Vertical);
        [
            (1, room(horizontal, width - 1 - u)),
            (-1, room(horizontal, u)),
            (width as isize, room(vertical, height - 1 - v)),
            (-(width as isize), room(vertical, v)),
        ]
    }

    /// Walks from `here` in steps of `stride` for at most `room` steps.
    #[inline]
    fn walk(&self, here: usize, stride: isize, room: usize, decided: Decided<'_>, tell: &mut impl FnMut(i32, i16)) {
        let (mut at, mut risen, mut last_step) = (here, 0_i32, None);
        for _ in 0..room {
            let next = at.wrapping_add_signed(stride);
            let step = i32::from(self.map.phase[next].wrapping_sub(self.map.phase[at]) as i16);
            let breaks = last_step.is_some_and(|last: i32| (last - step).abs() > MAX_STEP_CHANGE);
            risen += step;
            if !self.map.valid[next] || step.abs() > MAX_STEP || breaks || risen.abs() >= TURN {
                return;
            }
            if decided.absolute[next] != UNDECIDED {
                tell(decided.absolute[next] - risen, decided.delta[next]);
            }
            (at, last_step) = (next, Some(step));
        }
    }
}

/// The four neighbours of a pixel, as far as they lie in the image.
pub(super) fn neighbours(pixel: usize, width: usize, pixels: usize) -> [Option<usize>; 4] {
    let column = pixel % width;
    [
        (column > 0).then(|| pixel - 1),
        (column + 1 < width).then(|| pixel + 1),
        (pixel >= width).then(|| pixel - width),
        (pixel + width < pixels).then(|| pixel + width),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of pixels whose phase rises by `step` a pixel, with a jump of `jump` before pixel 6.
    fn row(step: i32, jump: i32) -> PhaseMap {
        let phase = |i: i32| (i * step + if i >= 6 { jump } else { 0 }) as u16;
        PhaseMap {
            width: 12,
            height: 1,
            phase: (0..12).map(phase).collect(),
            valid: vec![true; 12],
            ..PhaseMap::default()
        }
    }

    #[test]
    fn neighbours_of_one_surface_agree_exactly_across_the_wrap() {
        let map = row(7000, 0);
        let absolute: Vec<i32> = (0..12).map(|i| 3 * TURN + i * 7000).collect();
        let around = Neighbourhood { map: &map, axis: EpipolarAxis::Horizontal };
        let decided = Decided { absolute: &absolute, delta: &[40; 12] };
        let opinions = around.opinions(5, decided, Directions::Along, Reach::Far);
        let own = 3 * TURN + 5 * 7000;
        assert_eq!(opinions.support(own).votes_with(50, 10), opinions.total);
        assert_eq!(opinions.support(own).votes_with(51, 10), 0);
        assert_eq!(opinions.support(own + TURN).votes_with(40, 10), 0);
        // Near, and without a collection of opinions.
        let near = around.opinions(5, decided, Directions::AlongAndAcross, Reach::Near);
        assert_eq!(around.support(5, decided, own), near.support(own));
        assert_eq!(around.support(5, decided, own + 1), near.support(own + 1));
        // Less than one period: nine steps of 7000 to either side, of which six and five lie in the image.
        assert_eq!(opinions.total, 11);
    }

    #[test]
    fn nobody_is_asked_beyond_a_period_or_a_jump() {
        let decided = Decided { absolute: &[0; 12], delta: &[0; 12] };
        let count = |map: &PhaseMap| {
            Neighbourhood { map, axis: EpipolarAxis::Horizontal }
                .opinions(5, decided, Directions::Along, Reach::Far)
                .total
        };
        assert_eq!(count(&row(15000, 0)), 8);
        assert_eq!(count(&row(7000, 20000)), 5);
        // A jump that hides as a moderate step is betrayed by its change of slope one pixel on.
        assert_eq!(count(&row(7000, 9000)), 6);
    }
}
