//! Evidence: how badly the best candidate of each order fits, in whole numbers.
//!
//! The energy of a candidate with z = (δ − drift)/sd is −ln(e⁻⁵ + e^(−z²/2)): that of a normal error, and no more than five
//! nats however large the error, since a candidate may be missing or spoilt. Orders without candidate have that energy. What
//! lies outside the volume was seldom meant: its candidates must fit somewhat better.

use rayon::prelude::*;

use crate::phase::Modulation;
#[cfg(target_arch = "x86_64")]
use crate::simd::Avx512;
use crate::simd::{self, Kernel, Lanes, Level};

use super::super::drift::DepthRow;
use super::super::segment::SegmentRow;
use super::outlook::Outlook;
#[cfg(target_arch = "x86_64")]
use super::wide;
use super::windows::{LANE_STEP, Windows};
use super::{Scene, UNITS_PER_NAT};

/// Energy of an order without candidate, nats.
const MISSING_NATS: f32 = 5.0;
/// The same in whole numbers.
pub(super) const MISSING: u8 = (MISSING_NATS * UNITS_PER_NAT) as u8;
/// Stands for an order that a pixel does not have.
pub(super) const NO_ORDER: u8 = u8::MAX;
/// Energy that a candidate outside the measurement volume has on top, nats.
const OUTSIDE_NATS: f32 = 0.2;
pub(super) const OUTSIDE: u8 = (OUTSIDE_NATS * UNITS_PER_NAT) as u8;
/// Largest z with an energy of its own; beyond it the candidate counts as missing.
pub(super) const MAX_Z: f32 = 5.0;
/// Steps of the table of energies, in z.
pub(super) const STEPS_PER_Z: f32 = 64.0;
/// z of the back-projection test (paper, section 2.1).
pub(super) const PASSING_Z: f32 = 3.0;
/// Share of the variance of δ that grows with noise over modulation; the rest is the same for all pixels.
const NOISE_SHARE: f32 = 0.5;
/// Largest sd of a pixel, in that of a pixel of median modulation.
const MAX_SD_RATIO: f32 = 4.0;

/// Predicted sd of δ of a true candidate about the drift.
pub(super) struct DeltaScale {
    /// At median modulation, turns.
    sd_turns: f32,
    /// Median modulation, grey levels.
    median_grey: f32,
}

impl DeltaScale {
    pub(super) fn of(scene: &Scene<'_>) -> Self {
        let cam1 = scene.cam1;
        let median_grey = median_modulation(&cam1.modulation, &cam1.valid).map_or(1.0, Modulation::grey);
        let sd_turns = (scene.drift.residual_sd_rad / std::f64::consts::TAU) as f32;
        Self { sd_turns, median_grey }
    }

    /// At a modulation, turns.
    #[inline(always)]
    fn sd_turns(&self, modulation_grey: f32) -> f32 {
        let ratio = self.median_grey / modulation_grey.max(f32::MIN_POSITIVE);
        let variance = 1.0 - NOISE_SHARE + NOISE_SHARE * ratio * ratio;
        self.sd_turns * variance.sqrt().min(MAX_SD_RATIO)
    }
}

/// Median modulation of the valid pixels.
fn median_modulation(modulation: &[Modulation], valid: &[bool]) -> Option<Modulation> {
    // The upper byte of the median first, then the lower one. Neighbours are alike, so that each counts in a row of its own:
    // none waits for the one before.
    const ROWS: usize = 4;
    let mut upper = [[0_u32; 256]; ROWS];
    for (modulation, valid) in modulation.chunks(ROWS).zip(valid.chunks(ROWS)) {
        for ((counts, modulation), &valid) in upper.iter_mut().zip(modulation).zip(valid) {
            counts[usize::from(modulation.steps() >> 8)] += u32::from(valid);
        }
    }
    let upper: [u32; 256] = std::array::from_fn(|byte| upper.iter().map(|counts| counts[byte]).sum());
    let (byte, rank) = ranked(&upper, upper.iter().sum::<u32>() / 2)?;
    let mut lower = [0_u32; 256];
    for (modulation, &valid) in modulation.iter().zip(valid) {
        let is_near = valid && usize::from(modulation.steps() >> 8) == byte;
        lower[usize::from(modulation.steps() & 0xff)] += u32::from(is_near);
    }
    ranked(&lower, rank).map(|(lower, _)| Modulation::of_steps((byte << 8 | lower) as u16))
}

