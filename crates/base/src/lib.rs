//! Shared by all other crates: grey levels, limits, outcomes of pixels, Eq. (1), atomic writes, new folders, text files, PNG, NPZ.
//!
//! ```text
//! base ◄── message ◄── transport ◄── services
//!   ▲── fringeflow (the method), dataset, pixels, recording, lab
//! ```
//!
//! ```
//! use fringeflow_base::atomic_file::write_atomically;
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("cloud.txt");
//! write_atomically(&path, |out| std::io::Write::write_all(out, b"0 0 0.3\n"))?;
//! assert_eq!(std::fs::read_to_string(&path)?, "0 0 0.3\n");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod atomic_file;
pub mod false_candidates;
pub mod grey;
pub mod limits;
pub mod new_folder;
pub mod npz;
pub mod outcome;
pub mod png_encoding;
pub mod text_file;
