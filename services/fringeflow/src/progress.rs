//! Progress bars on standard error; silent when it is piped.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar over `steps` of some work; hidden when standard error is no terminal.
pub(crate) fn bar(what: &'static str, steps: u64) -> ProgressBar {
    let bar = ProgressBar::new(steps).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg:24} {wide_bar} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar
}
