//! What all pages share: the style of the dashboard, and how a text becomes HTML.

/// Colours and styles of the dashboard and of all pages.
pub(crate) const COMMON_STYLE: &str = include_str!("../../../monitor/page/common.css");

/// Head, summary and foot of a page without scripts.
pub(crate) const FRAME_STYLE: &str = include_str!("frame.css");

/// Escapes a text for HTML, also within a quoted attribute.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
