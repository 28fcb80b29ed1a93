//! Images of vivid cameras: formats, settings and losses.

mod formats;
mod losses;
mod settings;
