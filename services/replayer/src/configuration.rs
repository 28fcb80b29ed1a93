//! The configuration of a replay: the recorded one, with the recording in the place of cameras and projector.

use toml::{Table, Value};

use fringeflow_config::{PriorSource, rename_former_keys};
use fringeflow_message::FrameHeader;
use fringeflow_recording::{Recording, Topic};

use crate::Pace;

/// Rate of a recording with too few images to tell, images a second.
const USUAL_RATE_HZ: f64 = 30.0;

/// Why there is no configuration for a replay.
#[derive(Debug, thiserror::Error)]
pub enum ConfigurationTextError {
    /// The recorded one is no TOML.
    #[error("the recorded configuration.toml cannot be read: {0}")]
    Unreadable(#[from] toml::de::Error),
    /// It cannot be written.
    #[error("the configuration of the replay cannot be written: {0}")]
    Unwritable(#[from] toml::ser::Error),
}

/// The text of the configuration under which `recording` is replayed in the instance `name`.
///
/// # Errors
/// The recorded configuration is no TOML.
pub fn replay_configuration(recording: &Recording, name: &str, pace: Pace) -> Result<String, ConfigurationTextError> {
    let mut table: Table = recording.configuration_text().parse()?;
    rename_former_keys(&mut table);
    // The setup comes from the recording, too; processors are those of the machine that recorded.
    for section in ["rig", "virtual_scanner", "recorder", "processors"] {
        table.remove(section);
    }
    // The recorded images are what was used of the cameras' images.
    if let Some(Value::Table(cameras)) = table.get_mut("cameras") {
        for key in ["region_px", "binning"] {
            cameras.remove(key);
        }
    }
    let driver = if recording.count(Topic::Pattern) > 0 { "external" } else { "cycle" };
    let when_busy = if pace == Pace::Fastest { "wait" } else { "skip" };
    set(&mut table, "instance", "name", name.into());
    set(&mut table, "cameras", "source", "external".into());
    set(&mut table, "cameras", "format", recording.pixel_format().name().into());
    set(&mut table, "cameras", "rate_hz", rate_hz(recording).into());
    set(&mut table, "projector", "driver", driver.into());
    set(&mut table, "window", "when_busy", when_busy.into());
    // Windows are told what they were told then.
    let prior = if recording.count(Topic::Prior) > 0 { PriorSource::External } else { PriorSource::Off };
    set(&mut table, "tracking", "prior", prior.name().into());
    Ok(toml::to_string(&table)?)
}

fn set(table: &mut Table, section: &str, key: &str, value: Value) {
    // No valid configuration has anything but a table there; the services say so.
    if let Value::Table(section) = table.entry(section).or_insert_with(|| Value::Table(Table::new())) {
        section.insert(key.to_owned(), value);
    }
}

/// Images a second and camera, by the usual time between two exposures.
fn rate_hz(recording: &Recording) -> f64 {
    let mut times: Vec<u64> = recording.frame_headers(1).map(|header: &FrameHeader| header.exposure_start_ns).collect();
    times.sort_unstable();
    let mut gaps: Vec<u64> = times.windows(2).filter_map(|pair| pair.last()?.checked_sub(*pair.first()?)).collect();
    gaps.sort_unstable();
    let median = gaps.get(gaps.len() / 2).filter(|&&gap| gap > 0);
    median.map_or(USUAL_RATE_HZ, |&gap_ns| (1e9 / gap_ns as f64).clamp(0.1, 1000.0))
}
