//! Parts: the nodes whose pixels are looked at.
//!
//! ```text
//! unite neighbouring nodes with one label: components
//! ratio of a component = Σ ratio of its nodes about its offset
//! a node becomes a part if its component is founded, or continues what larger tiles decided, and its own samples agree;
//!     a node that holds two surfaces waits for smaller tiles: δ of a wrong order is small somewhere on the other one
//! ```

use super::evidence::Fit;
use super::field;
use super::learned::Learned;
use super::nodes::{NONE, NOTHING, Node};
use super::{Part, Scratch};
use crate::correspondence::view::View;

impl Scratch {
    /// Makes parts of the nodes whose component is founded well enough to be looked at.
    pub(super) fn keep(&mut self, view: View<'_>, level: u8, is_last: bool, learned: &Learned) {
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
        sums.iter_mut().for_each(|sum| sum[0] /= sum[1].max(1.0));
        let model = view.model;
        let widths = learned.widths_beside(level);
        for (i, node) in all.iter().enumerate().filter(|(_, node)| is_judged(node)) {
            let offset = sums[set_of[i]][0];
            let nats = evidence.fit(i, node.label).map_or(node.ratio, |fit| fit.moments.ratio(offset, &widths, model));
            sums[set_of[i]][2] += nats;
        }
        // A component that continues a surface decided in larger tiles needs no foundation of its own.
        for (i, _) in all.iter().enumerate().filter(|(_, node)| is_judged(node) && node.label == node.continued) {
            sums[set_of[i]][2] += model.look_nats;
        }
        part_of.clear();
        offsets.clear();
        for (i, node) in all.iter().enumerate() {
            let offset = sums[set_of[i]][0];
            let fit = evidence.fit(i, node.label);
            let own = fit.map_or(0.0, |fit| fit.moments.ratio(offset, &widths, model));
            let is_pure = fit.is_none_or(|fit| fit.moments.is_pure(&widths, model));
            let best = evidence.fits_of(i).iter().fold(0.0_f32, |best, fit| best.max(fit.ratio));
            let is_own = own > 0.0 && own >= best - model.look_nats;
            let is_ready = is_judged(node) && (is_pure || is_last);
            let stands = is_ready && is_own && sums[set_of[i]][2] >= model.look_nats;
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
            let moments = fit.map(|fit| fit.moments);
            let (pixel, column_px) = field::place_of(view, runs, nodes, node);
            let field_variance = learned.uncertainty.variance(view.table, pixel, column_px);
            let others = evidence.fits_of(i).iter().filter(|fit| fit.label != node.label);
            let other = others.fold(0.0_f32, |most, fit| most.max(fit.ratio));
            let odds = moments.map_or(model.floor_nats, |moments| moments.ratio(0.0, &widths, model)) - other;
            let remains =
                |fit: &&Fit| node.has_inside(fit.label) && fit.ratio >= own.max(model.look_nats) - model.look_nats;
            let candidates = evidence.fits_of(i).iter().filter(remains).count().clamp(1, 255) as u8;
            parts.push(Part {
                level,
                surface: node.surface,
                label: node.label,
                offset: offsets[i],
                moments,
                odds,
                candidates,
                field_variance,
            });
        }
    }
}
