//! From images of the board under the patterns of the projector to observations.
//!
//! In: the images of one camera in one pose of the board, in the order of the pattern set. Out: a
//! [`CameraView`](crate::observations::CameraView), and the signs of what may be wrong with the images. Cost: some ten
//! milliseconds per image.

mod coordinates;
mod edges;
mod gains;
mod order;
mod patch;
mod view;

pub(crate) use coordinates::Coordinates;
pub use order::{PatternOrder, PatternOrderError};
pub use view::{ImageSigns, NoView, observe};
