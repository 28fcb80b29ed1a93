//! Progress bars on standard error.

use indicatif::{ProgressBar, ProgressStyle};

/// Starts a progress bar over `steps` steps; it is hidden if standard error is no terminal.
pub(crate) fn bar(title: &'static str, steps: u64) -> ProgressBar {
    let bar = ProgressBar::new(steps).with_message(title);
    if let Ok(style) = ProgressStyle::with_template("{msg:24} {wide_bar} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar
}
