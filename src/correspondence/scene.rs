//! The inputs of the semi-global resolution.

use super::drift::Drift;
use super::view::View;

/// The inputs of matching, and the drift of these images.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) view: View<'a>,
    pub(super) drift: &'a Drift,
}
