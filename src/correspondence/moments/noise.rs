//! Noise of δ of a pixel: variance a + b/B², B the modulation. Part of it is what the field cannot follow.

use super::evidence::Evidence;
use super::learned::Values;
use super::nodes::Nodes;
use crate::correspondence::view::View;

/// Variance of a pixel before anything is known, rad².
const FIRST_VARIANCE: f32 = 4e-4;
/// Least a, rad²: the rounding of phases, and the texture of real surfaces.
const MIN_VARIANCE: f32 = 9e-6;
/// Least modulation, grey levels.
const MIN_MODULATION: f32 = 4.0;
/// Bins of modulation, and fewest nodes in one.
const BINS: usize = 8;
const MIN_NODES: usize = 4;

/// The noise of δ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Noise {
    /// rad².
    a: f32,
    /// rad² · grey levels².
    b: f32,
}

impl Default for Noise {
    fn default() -> Self {
        Self { a: FIRST_VARIANCE, b: 0.0 }
    }
}

impl Noise {
    /// Variance of δ of a pixel with this modulation, rad².
    #[inline]
    pub(super) fn variance(&self, modulation: f32) -> f32 {
        let modulation = modulation.max(MIN_MODULATION);
        self.a + self.b / (modulation * modulation)
    }

    /// The noise about the planes of clear nodes: a line through the medians of bins of 1/B². Keeps the present one if
    /// there are too few.
    pub(super) fn learn(
        &self,
        view: View<'_>,
        nodes: &Nodes,
        evidence: &Evidence,
        clear: &[u32],
        seen: &mut Values,
    ) -> Self {
        seen.clear();
        for i in clear.iter().map(|&i| i as usize) {
            let node = &nodes.nodes[i];
            let Some(fit) = evidence.fit(i, node.label).filter(|fit| fit.moments.count >= 12.0) else { continue };
            let [u, v] = nodes.middle_of(node).middle();
            let pixel = v * view.cam1.width + u;
            let modulation = view.cam1.modulation[pixel].grey().max(MIN_MODULATION);
            seen.push([1.0 / (modulation * modulation), fit.moments.residual, 0.0, 0.0]);
        }
        if seen.len() < BINS * MIN_NODES {
            return *self;
        }
        seen.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let [mut w, mut x, mut xx, mut y, mut xy] = [0.0_f64; 5];
        for bin in 0..BINS {
            let range = seen.len() * bin / BINS..seen.len() * (bin + 1) / BINS;
            let own = &mut seen[range];
            let at = own.iter().map(|pair| f64::from(pair[0])).sum::<f64>() / own.len() as f64;
            let middle = own.len() / 2;
            let median = f64::from(own.select_nth_unstable_by(middle, |a, b| a[1].total_cmp(&b[1])).1[1]);
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
        Self { a: a as f32, b: b as f32 }
    }
}