/// In which place the number of a rank is counted, and its rank there.
fn ranked(counts: &[u32], rank: u32) -> Option<(usize, u32)> {
    let mut below = 0;
    let place = counts.iter().position(|count| {
        below += count;
        below > rank
    })?;
    Some((place, rank + counts[place] - below))
}

/// The sd of the pixels of a row.
struct ScaleRow<'a> {
    scale: &'a DeltaScale,
    modulation: &'a [Modulation],
    sd_turns: &'a mut [f32],
}

impl Kernel for ScaleRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        for (sd_turns, modulation) in self.sd_turns.iter_mut().zip(self.modulation) {
            *sd_turns = self.scale.sd_turns(modulation.grey());
        }
    }
}

/// What the pixels of a row of C1 look for their candidates with.
#[derive(Default)]
pub(super) struct OutlookRow {
    pub(super) segments: SegmentRow,
    drift: DepthRow,
    /// sd of δ of each pixel, turns.
    pub(super) sd_turns: Vec<f32>,
    v: usize,
}

impl OutlookRow {
    /// Turns to row `v`.
    pub(super) fn turn_to(&mut self, scene: &Scene<'_>, scale: &DeltaScale, v: usize) {
        let width = scene.cam1.width;
        self.v = v;
        scene.table.row(v, &mut self.segments);
        scene.drift.along_row(v, width, &mut self.drift);
        self.sd_turns.resize(width, 0.0);
        let modulation = &scene.cam1.modulation[v * width..(v + 1) * width];
        simd::run(Level::in_use(), ScaleRow { scale, modulation, sd_turns: &mut self.sd_turns });
    }

    /// That of a pixel of the row.
    pub(super) fn outlook<'a>(&self, scene: &Scene<'a>, windows: &Windows, u: usize) -> Outlook<'a> {
        Outlook::new(scene, windows, &self.segments, &self.drift, [u, self.v])
    }

    /// The same of many pixels.
    #[cfg(target_arch = "x86_64")]
    pub(super) fn wide<'a>(&'a self, scene: &Scene<'a>, windows: &'a Windows) -> wide::Row<'a> {
        let width = scene.cam1.width;
        wide::Row {
            image: scene.cam2,
            segments: &self.segments,
            drift: &self.drift,
            windows,
            phase: &scene.cam1.phase[self.v * width..(self.v + 1) * width],
            sd_turns: &self.sd_turns,
        }
    }
}

/// Energies of all orders of all pixels, those of pixel `i` from `i · lanes` on; and how many orders of each pass the
/// back-projection test |δ − drift| < 3·sd. Energies of a pixel without window are not written.
pub(super) fn gather(
    scene: &Scene<'_>,
    windows: &Windows,
    scale: &DeltaScale,
    evidence: &mut Vec<u8>,
    passing: &mut Vec<u8>,
) {
    let (lanes, width) = (windows.lanes, scene.cam1.width.max(1));
    let energies = Energies::new();
    evidence.resize(scene.cam1.phase.len() * lanes, NO_ORDER);
    passing.clear();
    passing.resize(scene.cam1.phase.len(), 0);
    let rows = evidence.par_chunks_mut(width * lanes).zip(passing.par_chunks_mut(width)).enumerate();
    rows.for_each_init(OutlookRow::default, |row, (v, (evidence, passing))| {
        row.turn_to(scene, scale, v);
        let pixels = v * width..(v + 1) * width;
        let (first, count) = (&windows.first[pixels.clone()], &windows.count[pixels]);
        EvidenceRow { scene, windows, row, first, count, energies: &energies, evidence, passing }.gather();
    });
}

/// The evidence of a row.
struct EvidenceRow<'a> {
    scene: &'a Scene<'a>,
    windows: &'a Windows,
    row: &'a OutlookRow,
    first: &'a [i16],
    count: &'a [u8],
    energies: &'a Energies,
    evidence: &'a mut [u8],
    passing: &'a mut [u8],
}

