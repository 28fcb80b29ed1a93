//! Decides the orders of nodes together, by max-sum along surfaces.
//!
//! ```text
//! maximize Σ score(label of node) − price · links whose ends have different labels
//! for some rounds, nodes forwards and backwards in turn, for each side with a neighbour:
//!     t(k) = score(k) + messages from all sides but that one
//!     message(k) = max( t(k), max t − price ) − max t
//! decided: the label with the greatest belief, which is score plus all messages; its lead over the next one
//! ```
//!
//! The price is the measured odds that a union of runs joins two surfaces. A node that has received no new message
//! since it last sent would send the same again, and is skipped.

use fringeflow_simd::{Kernel, Lanes, Level};

use super::evidence::{STEPS_PER_NAT, Scores};
use super::nodes::{LABELS, NONE, Node, Nodes};

/// Rounds: a message crosses the image in one.
const ROUNDS: usize = 6;

/// Scratch memory for messages.
#[derive(Clone, Debug, Default)]
pub(super) struct Messages {
    /// The message received by each node from each side.
    received: Vec<[Scores; 4]>,
    has_new_message: Vec<bool>,
}

/// Decides all nodes that have samples.
pub(super) fn decide(nodes: &mut Nodes, scores: &[Scores], price_nats: f32, messages: &mut Messages) {
    let Messages { received, has_new_message } = messages;
    received.clear();
    received.resize(scores.len(), [[0; LABELS]; 4]);
    has_new_message.clear();
    has_new_message.resize(scores.len(), true);
    let price = (price_nats * STEPS_PER_NAT) as i16;
    let nodes = &mut nodes.nodes;
    fringeflow_simd::run(Level::in_use(), Propagation { nodes, scores, price, received, has_new_message });
}

struct Propagation<'a> {
    nodes: &'a mut [Node],
    scores: &'a [Scores],
    price: i16,
    received: &'a mut [[Scores; 4]],
    has_new_message: &'a mut [bool],
}

impl Kernel for Propagation<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { nodes, scores, price, received, has_new_message } = self;
        for round in 0..ROUNDS {
            for i in 0..nodes.len() {
                let own = if round % 2 == 0 { i } else { nodes.len() - 1 - i };
                if !std::mem::take(&mut has_new_message[own]) || nodes[own].sampled == 0 {
                    continue;
                }
                let belief = belief(&scores[own], &received[own]);
                for side in 0..4 {
                    let other = nodes[own].neighbours[side];
                    if other == NONE || nodes[other as usize].sampled == 0 {
                        continue;
                    }
                    // The message to a side leaves out the message from there. Side k ^ 1 lies opposite side k.
                    let sent = message(&belief, &received[own][side], price);
                    let place = &mut received[other as usize][side ^ 1];
                    has_new_message[other as usize] |= differ(place, &sent);
                    *place = sent;
                }
            }
        }
        for (i, node) in nodes.iter_mut().enumerate().filter(|(_, node)| node.sampled > 0) {
            let belief = belief(&scores[i], &received[i]);
            let (mut label, mut best, mut second) = (0, i16::MIN, i16::MIN);
            for (k, &b) in belief.iter().enumerate() {
                if b > best {
                    (label, second, best) = (k, best, b);
                } else {
                    second = second.max(b);
                }
            }
            node.label = label as u8;
            node.lead = (f32::from(best) - f32::from(second)) / STEPS_PER_NAT;
            node.ratio = f32::from(scores[i][label]) / STEPS_PER_NAT;
        }
    }
}

/// Score plus all received messages.
#[inline(always)]
fn belief(scores: &Scores, received: &[Scores; 4]) -> Scores {
    let mut sums = *scores;
    for message in received {
        for k in 0..LABELS {
            sums[k] += message[k];
        }
    }
    sums
}

/// The message to the side from which `received` came.
#[inline(always)]
fn message(belief: &Scores, received: &Scores, price: i16) -> Scores {
    let mut sent = [0; LABELS];
    let mut most = i16::MIN;
    for k in 0..LABELS {
        sent[k] = belief[k] - received[k];
        most = most.max(sent[k]);
    }
    for k in 0..LABELS {
        sent[k] = (sent[k] - most).max(-price);
    }
    sent
}

/// Whether two messages differ. Free of branches so that it vectorizes.
#[inline(always)]
fn differ(a: &Scores, b: &Scores) -> bool {
    let mut bits = 0;
    for k in 0..LABELS {
        bits |= a[k] ^ b[k];
    }
    bits != 0
}
