//! Phase maps and correspondences as payloads of messages, and back.
//!
//! A payload is a row of planes, one value a pixel, row by row; each plane begins at a [`Block`]. The order is that of
//! the tables in [`maps`] and [`correspondences`]. What comes from another process is checked, never trusted: a payload
//! of another length or with a value that cannot be is [`WireError`].

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

/// Why a payload was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// The payload has another length than its header says.
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
    /// A pixel has an outcome that does not exist.
    #[error("pixel {pixel} has the outcome {code}, which does not exist")]
    Outcome {
        /// Index of the pixel.
        pixel: usize,
        /// What stands there.
        code: u8,
    },
}

/// Checks the length of a payload; the number of pixels where it is right.
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
