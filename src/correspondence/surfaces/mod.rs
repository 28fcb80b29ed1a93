//! Surfaces: regions of continuous wrapped phase, whose fringe orders are decided as a whole.
//!
//! The wrapped phase of C1 continues over a smooth surface, so that all its pixels share one unknown whole number.
//! Instead of a million pixels some thousand *nodes* are decided. Their orders are sought in all of space, from before
//! the measurement volume to nearly infinity. So a surface outside the volume gets its true order, and no wrong one
//! inside.
//!
//! ```text
//! runs:          rows of C1, cut where the wrapped phase does not continue; orders counted from the start of each run
//! unions:        runs of neighbouring rows united where one whole number makes their phases continue: surfaces
//! nodes:         the parts of surfaces in tiles of the image over which orders are consistent
//! order scores:  how well every order fits some pixels of each node
//! evidence:      the scores summed over each node
//! belief:        along a surface the order continues freely from node to node, and changes at a price
//! explain:       orders by δ within wide limits, the drift that these show, orders by δ about that drift
//! bodies:        nodes that lead beyond the volume but hold the border of a body inside it
//! outside:       pixels that see something outside the volume; the orders of all others are confirmed pixel by pixel
//! taken:         the places of C2 that show surfaces outside: no point in the volume has its correspondence there
//! ```
//!
//! In: the phase of C1, C2 in the epipolar frame, segments. Out: the drift of the calibration; the pixels that see
//! something outside the volume; C2 without the taken places; the orders of the pixels in clear nodes.

mod belief;
mod block;
mod bodies;
mod decided;
mod evidence;
mod explain;
mod nodes;
pub(super) mod order_scores;
mod outside;
pub(super) mod runs;
mod scratch;
mod taken;
#[cfg(test)]
mod tests;

pub(super) use explain::{clear_nats, explain, explain_by_surfaces};
pub(super) use order_scores::columns_around_each;
pub(super) use scratch::Scratch;

/// Number of orders of a node, called labels; they count from the base of its surface.
const LABELS: usize = 128;
/// Stands for no order.
pub(super) const NO_ORDER: i16 = i16::MIN;
/// Score of a pixel whose δ equals the drift.
const FULL_SCORE: i16 = 64;
