//! Whether the decided pixels beside a pixel support what it was decided for (paper, Eq. 2).
//!
//! A decided pixel k that a walk from p meets after a phase rise s says: if p and k lie on one surface, then the absolute
//! phases are u_p = u_k − s. That is Eq. (2) with both inequalities in one: k comes before p in C1 and c(k) before q in C2,
//! by the same phase, less than 2π. In whole numbers it holds exactly or not at all.
//!
//! In: phase of C1, absolute phase and δ of the decided pixels. Out: which of them are supported. For every pixel p:
//!
//! ```text
//! for each of four sides: walk from p up to three steps, as long as the phase runs on without a jump
//!     for each decided k that is met: total += 1; if u_k − s = u_p: votes += 1, sum += δ_k
//! supported(p) = |sum / votes − δ_p| <= tolerance  and  votes >= min_votes  and  votes >= total − votes
//! ```

use rayon::prelude::*;

use crate::phase::PhaseMap;
use crate::simd::{self, Kernel, Lanes, Level};

use super::neighbourhood::{ABSENT, MAX_STEP, MAX_STEP_CHANGE, TURN};
use super::pool::Pool;

/// Steps of a walk.
pub(super) const NEAR: usize = 3;

/// What decided pixels must say.
#[derive(Clone, Copy, Debug)]
pub(super) struct SupportRule {
    /// Decided pixels that must say the same.
    pub(super) min_votes: u16,
    /// Difference of δ that is tolerated between a pixel and those who support it, turns · 65536.
    pub(super) tolerance: i32,
}

/// Which decided pixels are supported.
#[derive(Clone, Debug, Default)]
pub(super) struct Support {
    /// False for all that are not decided.
    pub(super) is_supported: Vec<bool>,
    rooms: Pool<RowRoom>,
    /// A row of pixels without phase.
    nothing: OwnRow,
}

impl Support {
    /// Finds them, from the absolute phases of all pixels, [`ABSENT`] where they are not decided, and their δ.
    pub(super) fn find(&mut self, cam1: &PhaseMap, absolute: &[i32], delta: &[i16], rule: SupportRule) {
        let Self { is_supported, rooms, nothing } = self;
        let (width, height) = (cam1.width.max(1), cam1.height);
        nothing.resize(width);
        let nothing = nothing.line(0);
        let line = |v: usize| {
            let pixels = v * width..(v + 1) * width;
            let (phase, valid) = (&cam1.phase[pixels.clone()], &cam1.valid[pixels.clone()]);
            Line { phase, valid, absolute: &absolute[pixels.clone()], delta: &delta[pixels] }
        };
        is_supported.resize(width * height, false);
        is_supported.par_chunks_mut(width).enumerate().for_each_init(
            || rooms.take(),
            |room, (v, is_supported)| {
                let RowRoom { own, votes } = &mut **room;
                let here = line(v);
                own.copy(here);
                votes.begin(width);
                let above = |step: usize| v.checked_sub(step).map_or(nothing, line);
                let below = |step: usize| if v + step < height { line(v + step) } else { nothing };
                let walks = [
                    [1, 2, 3].map(|step| own.line(NEAR - step)),
                    [1, 2, 3].map(|step| own.line(NEAR + step)),
                    [1, 2, 3].map(above),
                    [1, 2, 3].map(below),
                ];
                simd::run(Level::in_use(), SupportOfRow { here, walks, votes, rule, is_supported });
            },
        );
    }
}

/// A row of pixels, or the pixels so many steps from each of its pixels.
#[derive(Clone, Copy)]
struct Line<'a> {
    phase: &'a [u16],
    valid: &'a [bool],
    absolute: &'a [i32],
    delta: &'a [i16],
}

/// A row with [`NEAR`] pixels without phase on either side.
#[derive(Clone, Debug, Default)]
struct OwnRow {
    width: usize,
    phase: Vec<u16>,
    valid: Vec<bool>,
    absolute: Vec<i32>,
    delta: Vec<i16>,
}

impl OwnRow {
    fn resize(&mut self, width: usize) {
        let places = width + 2 * NEAR;
        if self.width != width {
            let (phase, delta) = (vec![0; places], vec![0; places]);
            *self = Self { width, phase, valid: vec![false; places], absolute: vec![ABSENT; places], delta };
        }
    }

