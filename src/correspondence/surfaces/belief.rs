//! Decides the orders of nodes by belief propagation (max-sum) along surfaces.
//!
//! ```text
//! for some rounds, nodes forwards and backwards in turn, for each side with a neighbour:
//!     t(k) = evidence(k) + messages from all sides but that one
//!     message(k) = max( t(k), max t − PRICE ) − max t
//! decided: the label with the greatest belief, which is evidence plus all messages; its lead over the next best
//! ```
//!
//! A node that has received no new message since it last sent would send the same again, and is skipped.

use fringeflow_simd::{Kernel, Lanes, Level};

use super::nodes::{NO_NODE, Nodes};
use super::{FULL_SCORE, LABELS};

/// Price of a change of order along a surface: this many pixels that fit.
const PRICE: i16 = 10 * FULL_SCORE;
/// Rounds.
const ROUNDS: usize = 6;

type Labels = [i16; LABELS];

/// Scratch memory for messages.
#[derive(Clone, Debug, Default)]
pub(super) struct Messages {
    /// The message received by each node from each side.
    received: Vec<[Labels; 4]>,
    /// Whether a node has a new message to send.
    has_new_message: Vec<bool>,
}

/// Decides all nodes with evidence.
pub(super) fn decide(nodes: &mut Nodes, evidence: &[Labels], messages: &mut Messages) {
    let Messages { received, has_new_message } = messages;
    received.clear();
    received.resize(evidence.len(), [[0; LABELS]; 4]);
    has_new_message.clear();
    has_new_message.resize(evidence.len(), true);
    fringeflow_simd::run(Level::in_use(), Propagation { nodes, evidence, messages: received, has_new_message });
}

/// Sends the messages and decides the nodes.
struct Propagation<'a> {
    nodes: &'a mut Nodes,
    evidence: &'a [Labels],
    /// The message received by each node from each side.
    messages: &'a mut [[Labels; 4]],
    has_new_message: &'a mut [bool],
}

impl Kernel for Propagation<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { nodes: Nodes { nodes, with_evidence, .. }, evidence, messages, has_new_message } = self;
        for round in 0..ROUNDS {
            for i in 0..with_evidence.len() {
                // Forwards, then backwards: a message crosses the image in one round.
                let own = if round % 2 == 0 { i } else { with_evidence.len() - 1 - i };
                if !std::mem::take(&mut has_new_message[own]) {
                    continue;
                }
                let belief = belief(&evidence[own], &messages[own]);
                let neighbours = nodes[with_evidence[own] as usize].neighbours;
                for side in 0..4 {
                    if neighbours[side] != NO_NODE {
                        let other = nodes[neighbours[side] as usize].evidence as usize;
                        // The message to a side leaves out the message from there. Side k ^ 1 lies opposite side k.
                        let sent = message(&belief, &messages[own][side]);
                        let received = &mut messages[other][side ^ 1];
                        has_new_message[other] |= differ(received, &sent);
                        *received = sent;
                    }
                }
            }
        }
        for ((&node, evidence), messages) in with_evidence.iter().zip(evidence).zip(&*messages) {
            let node = &mut nodes[node as usize];
            let belief = belief(evidence, messages);
            let (mut label, mut best, mut second) = (0, i16::MIN, i16::MIN);
            for (k, &b) in belief.iter().enumerate() {
                if b > best {
                    (label, second, best) = (k, best, b);
                } else {
                    second = second.max(b);
                }
            }
            node.label = label as u8;
            node.lead = (f32::from(best) - f32::from(second)) / f32::from(FULL_SCORE);
            node.fitting = f32::from(evidence[label]) / f32::from(FULL_SCORE);
            node.best_fitting = f32::from(evidence.iter().copied().fold(0, i16::max)) / f32::from(FULL_SCORE);
        }
    }
}

/// Evidence plus all received messages.
#[inline(always)]
fn belief(evidence: &Labels, messages: &[Labels; 4]) -> Labels {
    let mut sums = *evidence;
    for message in messages {
        for k in 0..LABELS {
            sums[k] += message[k];
        }
    }
    sums
}

/// The message to the side from which `received` came.
#[inline(always)]
fn message(belief: &Labels, received: &Labels) -> Labels {
    let mut sent = [0; LABELS];
    let mut most = i16::MIN;
    for k in 0..LABELS {
        sent[k] = belief[k] - received[k];
        most = most.max(sent[k]);
    }
    for k in 0..LABELS {
        sent[k] = (sent[k] - most).max(-PRICE);
    }
    sent
}

/// Whether two messages differ. Free of branches so that it vectorizes.
#[inline(always)]
fn differ(a: &Labels, b: &Labels) -> bool {
    let mut bits = 0;
    for k in 0..LABELS {
        bits |= a[k] ^ b[k];
    }
    bits != 0
}
