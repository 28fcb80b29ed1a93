//! Checks that the images of a window show the declared pattern steps. Finds lost, repeated and exchanged images even
//! if frame numbers and time stamps are in order.
//!
//! In: the M images of one camera in order of time, and their declared steps. Out: the [`SequenceFault`] visible in the
//! images, if any. Cost: M²/2 multiply-adds for about one pixel in twenty, much less than decoding. Other steps are
//! tried only if the declared ones do not fit. (The paper assumes correct sequences.)
//!
//! ```text
//!  images ─► moments of blocks ─► plane in which the fringes of a block change, without noise
//!         ─► share of it that the declared steps do not explain at any motion ─► if large: try other steps
//! ```
//!
//! The samples of a pixel are `I_i = A + Re(z·e^(iθ_i))`, `θ_i = s_i + ε·t_i`. In a coherent block, one whose pixels
//! move alike, θ is the same everywhere. Without their mean, the samples of each pixel are then a vector in the plane
//! of `cos θ_i` and `sin θ_i` in the space of M images, for any texture, modulation and phase. The second moments of
//! the block show this plane without knowledge of the steps. The other directions contain the noise and so measure it.
//! A block crossed by a moving edge has no such plane and is ignored.
//!
//! The residual is the part of the observed plane outside the plane of the declared steps, at the best ε, as a share of
//! the modulation. Noise is already subtracted. Steady motion, texture and noise leave nearly no residual; a wrong step
//! leaves a third of the modulation. The median over the most coherent fifth of the blocks decides. Only if it is large
//! are other steps tried. They must fit better in nearly all of these blocks: unsteady motion leaves a residual too,
//! but no other steps explain it in block after block.
//!
//! # Invisible faults
//!
//! - *A fault before the first or after the last image* of a window: all steps are shifted alike. That is a slip of the
//!   whole window (see `correspondence`), like all windows after a fault.
//! - *N images lost in a row*, or a multiple of N: the steps are correct again. Only the time jumps, which is visible
//!   if the scene moves. N − 1 lost images show the same steps as a repeated image and are reported as such.
//! - *Exchanged images of the same step*: their phase is correct.
//! - *The mirrored sequence*: cos and sin of −θ span the same plane.
//! - *Few images*: besides the mean and the plane, M images have M − 3 directions that can show a fault, and the fitted
//!   ε uses up some of them. With N = 3 and M = 3 there are none. Windows of fewer than five images are not checked.
//! - *A fault that steady motion explains*: with N = 4 and M = 6, a loss in the middle of a resting scene gives the
//!   steps 0 1 2 0 1 2, like motion by π/6 per image. It counts as a fault if all blocks move by exactly that and would
//!   rest otherwise. A frontal wall approaching at that very speed would be mistaken for it. With faster scenes, long
//!   losses that add up to a full turn, `k·(2π/N + ε) ≈ 2π`, are hidden too, and N = 16 hides more of them than N = 4.
//!   [`SequenceCheck::residual_share`] returns the visible residual of any fault and motion.
//! - *A scene in which fewer than one block in five is coherent* throughout the window, for example if everything moves
//!   fast and the window is long. Then only a single foreign image is found. Decoding leaves such pixels out by itself.

mod block;
mod check;
mod declared;
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

/// Fewest images of a window that can be checked.
const LEAST_IMAGES: usize = 5;

/// One number per image of a window.
type Vector = [f64; MAX_IMAGES];
/// One number per pair of images: `[column][row]`.
type Matrix = [Vector; MAX_IMAGES];
