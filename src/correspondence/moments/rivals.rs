//! Rival explanations: the orders that the largest surface could have.
//!
//! A calibration error moves δ of a whole surface, and so may bring it to a wrong order that is nearly as flat as the true
//! one: that of a board where the projector stands outside of the cameras, or of a board close behind the volume. A field
//! learned from it makes the rest of the scene wrong too. All nodes of a surface share one label, so the labels at which
//! most of its nodes fit are the explanations that there are.

use super::evidence::{Evidence, Fit};
use super::learned::Clear;
use super::model::Model;
use super::nodes::{LABELS, Node, Nodes};

/// A label is a rival if it fits at least this share of what the best one fits.
const LEAST_SHARE: f32 = 0.5;

/// The rivals of an image.
#[derive(Clone, Debug, Default)]
pub(super) struct Rivals {
    surface: usize,
    pub(super) labels: Vec<u8>,
    /// Pixels of each surface in nodes that fit in the volume.
    sizes_px: Vec<u32>,
}

impl Rivals {
    /// Lists the labels at which the largest surface fits that may lie in the volume.
    pub(super) fn find(&mut self, surfaces: usize, nodes: &Nodes, evidence: &Evidence, model: &Model) {
        let Self { surface, labels, sizes_px } = self;
        sizes_px.clear();
        sizes_px.resize(surfaces, 0);
        let fits = |i: usize| evidence.fits_of(i).iter().filter(|fit| is_clear(fit, model));
        for (i, node) in nodes.sampled() {
            if fits(i).any(|fit| node.has_inside(fit.label)) {
                sizes_px[node.surface as usize] += node.size_px;
            }
        }
        labels.clear();
        while labels.is_empty() {
            let Some(largest) = (0..surfaces).max_by_key(|&surface| sizes_px[surface]).filter(|&s| sizes_px[s] > 0)
            else {
                return;
            };
            *surface = largest;
            sizes_px[largest] = 0;
            let [mut all_px, mut inside_px] = [[0; LABELS]; 2];
            for (i, node) in of_surface(nodes, largest) {
                for label in fits(i).map(|fit| fit.label) {
                    all_px[usize::from(label)] += node.size_px;
                    inside_px[usize::from(label)] += if node.has_inside(label) { node.size_px } else { 0 };
                }
            }
            let most_px = all_px.into_iter().max().unwrap_or_default();
            let is_rival = |px: u32| px > 0 && px as f32 >= LEAST_SHARE * most_px as f32;
            // A surface that fits outside alone tells little about the field inside.
            if inside_px.into_iter().any(is_rival) {
                labels.extend((0_u8..).zip(all_px).filter(|(_, px)| is_rival(*px)).map(|(label, _)| label));
            }
        }
    }

    /// The nodes from which a rival is learned.
    pub(super) fn nodes_of<'a>(
        &self,
        label: u8,
        nodes: &'a Nodes,
        evidence: &'a Evidence,
        model: &'a Model,
    ) -> impl Iterator<Item = Clear> + 'a {
        let clear = of_surface(nodes, self.surface).map(move |(i, _)| (i as u32, label));
        clear.filter(move |clear| fits_clearly(evidence, clear, model))
    }
}

/// The nodes of a surface, with their numbers.
fn of_surface(nodes: &Nodes, surface: usize) -> impl Iterator<Item = (usize, &Node)> {
    nodes.sampled().filter(move |(_, node)| node.surface as usize == surface)
}

/// Whether the samples of a node fit its label well enough to learn from it.
pub(super) fn fits_clearly(evidence: &Evidence, &(i, label): &Clear, model: &Model) -> bool {
    evidence.fit(i as usize, label).is_some_and(|fit| is_clear(fit, model))
}

/// Whether samples fit an order well enough to learn from it.
fn is_clear(fit: &Fit, model: &Model) -> bool {
    fit.ratio >= model.clear_nats && fit.moments.share >= model.clear_share
}
