//! The health of the scanner as of one window.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Quantities that a report has room for.
pub const GAUGES: usize = 32;

/// One quantity over the last windows, see `fringeflow_telemetry::health::Gauge`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.GaugeReport.1")]
pub struct GaugeReport {
    /// Its level; 0 while it is not known.
    pub level: f64,
    /// Limit beyond which it is a warning.
    pub warn: f64,
    /// Limit beyond which it is bad.
    pub bad: f64,
    /// When it came to its state; 0 while it is not known.
    pub since_ns: u64,
    /// Code of its `fringeflow_telemetry::health::HealthState`.
    pub state: u32,
    /// 1 where its level is known.
    pub is_known: u32,
}

/// All quantities, by their places in `fringeflow_telemetry::health::Quantity::ALL`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.HealthReport.1")]
pub struct HealthReport {
    /// The quantities; those from the last on are empty.
    pub gauges: [GaugeReport; GAUGES],
}

impl GaugeReport {
    /// Its level, where it is known.
    #[must_use]
    pub fn known(&self) -> Option<f64> {
        (self.is_known != 0).then_some(self.level)
    }
}
