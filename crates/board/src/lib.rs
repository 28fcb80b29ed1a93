//! Calibration boards: what is printed on them, how they are drawn, and how they are found in images.
//!
//! ```text
//!  SPEC or TOML file ─► Board ─► features, brightness of each point ─► sheet to print, simulation
//!                         └────► detect(image) ─► image points of its features, with ids and standard deviations
//! ```
//!
//! | frame | origin | axes | unit |
//! |---|---|---|---|
//! | board | middle of the pattern | x right, y down as printed, z into the board, away from its reader | mm |
//! | image | centre of the first pixel | x right, y down | pixels, centres at integers |
//!
//! ```
//! use fringeflow_board::Board;
//!
//! let board: Board = "charuco:14x10:square=12:marker=9:dictionary=4x4_250".parse()?;
//! assert_eq!(board.features().len(), 13 * 9);
//! assert_eq!(board.features()[0], [-72.0, -48.0, 0.0]);
//! assert_eq!(board.brightness(-78.0, -54.0), 0.0);
//! # Ok::<(), fringeflow_board::BoardError>(())
//! ```

#![forbid(unsafe_code)]

mod board;
mod detect;
mod sheet;

pub use board::{Board, BoardError, Marker, Pattern, Tags};
pub use detect::{BoardImage, Detection, NotDetected, detect, detect_again};
pub use sheet::{Page, Sheet, SheetError, UnknownPage};
