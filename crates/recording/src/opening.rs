//! Origin of a recording: computer, time, and the metadata at its start.

use std::collections::BTreeMap;

use serde::Serialize;

use fringeflow::correspondence::Fingerprint;
use fringeflow_dataset::Setup;

use crate::wall_clock::monotonic_ns;
use crate::{FORMAT_VERSION, WallClock};

/// Computer and time at the start of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Origin {
    /// Name of the host.
    pub host: String,
    /// Release of the kernel.
    pub kernel: String,
    /// Model of the CPU.
    pub cpu: String,
    /// Wall clock, nanoseconds since 1970.
    pub started_unix_ns: u64,
    /// `CLOCK_MONOTONIC` at the same time. All time stamps of messages use this clock.
    pub started_ns: u64,
}

impl Origin {
    /// Returns this computer and the current time.
    #[must_use]
    pub fn here() -> Self {
        let line = |path: &str| std::fs::read_to_string(path).map(|text| text.trim().to_owned()).unwrap_or_default();
        let cpus = line("/proc/cpuinfo");
        let model = cpus.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
        let started_ns = monotonic_ns();
        Self {
            host: line("/proc/sys/kernel/hostname"),
            kernel: line("/proc/sys/kernel/osrelease"),
            cpu: model.map(|(_, name)| name.to_owned()).unwrap_or_default(),
            started_unix_ns: WallClock::here().unix_ns(started_ns),
            started_ns,
        }
    }

    /// Converts a time of `CLOCK_MONOTONIC` to the wall clock, Unix milliseconds.
    #[must_use]
    pub fn unix_ms(&self, time_ns: u64) -> f64 {
        self.wall_clock().unix_ns(time_ns) as f64 * 1e-6
    }

    /// Relation of the clocks at the start of the recording.
    #[must_use]
    pub fn wall_clock(&self) -> WallClock {
        WallClock::from_reading(self.started_ns, self.started_unix_ns)
    }

    /// Returns the metadata of a recording with this setup.
    pub(super) fn metadata(&self, setup: &Setup) -> BTreeMap<String, String> {
        let volume = setup.volume.as_ref();
        let table = volume.map(|volume| Fingerprint::new(&setup.rig, volume, &setup.sequence.pattern).to_string());
        let [width, height] = setup.image_size_px;
        let entries = [
            ("format", FORMAT_VERSION.to_string()),
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("host", self.host.clone()),
            ("kernel", self.kernel.clone()),
            ("cpu", self.cpu.clone()),
            ("started_unix_ns", self.started_unix_ns.to_string()),
            ("started_ns", self.started_ns.to_string()),
            ("segment_table", table.unwrap_or_default()),
            ("width_px", width.to_string()),
            ("height_px", height.to_string()),
            ("steps", setup.steps.to_string()),
        ];
        entries.map(|(key, value)| (key.to_owned(), value)).into()
    }

    /// Reads the metadata of a recording. Missing entries are left empty.
    pub(super) fn from_metadata(metadata: &BTreeMap<String, String>) -> Self {
        let text = |key: &str| metadata.get(key).cloned().unwrap_or_default();
        let number = |key: &str| text(key).parse().unwrap_or_default();
        Self {
            host: text("host"),
            kernel: text("kernel"),
            cpu: text("cpu"),
            started_unix_ns: number("started_unix_ns"),
            started_ns: number("started_ns"),
        }
    }
}
