//! Whether the images of a window show the pattern steps that are said of them: lost, duplicated and swapped images that no
//! number and no time stamp tells of.
//!
//! In: the M images of one camera in the order of their times, and the steps that they are said to show. Out: the
//! [`SequenceFault`] that the images themselves tell, if any.
//!
//! ```text
//!  images ─► moments of blocks ─► the two directions in which the fringes of a block change, noise apart
//!         ─► share of them that the said steps leave unexplained, whatever the motion ─► other steps, where it is large
//! ```
//!
//! The samples of a pixel are `I_i = A + Re(z·e^(iθ_i))`, `θ_i = s_i + ε·t_i`, with the same θ in all pixels of a block that
//! moves alike: without their mean they lie in the plane of `cos θ_i` and `sin θ_i` in the space of M images, whatever the
//! texture, the modulation and the phase of each pixel. That plane is seen without knowing any step, from the second
//! moments of the block; the other directions hold the noise, which so is known as well. A block across which an edge moves
//! has no such plane and is not asked. What is left of the seen plane beside that of the said steps, at the ε that suits
//! best, is the residual: a share of the modulation, with the noise already taken off. Motion of any steady speed, texture
//! and noise leave next to nothing of it, a wrong step a third of the modulation. The median over the fifth of the blocks that
//! move most alike decides. Only where it is large others than the said steps are tried; they must leave less in nearly all
//! of these blocks: motion that is not steady leaves something too, but no other steps explain it in one block after the
//! other.
//!
//! # What cannot be seen
//!
//! - *A fault before the first or behind the last image* of a window: the same steps, all ahead by as much. That is a slip of
//!   the whole window (see `correspondence`), as are all windows behind a fault.
//! - *N images lost in a row*, or a multiple: the steps are right again; only the time jumps, which shows where the scene moves.
//!   N − 1 lost show the same steps as a duplicate, which is the name that they are given.
//! - *Images of the same step exchanged*: nothing is wrong with their phase.
//! - *The mirrored sequence*: cos and sin of −θ span the same plane.
//! - *Few images*: the plane of M images leaves M − 3 directions to be told by, and ε takes one part of them. With N = 3 and
//!   M = 3 there is none, which is why windows of fewer than five images are not looked at.
//! - *A fault that a steady motion explains*: with N = 4 and M = 6 an image lost in the middle of a scene at rest gives the
//!   steps 0 1 2 0 1 2, as if it moved by π/6 an image. It is a fault where all blocks move by exactly that and would be
//!   at rest otherwise; a frontal wall that came nearer at that very speed would be mistaken for it. With a faster scene,
//!   long losses whose way makes up a turn, `k·(2π/N + ε) ≈ 2π`, are hidden too, and N = 16 hides more of them than N = 4.
//!   [`SequenceCheck::residual_share`] says for any fault and motion what is left to be seen.
//! - *A scene of which fewer than one block in five moves alike* all through the window, as when everything is quick and the
//!   window long: only an image that alone shows something else is told then. Decoding leaves such pixels out by itself.
//!
//! Cost: the moments, M²/2 multiply-adds for one pixel in twenty or so, far below those of decoding. Other steps are tried only
//! where the said ones do not fit.

mod block;
mod check;
mod eigen;
mod fault;
mod judge;
mod signal;
mod span;
#[cfg(test)]
mod tests;

use fringeflow_base::limits::MAX_IMAGES;

pub use check::{SequenceCheck, SequenceScratch};
pub use fault::{SequenceFault, SequenceFaultKind};

/// Fewest images of a window whose steps can be told.
const LEAST_IMAGES: usize = 5;

/// A number for each image of a window.
type Vector = [f64; MAX_IMAGES];
/// A number for every two images.
type Matrix = [Vector; MAX_IMAGES];
