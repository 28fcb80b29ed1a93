//! Conversion of the results of the measurement to messages and back.
//!
//! ```text
//!  payload │ plane │ plane │ … │      one value per pixel, row by row
//!          │←block→│               every plane starts at a Block of 64 bytes
//! ```
//!
//! The planes are listed in [`maps`] and [`correspondences`], in their order. A payload from another process is
//! checked: a wrong length or an invalid value is a [`WireError`].
//!
//! ```
//! use fringeflow::phase::{Modulation, PhaseMap};
//! use fringeflow::worker::PhasePair;
//! use fringeflow_message::{Block, Window};
//! use fringeflow_wire::maps;
//!
//! let modulation = vec![Modulation::from_grey(50.0); 2];
//! let (phase, mean, valid) = (vec![0, 16_384], vec![90, 91], vec![true, false]);
//! let map = PhaseMap { width: 2, height: 1, phase, modulation, mean, valid, ..PhaseMap::default() };
//! let sent = PhasePair { cam1: map.clone(), cam2: map, ..PhasePair::default() };
//! let header = maps::header(&sent, &Window::default(), 0, 1);
//! let mut payload = vec![Block([0; 64]); maps::blocks(2)];
//! maps::write(&sent, &mut payload);
//! let mut received = PhasePair::default();
//! maps::read(&header, &payload, &mut received)?;
//! assert_eq!(received, sent);
//! # Ok::<(), fringeflow_wire::WireError>(())
//! ```

#![forbid(unsafe_code)]

pub mod correspondences;
pub mod drift;
pub mod health;
pub mod in_step;
pub mod maps;
mod planes;
pub mod prior;
pub mod window_report;

use fringeflow_message::Block;

/// Why a payload is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// The payload does not have the length that its header states.
    #[error("the payload has {found} blocks of 64 bytes; {width_px} × {height_px} pixels need {expected}")]
    Length {
        /// Blocks found.
        found: usize,
        /// Blocks expected.
        expected: usize,
        /// Width that the header states, pixels.
        width_px: u32,
        /// Height that the header states, pixels.
        height_px: u32,
    },
    /// A pixel has an unknown outcome.
    #[error("pixel {pixel} has the unknown outcome {code}")]
    Outcome {
        /// Index of the pixel.
        pixel: usize,
        /// Its outcome.
        code: u8,
    },
}

/// Checks the length of a payload and returns the number of pixels.
fn checked_pixels(payload: &[Block], size_px: [u32; 2], blocks: impl Fn(usize) -> usize) -> Result<usize, WireError> {
    let [width_px, height_px] = size_px;
    let pixels = (width_px as usize).checked_mul(height_px as usize).unwrap_or(usize::MAX / 64);
    let expected = blocks(pixels);
    if payload.len() == expected {
        Ok(pixels)
    } else {
        Err(WireError::Length { found: payload.len(), expected, width_px, height_px })
    }
}