    fn copy(&mut self, row: Line<'_>) {
        let width = row.phase.len();
        self.resize(width);
        self.phase[NEAR..][..width].copy_from_slice(row.phase);
        self.valid[NEAR..][..width].copy_from_slice(row.valid);
        self.absolute[NEAR..][..width].copy_from_slice(row.absolute);
        self.delta[NEAR..][..width].copy_from_slice(row.delta);
    }

    /// The line that begins with a place.
    fn line(&self, first: usize) -> Line<'_> {
        let places = first..first + self.width;
        let (phase, valid) = (&self.phase[places.clone()], &self.valid[places.clone()]);
        Line { phase, valid, absolute: &self.absolute[places.clone()], delta: &self.delta[places] }
    }
}

/// Room for a row.
#[derive(Debug, Default)]
struct RowRoom {
    own: OwnRow,
    votes: Votes,
}

/// What was said about each pixel of a row: by how many, how many of them said what it was decided for, and their δ.
#[derive(Debug, Default)]
struct Votes {
    total: Vec<i32>,
    same: Vec<i32>,
    delta_sum: Vec<i32>,
}

impl Votes {
    fn begin(&mut self, width: usize) {
        for sums in [&mut self.total, &mut self.same, &mut self.delta_sum] {
            sums.clear();
            sums.resize(width, 0);
        }
    }
}

/// Finds the supported pixels of a row; each walk is the lines that its steps lead to.
struct SupportOfRow<'a> {
    here: Line<'a>,
    walks: [[Line<'a>; NEAR]; 4],
    votes: &'a mut Votes,
    rule: SupportRule,
    is_supported: &'a mut [bool],
}

impl Kernel for SupportOfRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { here, walks, votes, rule, is_supported } = self;
        for walk in &walks {
            hear(here, walk, votes);
        }
        let width = is_supported.len();
        let (total, same, delta_sum) = (&votes.total[..width], &votes.same[..width], &votes.delta_sum[..width]);
        let (absolute, delta) = (&here.absolute[..width], &here.delta[..width]);
        for u in 0..width {
            let off = delta_sum[u] - i32::from(delta[u]) * same[u];
            let agrees = (absolute[u] != ABSENT) & (off.abs() <= rule.tolerance * same[u]);
            is_supported[u] = agrees & (same[u] >= i32::from(rule.min_votes)) & (2 * same[u] >= total[u]);
        }
    }
}