impl EvidenceRow<'_> {
    fn gather(&mut self) {
        #[cfg(target_arch = "x86_64")]
        let done = Avx512::in_use().map_or(0, |lanes| self.gather_blocks(lanes));
        #[cfg(not(target_arch = "x86_64"))]
        let done = 0;
        (done..self.count.len()).for_each(|u| self.gather_pixel(u));
    }

    /// Whole blocks of pixels; yields how many pixels they have.
    #[cfg(target_arch = "x86_64")]
    fn gather_blocks(&mut self, level: Avx512) -> usize {
        let lanes = self.windows.lanes;
        let row = self.row.wide(self.scene, self.windows);
        let (firsts, counts) = (self.first.as_chunks().0, self.count.as_chunks().0);
        let (mut of_block, mut room) = (row.no_block(), wide::Room::new());
        for (block, (first, count)) in firsts.iter().zip(counts).enumerate() {
            let begin = block * wide::BLOCK;
            if !row.turn(level, &mut of_block, begin, count) {
                continue;
            }
            let evidence = &mut self.evidence[begin * lanes..][..wide::BLOCK * lanes];
            let mut passing = [0; wide::BLOCK];
            for skipped in (0..lanes).step_by(LANE_STEP) {
                let tile = (&mut evidence[skipped..], lanes);
                of_block.evidence(level, skipped, first, count, self.energies, &mut room, tile, &mut passing);
            }
            self.passing[begin..begin + wide::BLOCK].copy_from_slice(&passing);
            (0..wide::BLOCK).filter(|k| of_block.irregular >> k & 1 == 1).for_each(|k| self.gather_pixel(begin + k));
        }
        counts.len() * wide::BLOCK
    }

    fn gather_pixel(&mut self, u: usize) {
        let count = usize::from(self.count[u]);
        if count == 0 {
            return;
        }
        let outlook = self.row.outlook(self.scene, self.windows, u);
        let orders = &mut self.evidence[u * self.windows.lanes..][..self.windows.lanes];
        orders.fill(NO_ORDER);
        for (lane, energy) in orders[..count].iter_mut().enumerate() {
            *energy =
                best_energy(&outlook, i32::from(self.first[u]) + lane as i32, self.row.sd_turns[u], self.energies);
        }
        self.passing[u] = orders.iter().filter(|&&energy| energy < self.energies.limit).count() as u8;
    }
}

/// Energy of the best candidate of an order.
fn best_energy(outlook: &Outlook<'_>, order: i32, sd_turns: f32, energies: &Energies) -> u8 {
    let mut best = MISSING;
    let Some(interval_px) = outlook.columns_of(order, MAX_Z * sd_turns) else { return best };
    outlook.crossings(interval_px, |column_px, _| {
        let (found, rest) = outlook.order_and_rest(column_px);
        if found == order {
            let step = (rest.abs() / sd_turns * STEPS_PER_Z) as usize;
            let outside = if outlook.is_in_volume(column_px) { 0 } else { OUTSIDE };
            best = best.min(energies.of_step[step.min(Energies::STEPS)] as u8 + outside);
        }
    });
    best
}

/// Energy of every step of z.
pub(super) struct Energies {
    /// The last is that of a missing candidate.
    pub(super) of_step: [i32; Self::STEPS + 1],
    /// What an order that passes the back-projection test is below.
    pub(super) limit: u8,
}

impl Energies {
    /// Steps of z that have an energy of their own.
    pub(super) const STEPS: usize = (MAX_Z * STEPS_PER_Z) as usize;

    fn new() -> Self {
        let of_step = std::array::from_fn(|step| {
            let z = (step as f64 + 0.5) / f64::from(STEPS_PER_Z);
            let nats = -((-f64::from(MISSING_NATS)).exp() + (-0.5 * z * z).exp()).ln();
            let energy = (nats.max(0.0) * f64::from(UNITS_PER_NAT)).round() as i32;
            if step < Self::STEPS { energy } else { i32::from(MISSING) }
        });
        Self { of_step, limit: of_step[(PASSING_Z * STEPS_PER_Z) as usize] as u8 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_modulation_is_that_of_sorting() {
        for count in [0, 1, 2, 7, 1000, 1001] {
            let modulation: Vec<Modulation> =
                (0..count).map(|i: u32| Modulation::of_steps((i * 40_503 % 5003) as u16)).collect();
            let valid: Vec<bool> = (0..count).map(|i| i % 3 != 1).collect();
            let mut lit: Vec<Modulation> =
                modulation.iter().zip(&valid).filter(|(_, valid)| **valid).map(|(m, _)| *m).collect();
            lit.sort();
            assert_eq!(median_modulation(&modulation, &valid), lit.get(lit.len() / 2).copied());
        }
    }

    #[test]
    fn energies_rise_from_none_to_that_of_a_missing_candidate() {
        let Energies { of_step: energies, limit } = Energies::new();
        assert!(energies[0] == 0 && energies.is_sorted());
        assert!(energies.iter().all(|&energy| energy <= i32::from(MISSING)) && energies[Energies::STEPS - 1] >= 99);
        // One sd costs half a nat.
        assert_eq!(energies[64], 10);
        assert!((80..90).contains(&limit), "{limit}");
    }
}
