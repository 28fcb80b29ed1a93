//! Health of the scanner at one window.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Maximum number of quantities in a report.
pub const GAUGES: usize = 32;

/// One quantity over the last windows, see `fringeflow_telemetry::health::Gauge`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.GaugeReport.1")]
pub struct GaugeReport {
    /// Level of the quantity; 0 while unknown.
    pub level: f64,
    /// Limit of the state "warn".
    pub warn: f64,
    /// Limit of the state "bad".
    pub bad: f64,
    /// Time of the last change of state; 0 while unknown.
    pub since_ns: u64,
    /// Code of the `fringeflow_telemetry::health::HealthState`.
    pub state: u32,
    /// 1 if the level is known, else 0.
    pub is_known: u32,
}

/// All quantities, in the order of `fringeflow_telemetry::health::Quantity::ALL`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.HealthReport.1")]
pub struct HealthReport {
    /// The quantities. Unused entries are zero.
    pub gauges: [GaugeReport; GAUGES],
}

impl GaugeReport {
    /// Returns the level, if it is known.
    #[must_use]
    pub fn known(&self) -> Option<f64> {
        (self.is_known != 0).then_some(self.level)
    }
}
