//! Parts: the nodes whose pixels are looked at.
//!
//! ```text
//! unite neighbouring nodes with one label: components
//! ratio of a component = Σ ratio of its nodes about its offset + ratio of that offset
//! a node becomes a part if its component is founded, or continues what larger tiles decided, and its own samples agree
//! ```

use super::evidence::Fit;
use super::field;
use super::learned::Learned;
use super::likelihood::{FLOOR_NATS, ratio_of_offset};
use super::nodes::{NONE, NOTHING, Node, Nodes};
use super::phase_runs::PhaseRuns;
use super::{OFFSET_SD, Part, Pixels, Scratch};
use crate::correspondence::neighbourhood::MAX_STEP;
use crate::correspondence::view::View;

/// Least ratio of a component of nodes to be looked at, nats. Where another order fits the samples of a node better by as
/// much than the one that its neighbours agree on, the node holds two surfaces, and is left to smaller tiles.
const LOOK_NATS: f32 = 6.0;
/// Fewest decided neighbours that a node continues.
const MIN_CONTACTS: u32 = 2;

impl Scratch {
    /// Makes parts of the nodes whose component is founded well enough to be looked at.
    pub(super) fn keep(&mut self, view: View<'_>, level: u8, learned: &Learned, pixels: &Pixels<'_>) {
        let Self { runs, nodes, evidence, sets, set_of, sums, parts, part_of, offsets, .. } = self;
        let all = &nodes.nodes;
        sets.reset(all.iter().map(|_| 1));
        for (i, node) in all.iter().enumerate().filter(|(_, node)| node.label != NOTHING) {
            for other in node.neighbours.into_iter().filter(|&other| other != NONE && other > i as u32) {
                if all[other as usize].label == node.label && all[other as usize].sampled > 0 {
                    sets.unite(i as u32, other, 0);
                }
            }
        }
        set_of.clear();
        let count = sets.number(|_, offset| set_of.push(offset.set as usize));
        sums.clear();
        sums.resize(count, [0.0; 3]);
        let is_judged = |node: &Node| node.sampled > 0 && node.label != NOTHING;
        for (i, node) in all.iter().enumerate().filter(|(_, node)| is_judged(node)) {
            if let Some(fit) = evidence.fit(i, node.label) {
                let sum = &mut sums[set_of[i]];
                sum[0] += fit.moments.count * fit.moments.mean;
                sum[1] += fit.moments.count;
            }
        }
        for sum in &mut *sums {
            sum[0] /= sum[1].max(1.0);
            sum[2] = ratio_of_offset(sum[0], OFFSET_SD);
        }
        let widths = learned.widths_beside(level);
        for (i, node) in all.iter().enumerate().filter(|(_, node)| is_judged(node)) {
            let offset = sums[set_of[i]][0];
            let nats = evidence.fit(i, node.label).map_or(node.ratio, |fit| fit.moments.ratio(offset, &widths));
            sums[set_of[i]][2] += nats;
        }
        // A component that continues a surface decided in larger tiles needs no foundation of its own.
        if level > 0 {
            for (i, node) in all.iter().enumerate().filter(|(_, node)| is_judged(node)) {
                if continues_decided(view, runs, nodes, node, pixels) {
                    sums[set_of[i]][2] += LOOK_NATS;
                }
            }
        }
        part_of.clear();
        offsets.clear();
        for (i, node) in all.iter().enumerate() {
            let offset = sums[set_of[i]][0];
            let own = evidence.fit(i, node.label).map_or(0.0, |fit| fit.moments.ratio(offset, &widths));
            let best = evidence.fits_of(i).iter().fold(0.0_f32, |best, fit| best.max(fit.ratio));
            let is_own = own > 0.0 && own >= best - LOOK_NATS;
            let stands = is_judged(node) && is_own && sums[set_of[i]][2] >= LOOK_NATS;
            offsets.push(0.0);
            part_of.push(if stands { parts.len() as u32 } else { NONE });
            if !stands {
                continue;
            }
            // The mean over the node and its like neighbours, drawn to the field.
            let (mut sum, mut weight) = (0.0, 0.0);
            let like = node.neighbours.into_iter().filter(|&o| o != NONE && all[o as usize].label == node.label);
            for j in like.map(|other| other as usize).chain([i]) {
                if let Some(fit) = evidence.fit(j, node.label) {
                    sum += fit.moments.count * fit.moments.mean;
                    weight += fit.moments.count;
                }
            }
            offsets[i] = sum / (weight + 8.0);
            let moments = evidence.fit(i, node.label).map(|fit| fit.moments);
            let (pixel, column_px) = field::place_of(view, runs, nodes, node);
            let field_variance = learned.uncertainty.variance(view.table, pixel, column_px);
            let others = evidence.fits_of(i).iter().filter(|fit| fit.label != node.label);
            let other = others.fold(0.0_f32, |most, fit| most.max(fit.ratio));
            let odds = moments.map_or(FLOOR_NATS, |moments| moments.ratio(0.0, &widths)) - other;
            let remains = |fit: &&Fit| fit.is_inside && fit.ratio >= own.max(LOOK_NATS) - LOOK_NATS;
            let candidates = evidence.fits_of(i).iter().filter(remains).count().clamp(1, 255) as u8;
            parts.push(Part { level, offset: offsets[i], moments, odds, candidates, field_variance });
        }
    }
}

/// Whether pixels beside a node were decided, and its absolute phases continue theirs.
fn continues_decided(view: View<'_>, runs: &PhaseRuns, nodes: &Nodes, node: &Node, pixels: &Pixels<'_>) -> bool {
    let (width, phase) = (view.cam1.width, &view.cam1.phase);
    let mut contacts = 0;
    for piece in nodes.pieces_of(node) {
        for u in piece.columns() {
            let pixel = piece.v as usize * width + u;
            let order = node.order(piece.offset + i32::from(runs.relative[pixel]));
            let own = (order << 16) + i32::from(phase[pixel]);
            let beside = [(u > 0).then(|| pixel - 1), (u + 1 < width).then(|| pixel + 1)];
            let rows = [pixel.checked_sub(width), Some(pixel + width)];
            for other in beside.into_iter().chain(rows).flatten() {
                if pixels.owner.get(other).is_some_and(|owner| *owner != NONE) {
                    contacts += u32::from((pixels.absolute(view, other) - own).abs() <= MAX_STEP);
                }
            }
        }
    }
    contacts >= MIN_CONTACTS
}
