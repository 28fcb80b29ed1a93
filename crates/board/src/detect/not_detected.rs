//! Why a board was not found.

use super::BoardImage;

/// What is in the image instead of the board.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotDetected {
    /// The image has no contrast.
    #[error("the image has no contrast: grey levels {dark:.0} to {bright:.0}; is the light on, and the lens open?")]
    Flat {
        /// Nearly the darkest grey level.
        dark: f64,
        /// Nearly the brightest grey level.
        bright: f64,
    },
    /// A large part of the image is saturated.
    #[error("{percent:.0} % of the image is saturated; use a shorter exposure or less light")]
    Saturated {
        /// Share of the saturated pixels, percent.
        percent: f64,
    },
    /// There is nothing like the board.
    #[error("no board is in the image ({found} {elements} of a pattern were found)")]
    Nothing {
        /// Corners, circles or tags that were found.
        found: usize,
        /// What was looked for.
        elements: &'static str,
    },
    /// The pattern has another size.
    #[error(
        "the image shows {}x{} {elements}, the board has {}x{}: it is another board, or it is partly outside the image, \
         hidden or not sharp", found[0], found[1], wanted[0], wanted[1]
    )]
    OtherSize {
        /// Elements across and down.
        found: [usize; 2],
        /// Those of the board.
        wanted: [usize; 2],
        /// What is counted.
        elements: &'static str,
    },
    /// The image is mirrored.
    #[error("the board is in the image as in a mirror; turn off mirroring in the camera, or do not use a mirror")]
    Mirrored,
    /// There are squares, but no markers of the board.
    #[error(
        "a chessboard with {corners} corners is in the image, but no markers of {dictionary} as this board has them; is \
         it another board, or are the markers too small or not sharp?"
    )]
    NoMarkers {
        /// Corners of squares.
        corners: usize,
        /// The dictionary of the board.
        dictionary: String,
    },
    /// The markers are of another dictionary.
    #[error("the markers in the image are of dictionary {found}, the board has {wanted}")]
    OtherDictionary {
        /// The dictionary found.
        found: String,
        /// That of the board.
        wanted: String,
    },
    /// Too few features passed the checks.
    #[error("only {found} features of the board are clearly in the image, and {least} are needed")]
    TooFew {
        /// Number of features.
        found: usize,
        /// Smallest number.
        least: usize,
    },
}

/// Grey level from which a pixel counts as saturated, and the share of such pixels that is named as the cause.
const SATURATED: f32 = 254.0;
const SATURATED_SHARE: f64 = 0.25;

impl NotDetected {
    /// Saturation, if it explains that nothing was found.
    pub(super) fn or_saturated(self, image: &BoardImage) -> Self {
        let share = image.share_above(SATURATED);
        match self {
            Self::Nothing { .. } | Self::NoMarkers { .. } | Self::OtherSize { .. } if share > SATURATED_SHARE => {
                Self::Saturated { percent: 100.0 * share }
            }
            other => other,
        }
    }
}
