//! What the decided pixels beside a node say about its order.
//!
//! ```text
//! for each pixel of a node and each decided pixel of its surface beside it whose phase it may continue:
//!     the order with which it does is a contact
//! the order with the most contacts receives the message that a decided node would send: all others pay the price
//! ```

use rayon::prelude::*;

use super::evidence::{STEPS_PER_NAT, Scores};
use super::nodes::{LABELS, NONE, NOTHING, Nodes};
use super::phase_runs::PhaseRuns;
use super::{Part, Pixels};
use crate::correspondence::neighbourhood::neighbours;
use crate::correspondence::view::View;

/// Fewest contacts that count.
const MIN_CONTACTS: u16 = 2;

/// Finds the label with which each node continues decided pixels, and lets the other labels pay for the change.
pub(super) fn continue_decided(
    view: View<'_>,
    runs: &PhaseRuns,
    nodes: &mut Nodes,
    parts: &[Part],
    pixels: &Pixels<'_>,
    price_nats: f32,
    scores: &mut [Scores],
) {
    let (width, count) = (view.cam1.width, view.cam1.phase.len());
    let price = (price_nats * STEPS_PER_NAT) as i16;
    let Nodes { nodes, pieces, .. } = nodes;
    nodes.par_iter_mut().zip(scores).with_min_len(64).for_each(|(node, scores)| {
        let mut contacts = [0_u16; LABELS];
        for piece in &pieces[node.piece_range()] {
            for u in piece.columns() {
                let pixel = piece.v as usize * width + u;
                let zero = node.base + piece.offset + i32::from(runs.relative[pixel]);
                for other in neighbours(pixel, width, count).into_iter().flatten() {
                    let owner = pixels.owner[other];
                    if owner != NONE && parts[owner as usize].surface == node.surface {
                        let label = pixels.continued(view, pixel, other).map(|order| order - zero);
                        if let Some(label) = label.filter(|label| (0..i32::from(NOTHING)).contains(label)) {
                            contacts[label as usize] += 1;
                        }
                    }
                }
            }
        }
        let (label, most) = (0..).zip(contacts).fold((NOTHING, 0), |best, own| if own.1 > best.1 { own } else { best });
        if most >= MIN_CONTACTS {
            node.continued = label;
            let others = scores.iter_mut().enumerate().filter(|(k, _)| *k != usize::from(label));
            others.for_each(|(_, score)| *score -= price);
        }
    });
}
