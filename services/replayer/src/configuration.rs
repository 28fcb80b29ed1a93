//! The configuration of a replay: the recorded one, with the recording in place of cameras and projector.

use toml::{Table, Value};

use fringeflow_config::{PriorSource, rename_former_keys};
use fringeflow_message::FrameHeader;
use fringeflow_recording::{Recording, Topic};

use crate::Pace;

/// Image rate of a recording with too few images to determine it.
const DEFAULT_RATE_HZ: f64 = 30.0;

/// Why the configuration of a replay cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ConfigurationTextError {
    /// The recorded configuration is not valid TOML.
    #[error("the recorded configuration.toml cannot be read: {0}")]
    Unreadable(#[from] toml::de::Error),
    /// The new configuration cannot be written as TOML.
    #[error("the configuration of the replay cannot be written: {0}")]
    Unwritable(#[from] toml::ser::Error),
}

/// Returns the text of the configuration for a replay of `recording` in the instance `name`.
///
/// # Errors
/// The recorded configuration is not valid TOML.
pub fn replay_configuration(recording: &Recording, name: &str, pace: Pace) -> Result<String, ConfigurationTextError> {
    let mut table: Table = recording.configuration_text().parse()?;
    rename_former_keys(&mut table);
    // The setup comes from the recording too. The processors are those of the machine that made the recording.
    for section in ["rig", "virtual_scanner", "recorder", "processors"] {
        table.remove(section);
    }
    let rate_hz = rate_hz(recording);
    let max_skew_us = max_skew_us(table.get("cameras"), rate_hz);
    // Nothing else about the cameras applies: the recorded images are already converted, cropped and binned.
    table.remove("cameras");
    let driver = if recording.count(Topic::Pattern) > 0 { "external" } else { "cycle" };
    let when_busy = if pace == Pace::Fastest { "wait" } else { "skip" };
    set(&mut table, "instance", "name", name.into());
    set(&mut table, "cameras", "source", "external".into());
    set(&mut table, "cameras", "format", recording.pixel_format().name().into());
    set(&mut table, "cameras", "rate_hz", rate_hz.into());
    set(&mut table, "cameras", "max_skew_us", max_skew_us.into());
    set(&mut table, "projector", "driver", driver.into());
    set(&mut table, "window", "when_busy", when_busy.into());
    // The windows get the recorded priors, or none.
    let prior = if recording.count(Topic::Prior) > 0 { PriorSource::External } else { PriorSource::Off };
    set(&mut table, "tracking", "prior", prior.name().into());
    Ok(toml::to_string(&table)?)
}

fn set(table: &mut Table, section: &str, key: &str, value: Value) {
    // Any other value than a table is invalid, and the services report it.
    if let Value::Table(section) = table.entry(section).or_insert_with(|| Value::Table(Table::new())) {
        section.insert(key.to_owned(), value);
    }
}

/// Returns the limit of the skew that the recording states. Recordings of before had no limit but half of the period,
/// which the present rate may state a little shorter.
fn max_skew_us(recorded: Option<&Value>, rate_hz: f64) -> f64 {
    let half_period_us = 5e5 / rate_hz;
    let stated = recorded.and_then(|cameras| cameras.get("max_skew_us"));
    let stated = stated.and_then(|value| value.as_float().or_else(|| value.as_integer().map(|us| us as f64)));
    stated.map_or(half_period_us, |us| us.min(half_period_us))
}

/// Returns the image rate of a camera, from the median time between two exposures.
fn rate_hz(recording: &Recording) -> f64 {
    let mut times: Vec<u64> = recording.frame_headers(1).map(|header: &FrameHeader| header.exposure_start_ns).collect();
    times.sort_unstable();
    let mut gaps: Vec<u64> = times.windows(2).filter_map(|pair| pair.last()?.checked_sub(*pair.first()?)).collect();
    gaps.sort_unstable();
    let median = gaps.get(gaps.len() / 2).filter(|&&gap| gap > 0);
    median.map_or(DEFAULT_RATE_HZ, |&gap_ns| (1e9 / gap_ns as f64).clamp(0.1, 1000.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_the_skew_is_the_recorded_one_or_half_of_the_period() {
        let cameras = |text: &str| Value::Table(text.parse::<Table>().unwrap());
        let stated = cameras("source = \"v4l2\"\nmax_skew_us = 250.5");
        assert_eq!(max_skew_us(Some(&stated), 50.0), 250.5);
        assert_eq!(max_skew_us(Some(&cameras("max_skew_us = 250")), 50.0), 250.0);
        // The rate that the recorded images have may be a little higher than the configured one.
        assert_eq!(max_skew_us(Some(&cameras("max_skew_us = 10200.0")), 50.0), 10_000.0);
        assert_eq!(max_skew_us(Some(&cameras("source = \"v4l2\"")), 50.0), 10_000.0);
        assert_eq!(max_skew_us(None, 50.0), 10_000.0);
    }
}