/// Adds what the decided pixels of a walk say about each pixel.
#[inline(always)]
fn hear(here: Line<'_>, [one, two, three]: &[Line<'_>; NEAR], votes: &mut Votes) {
    let width = here.phase.len();
    let (total, same, delta_sum) = (&mut votes.total[..width], &mut votes.same[..width], &mut votes.delta_sum[..width]);
    let phases = [here, *one, *two, *three].map(|line| &line.phase[..width]);
    let valids = [here, *one, *two, *three].map(|line| &line.valid[..width]);
    let absolutes = [here, *one, *two, *three].map(|line| &line.absolute[..width]);
    let deltas = [*one, *two, *three].map(|line| &line.delta[..width]);
    for u in 0..width {
        let mut goes_on = valids[0][u];
        let (mut rise, mut last) = (0, 0);
        for k in 0..NEAR {
            let step = phases[k + 1][u].wrapping_sub(phases[k][u]) as i16;
            rise += i32::from(step);
            goes_on &= valids[k + 1][u] & (step.unsigned_abs() <= MAX_STEP as u16);
            // Two of the largest steps are less than a period.
            goes_on &= match k {
                0 => true,
                1 => step.wrapping_sub(last).unsigned_abs() <= MAX_STEP_CHANGE as u16,
                _ => (step.wrapping_sub(last).unsigned_abs() <= MAX_STEP_CHANGE as u16) & (rise.abs() < TURN),
            };
            last = step;
            let speaks = goes_on & (absolutes[k + 1][u] != ABSENT);
            let agrees = speaks & (absolutes[k + 1][u].wrapping_sub(rise) == absolutes[0][u]);
            total[u] += i32::from(speaks);
            same[u] += i32::from(agrees);
            delta_sum[u] += if agrees { i32::from(deltas[k][u]) } else { 0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::reference_methods::paper::{Side, walk};
    use super::*;

    /// Patches of slopes of all kinds with holes, two of three pixels decided, a tenth of those for a wrong order.
    fn scene(width: usize, height: usize) -> (PhaseMap, Vec<i32>, Vec<i16>) {
        let mut state = 11_u64;
        let mut random = move |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        // Steep patches have walks of a period within three steps.
        let slopes: Vec<[i32; 2]> =
            (0..100).map(|_| [random(48_000) as i32 - 24_000, random(12_000) as i32 - 6000]).collect();
        let (mut map, mut absolute) = (PhaseMap { width, height, ..PhaseMap::default() }, Vec::new());
        for (u, v) in (0..height).flat_map(|v| (0..width).map(move |u| (u, v))) {
            let [along, across] = slopes[u / 23 % 10 * 10 + v / 17 % 10];
            let right = along * (u % 23) as i32 + across * (v % 17) as i32 + random(300) as i32;
            let valid = random(40) > 0;
            map.phase.push(right as u16);
            map.valid.push(valid);
            let decided = if random(10) > 0 { right } else { right + TURN };
            absolute.push(if valid && random(3) > 0 { decided } else { ABSENT });
        }
        let delta = (0..width * height).map(|_| random(600) as i16 - 300).collect();
        (map, absolute, delta)
    }

    /// Whether a pixel is supported, by walks one by one.
    fn is_supported(map: &PhaseMap, absolute: &[i32], delta: &[i16], rule: SupportRule, pixel: usize) -> bool {
        let (mut total, mut votes, mut delta_sum) = (0, 0, 0);
        for side in Side::ALL {
            walk(map, pixel, side, NEAR, |met, rise| {
                if absolute[met] != ABSENT {
                    total += 1;
                    let same = absolute[met] - rise == absolute[pixel];
                    votes += i32::from(same);
                    delta_sum += if same { i32::from(delta[met]) } else { 0 };
                }
            });
        }
        let agree = (delta_sum - i32::from(delta[pixel]) * votes).abs() <= rule.tolerance * votes;
        absolute[pixel] != ABSENT && agree && votes >= i32::from(rule.min_votes) && votes >= total - votes
    }

    #[test]
    fn rows_are_supported_as_walks_say() {
        let mut support = Support::default();
        for [width, height] in [[150, 60], [5, 2], [1, 1]] {
            let (map, absolute, delta) = scene(width, height);
            for (min_votes, tolerance) in [(1, 40), (3, 100), (3, TURN), (6, 200)] {
                let rule = SupportRule { min_votes, tolerance };
                let expected: Vec<bool> =
                    (0..width * height).map(|pixel| is_supported(&map, &absolute, &delta, rule, pixel)).collect();
                for level in Level::ALL {
                    level.limit_to();
                    support.find(&map, &absolute, &delta, rule);
                    assert_eq!(support.is_supported, expected, "{level:?} {rule:?}");
                }
                let supported = expected.iter().filter(|is| **is).count();
                assert!(width < 100 || (300..5000).contains(&supported), "{supported} of {rule:?}");
            }
        }
    }

    #[test]
    fn others_must_agree_in_phase_and_delta() {
        let width = 7;
        let map = PhaseMap {
            width,
            height: 1,
            phase: (0..width as u16).map(|u| u.wrapping_mul(9000)).collect(),
            valid: vec![true; width],
            ..PhaseMap::default()
        };
        let absolute: Vec<i32> = (0..width as i32).map(|u| 9000 * u).collect();
        let supported = |absolute: &[i32], delta: &[i16]| {
            let mut support = Support::default();
            support.find(&map, absolute, delta, SupportRule { min_votes: 3, tolerance: 50 });
            support.is_supported
        };
        assert_eq!(supported(&absolute, &[0; 7]), [true; 7]);
        let mut off = [0; 7];
        off[3] = 51;
        assert!(!supported(&absolute, &off)[3]);
        let mut of_another_order = absolute.clone();
        of_another_order[3] += TURN;
        assert!(!supported(&of_another_order, &[0; 7])[3]);
        let mut few = absolute;
        few[4..].fill(ABSENT);
        assert_eq!(supported(&few, &[0; 7]), [true, true, true, true, false, false, false]);
        few[3] = ABSENT;
        assert_eq!(supported(&few, &[0; 7]), [false; 7]);
    }
}
