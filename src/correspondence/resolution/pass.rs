//! One pass of the paper's method: candidates within one threshold, and the decisions about them.

use crate::phase::PhaseMap;
use crate::simd::{self, Kernel, LANES, Lanes, Level};

use super::super::candidates::DeltaGate;
use super::super::chosen::ChosenCandidates;
use super::super::delta_statistics::{DeltaStatistics, mean_and_sd_of_sums_rad};
use super::super::epipolar_image::EpipolarImage;
use super::super::grid::words;
use super::super::outcome::Outcome;
use super::super::search::{Search, SearchForm};
use super::super::segment_table::SegmentTable;
use super::{ResolutionSettings, Room};

/// Factor on thr within which a candidate may still be decided by its neighbours (5·sd in all).
const READMISSION: f32 = 1.67;
/// Least such bound, turns (0.19 rad): at edges, where a pixel mixes surfaces, δ errs by more than the noise of the rest.
const MIN_READMISSION_TURNS: f32 = 0.03;

/// Decisions about all pixels of C1, row by row; vectors are filled anew.
pub(in super::super) struct Verdict<'a> {
    pub(in super::super) outcomes: &'a mut Vec<Outcome>,
    pub(in super::super) chosen: &'a mut ChosenCandidates,
    /// Candidates of each pixel that pass the back-projection test proper.
    pub(in super::super) passing: &'a mut Vec<u8>,
}

/// What came of a pass.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Pass {
    /// Pixels with a correspondence.
    pub(in super::super) found: usize,
    /// Pixels with candidates.
    pub(in super::super) with_candidates: usize,
    /// Mean and sd of δ of the correspondences, rad.
    pub(in super::super) delta_rad: (f64, f64),
}

impl Room {
    /// Finds and decides candidates with the threshold of `delta`.
    pub(in super::super) fn pass(
        &mut self,
        (cam1, cam2): (&PhaseMap, &EpipolarImage),
        table: &SegmentTable,
        delta: &DeltaStatistics,
        settings: &ResolutionSettings,
        verdict: &mut Verdict<'_>,
    ) -> Pass {
        let gate = delta.gate();
        let threshold_turns = (READMISSION * gate.threshold_turns).max(MIN_READMISSION_TURNS);
        let readmission = DeltaGate { threshold_turns, ..gate };
        std::mem::swap(&mut self.candidates.chosen, verdict.chosen);
        let search = Search { cam1, cam2, table, gate: &readmission, asks_elsewhere: true };
        search.all(SearchForm::ProjectorSide, &mut self.candidates);
        let evidence = delta.evidence(cam1, &gate, &readmission, table);
        self.resolve(evidence, settings, verdict.outcomes, verdict.passing);
        std::mem::swap(&mut self.candidates.chosen, verdict.chosen);
        let count = |bits: &[u32]| bits.iter().map(|bits| bits.count_ones() as usize).sum();
        let found: usize = count(&self.decided);
        let [sum, squares] = simd::run(Level::in_use(), Sums { delta: &self.candidates.delta, of: &self.decided });
        Pass {
            found,
            with_candidates: count(&self.candidates.any),
            delta_rad: mean_and_sd_of_sums_rad(found as u32, sum, squares),
        }
    }
}

/// Sums δ and its square over some places.
struct Sums<'a> {
    delta: &'a [i16],
    /// A bit a place.
    of: &'a [u32],
}

impl Kernel for Sums<'_> {
    type Output = [i64; 2];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> [i64; 2] {
        let zero = lanes.word(0);
        let mut sums = [0; 2];
        let mut block = 0;
        while block < self.of.len() {
            if self.of[block] != 0 {
                let mut delta = [0; LANES];
                let of_block = lanes.load(words(self.delta, block * LANES));
                lanes.store(lanes.select(lanes.mask(self.of[block]), of_block, zero), &mut delta);
                // 32 squares are more than a long holds, 32 halves of them are not.
                let (mut sum, mut low, mut high) = (0_i32, 0_u32, 0_u32);
                let mut k = 0;
                while k < LANES {
                    let delta = i32::from(delta[k] as i16);
                    let square = (delta * delta) as u32;
                    sum += delta;
                    low += square & 0xffff;
                    high += square >> 16;
                    k += 1;
                }
                sums[0] += i64::from(sum);
                sums[1] += (i64::from(high) << 16) + i64::from(low);
            }
            block += 1;
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_numbers_one_by_one() {
        let delta: Vec<i16> = (0..5 * LANES as i32).map(|i| (i * 12347) as i16).chain([i16::MIN; LANES]).collect();
        let of = [0x8000_0001, 0, u32::MAX, 0x00f0_1234, 7, u32::MAX];
        let of_places = (0..delta.len()).filter(|place| of[place / LANES] >> (place % LANES) & 1 == 1);
        let expected = of_places.fold([0; 2], |[sum, squares], place| {
            let delta = i64::from(delta[place]);
            [sum + delta, squares + delta * delta]
        });
        for level in Level::ALL {
            assert_eq!(simd::run(level, Sums { delta: &delta, of: &of }), expected);
        }
    }
}
