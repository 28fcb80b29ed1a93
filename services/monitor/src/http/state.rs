//! The state that all request handlers share.

use std::sync::Arc;

use crate::metrics::Metrics;
use crate::shared::Shared;

use super::guard::Guard;

/// State that all request handlers share.
#[derive(Clone)]
pub(super) struct ServerState {
    pub(super) shared: Arc<Shared>,
    pub(super) guard: Arc<Guard>,
    pub(super) metrics: Arc<Metrics>,
}
