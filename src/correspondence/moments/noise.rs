//! Noise of δ of a pixel: variance a + b/B², B the modulation. Part of it is what the field cannot follow.

use super::evidence::Evidence;
use super::learned::{Clear, Values, median};
use super::likelihood::radians;
use super::nodes::Nodes;
use crate::correspondence::neighbourhood::phase_step;
use crate::correspondence::view::View;
use crate::phase::{Modulation, PhaseMap};

/// a before any node is decided, rad².
const FIRST_VARIANCE: f32 = 4e-4;
/// Least a, rad²: the rounding of phases, and the texture of real surfaces.
const MIN_VARIANCE: f32 = 9e-6;
/// Least modulation, grey levels.
const MIN_MODULATION: f32 = 4.0;
/// Bins of modulation, and fewest nodes in one.
const BINS: usize = 8;
const MIN_NODES: usize = 4;
/// Shares of the brightest and of the dimmest pixels whose bends are measured, and fewest pixels of one.
const END_SHARE: usize = 16;
const MIN_END_PX: usize = 8;
/// Distance of the pixels whose bend is measured.
const BEND_STRIDE: usize = 67;
/// Variance of δ per variance of the second difference of the phase, which is six times that of the phase. δ holds the
/// noise of both cameras, that of C2 halved by interpolation.
const PER_BEND: f32 = 1.5 / 6.0;
/// Variance of a normal number per median of its square.
const PER_MEDIAN: f32 = 2.198;

/// The noise of δ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Noise {
    /// rad².
    a: f32,
    /// rad² · grey levels².
    b: f32,
}

impl Noise {
    /// Variance of δ of a pixel with this modulation, rad².
    #[inline]
    pub(super) fn variance(&self, modulation: f32) -> f32 {
        let modulation = modulation.max(MIN_MODULATION);
        self.a + self.b / (modulation * modulation)
    }

    /// The noise as the phase of C1 shows it: how much it bends from pixel to pixel where the modulation is highest and
    /// where it is lowest.
    pub(super) fn of_phase(cam1: &PhaseMap, seen: &mut Values) -> Self {
        let places = (1..cam1.phase.len().saturating_sub(1)).step_by(BEND_STRIDE);
        let known = places.filter(|&i| cam1.valid[i - 1] && cam1.valid[i] && cam1.valid[i + 1]);
        seen.clear();
        seen.extend(known.map(|i| {
            let rise = |i: usize| phase_step(cam1.phase[i], cam1.phase[i + 1]);
            let bend = radians((rise(i) - rise(i - 1)) as f32 / 65536.0);
            [per_square(cam1.modulation[i]), PER_MEDIAN * PER_BEND * bend * bend, i as f32, 0.0]
        }));
        // Pixels of one modulation keep the order of the image.
        seen.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[2].total_cmp(&b[2])));
        let count = seen.len() / END_SHARE;
        if count < MIN_END_PX {
            return Self { a: 0.0, b: 0.0 };
        }
        let [[bright, low], [dim, high]] = [0, seen.len() - count].map(|first| {
            let own = &mut seen[first..first + count];
            [0, 1].map(|column| median(own, column))
        });
        let b = if dim > bright { ((high - low) / (dim - bright)).max(0.0) } else { 0.0 };
        Self { a: (low - b * bright).max(MIN_VARIANCE), b }
    }

    /// The noise before any node is decided.
    pub(super) fn before_nodes(self) -> Self {
        Self { a: FIRST_VARIANCE, ..self }
    }

    /// sd of the second difference of the phase, turns.
    #[inline]
    pub(super) fn bend_turns(&self, modulation: f32) -> f32 {
        (self.variance(modulation) / PER_BEND).sqrt() / radians(1.0)
    }

    /// The noise about the planes of clear nodes: a line through the medians of bins of 1/B². `None` if there are too few.
    pub(super) fn of_nodes(
        view: View<'_>,
        nodes: &Nodes,
        evidence: &Evidence,
        clear: &[Clear],
        seen: &mut Values,
    ) -> Option<Self> {
        seen.clear();
        for &(i, label) in clear {
            let node = &nodes.nodes[i as usize];
            let Some(fit) = evidence.fit(i as usize, label).filter(|fit| fit.moments.count >= 12.0) else { continue };
            let [u, v] = nodes.middle_of(node).middle();
            let pixel = v * view.cam1.width + u;
            seen.push([per_square(view.cam1.modulation[pixel]), fit.moments.residual, 0.0, 0.0]);
        }
        if seen.len() < BINS * MIN_NODES {
            return None;
        }
        seen.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let [mut w, mut x, mut xx, mut y, mut xy] = [0.0_f64; 5];
        for bin in 0..BINS {
            let range = seen.len() * bin / BINS..seen.len() * (bin + 1) / BINS;
            let own = &mut seen[range];
            let at = own.iter().map(|pair| f64::from(pair[0])).sum::<f64>() / own.len() as f64;
            let median = f64::from(median(own, 1));
            let weight = 1.0 / (median * median + 1e-12);
            w += weight;
            x += weight * at;
            xx += weight * at * at;
            y += weight * median;
            xy += weight * at * median;
        }
        let determinant = w * xx - x * x;
        let b = if determinant > 1e-12 * w * xx { ((w * xy - x * y) / determinant).max(0.0) } else { 0.0 };
        let a = ((y - b * x) / w).max(f64::from(MIN_VARIANCE));
        Some(Self { a: a as f32, b: b as f32 })
    }
}

/// 1/B² of a modulation B.
fn per_square(modulation: Modulation) -> f32 {
    let modulation = modulation.grey().max(MIN_MODULATION);
    1.0 / (modulation * modulation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::test_random::random;

    #[test]
    fn noise_of_a_bright_and_of_a_dim_surface_is_seen_in_the_bends_of_the_phase() {
        // One pixel in ten is dim, with a tenth of the modulation. sd of the phase: 0.004 and 0.04 turns.
        let (count, mut random) = (200_000, random(5));
        let mut map = PhaseMap { width: 500, height: 400, valid: vec![true; count], ..PhaseMap::default() };
        for i in 0..count {
            let modulation = if i % 500 < 50 { 8.0 } else { 80.0 };
            let noise_turns =
                ((0..12).map(|_| random(1 << 16) as f32 / 65536.0).sum::<f32>() - 6.0) * 0.32 / modulation;
            map.phase.push(((0.13 * (i % 500) as f32 + noise_turns).rem_euclid(1.0) * 65536.0) as u16);
            map.modulation.push(Modulation::from_grey(modulation));
        }
        let noise = Noise::of_phase(&map, &mut Values::new());
        for modulation in [8.0, 80.0] {
            let expected = radians(0.32 / modulation) * 1.5_f32.sqrt();
            let found = noise.variance(modulation).sqrt();
            assert!((found / expected - 1.0).abs() < 0.15, "{modulation}: {found} {expected}");
            assert!((noise.bend_turns(modulation) / (6.0_f32.sqrt() * 0.32 / modulation) - 1.0).abs() < 0.15);
        }
        map.valid.truncate(20);
        map.phase.truncate(20);
        assert_eq!(Noise::of_phase(&map, &mut Values::new()).variance(8.0), 0.0);
    }
}
