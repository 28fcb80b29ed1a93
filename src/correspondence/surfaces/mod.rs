//! Surfaces: regions of continuous wrapped phase, whose fringe orders are decided together.
//!
//! The wrapped phase of C1 runs on over a smooth surface, so that all its pixels share one unknown whole number. Instead of a
//! million pixels some thousand *nodes* are decided, and space is asked as a whole: from before the measurement volume to nearly
//! infinity, so that what stands outside the volume is explained by where it is.
//!
//! ```text
//! runs:      rows of C1 broken where the wrapped phase does not run on; orders counted from the beginning of each run
//! unions:    runs of neighbouring rows united where one whole number makes nearly all their phases run on: surfaces
//! nodes:     the parts of surfaces in tiles of the image over which orders do not contradict each other
//! evidence:  of some pixels of each node how well every order fits, summed over the node
//! belief:    along a surface the order goes on freely from node to node, and changes at a price
//! explain:   orders by δ within wide limits, the drift that these show, orders by δ about that drift
//! bodies:    nodes that lead beyond the volume but hold the border of a body within
//! outside:   pixels that see something outside the volume; the orders of all others are confirmed pixel by pixel
//! taken:     the places of C2 that these are seen in: no point in the volume has its correspondence there
//! ```
//!
//! In: the phase of C1, C2 in the epipolar frame, segments. Out: the drift of the calibration, which pixels see something outside
//! the measurement volume, C2 without the places that this is seen in, and the orders of pixels whose nodes tell them.

mod belief;
mod block;
mod bodies;
mod decided;
mod evidence;
mod explain;
mod nodes;
mod order_scores;
mod outside;
mod runs;
mod taken;
#[cfg(test)]
mod tests;

pub(super) use decided::Decided;
pub(super) use evidence::{Scratch, View};
pub(super) use explain::{clear_nats, explain, explain_by_surfaces};
pub(super) use order_scores::columns_around_each;

/// Orders of a node, counted from the base of its surface.
const LABELS: usize = 128;
/// Stands for no order of a pixel.
pub(super) const NO_ORDER: i16 = i16::MIN;
/// Score of a pixel whose δ is that of the drift.
const FULL_SCORE: i16 = 64;
