//! `cameras.max_skew_us`: how far apart the exposures of an image pair may start.
//!
//! A recording states the limit of its scan, so that a replay makes the same pairs. Recordings of programs that did not
//! know the limit do not state it; their pairs were limited by half of the frame period alone.

use toml::{Table, Value};

use super::ConfigurationProblem;
use super::raw::{RawConfiguration, checked};
use super::renamed_keys::with_current_names;

/// Default limit in frame periods: at rest no limit matters, and cameras with a common trigger are far below it.
const DEFAULT_PERIODS: f64 = 0.05;
/// Largest limit in frame periods. Beyond it the image has another partner that is nearer.
const MAX_PERIODS: f64 = 0.5;
/// Relative tolerance of the largest limit: a period in decimals is rounded.
const TOLERANCE: f64 = 1e-6;

/// Reads the limit in nanoseconds. `rate_hz` is already checked.
pub(super) fn max_skew_ns(max_skew_us: Option<f64>, rate_hz: f64) -> Result<u64, ConfigurationProblem> {
    let period_us = 1e6 / rate_hz;
    let max_us = MAX_PERIODS * period_us;
    let us = checked(
        "cameras.max_skew_us",
        max_skew_us.unwrap_or(DEFAULT_PERIODS * period_us),
        |&us| us >= 1e-3 && us <= max_us * (1.0 + TOLERANCE),
        "it must be above 0 and at most half of the frame period, 500000 / rate_hz",
    )?;
    let frame_period_ns = (1e9 / rate_hz) as u64;
    Ok(((us * 1e3).round() as u64).min(frame_period_ns / 2))
}

/// Returns the limit that a recorded configuration states, nanoseconds; `None` if it states none.
///
/// # Errors
/// The text is not a valid configuration.
pub fn recorded_max_skew_ns(recorded: &str) -> Result<Option<u64>, ConfigurationProblem> {
    let raw = RawConfiguration::parse(&with_current_names(recorded)?)?;
    let Some(cameras) = &raw.cameras else { return Ok(None) };
    cameras.max_skew_us.map(|us| max_skew_ns(Some(us), cameras.rate_hz)).transpose()
}

/// Returns the text of a configuration with the limit stated in it. The rest of the text stays as it is, if the table
/// of the cameras has a line of its own.
pub(super) fn with_max_skew(text: &str, max_skew_ns: u64) -> String {
    let Ok(mut table) = text.parse::<Table>() else { return text.to_owned() };
    let Some(Value::Table(cameras)) = table.get_mut("cameras") else { return text.to_owned() };
    let max_skew_us = max_skew_ns as f64 / 1e3;
    // The images of one device are exposed together, and the key does not apply to them.
    if ["max_skew_us", "both"].iter().any(|key| cameras.contains_key(*key)) {
        return text.to_owned();
    }
    cameras.insert("max_skew_us".to_owned(), max_skew_us.into());
    let is_header = |line: &&str| line.split('#').next().is_some_and(|code| code.trim() == "[cameras]");
    let with_line = |header: &str| text.replacen(header, &format!("{header}\nmax_skew_us = {max_skew_us:?}"), 1);
    // A line that looks like the header may be part of a text.
    let edited = text.lines().find(is_header).map(with_line);
    edited.filter(|edited| edited.parse::<Table>().is_ok_and(|read| read == table)).unwrap_or_else(|| table.to_string())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::ScannerConfiguration;

    const EXTERNAL: &str = "# A comment.\n[cameras] # another\nsource = \"external\"\nrate_hz = 30.0\n";

    fn parse(text: &str) -> Result<ScannerConfiguration, String> {
        ScannerConfiguration::parse(text, Path::new("/")).map_err(|e| e.to_string())
    }

    #[test]
    fn the_default_is_a_twentieth_of_the_period_and_the_largest_value_is_half_of_it() {
        let with = |line: &str| parse(&format!("{EXTERNAL}{line}\n"));
        assert_eq!(with("").unwrap().max_skew_ns, 1_666_667);
        assert_eq!(with("max_skew_us = 250").unwrap().max_skew_ns, 250_000);
        assert_eq!(with("max_skew_us = 16666.667").unwrap().max_skew_ns, 16_666_666);
        for bad in ["0", "0.0", "-1", "nan", "inf", "16667"] {
            let error = with(&format!("max_skew_us = {bad}")).unwrap_err();
            assert!(error.contains("key cameras.max_skew_us is"), "{error}");
            assert!(error.contains("at most half of the frame period"), "{error}");
        }
    }

    #[test]
    fn a_recorded_text_states_the_limit_and_keeps_its_comments() {
        let recorded = parse(EXTERNAL).unwrap().recorded_text();
        let line = "[cameras] # another\nmax_skew_us = 1666.667\nsource";
        assert!(recorded.starts_with("# A comment.\n") && recorded.contains(line), "{recorded}");
        assert_eq!(parse(&recorded).unwrap().max_skew_ns, 1_666_667);
        assert_eq!(recorded_max_skew_ns(&recorded).unwrap(), Some(1_666_667));
        assert_eq!(parse(&recorded).unwrap().recorded_text(), recorded);
    }

    #[test]
    fn any_form_of_the_table_is_recorded() {
        let inline = "cameras = { source = \"external\", rate_hz = 30 }\n";
        let quoted =
            "[instance]\nname = \"\"\"\n[cameras]\n\"\"\"\n[\"cameras\"]\nsource = \"external\"\nrate_hz = 30\n";
        for text in [inline, quoted] {
            let recorded = with_max_skew(text, 1_000_000);
            assert_eq!(recorded_max_skew_ns(&recorded).unwrap(), Some(1_000_000), "{recorded}");
        }
    }

    #[test]
    fn recordings_of_before_state_no_limit() {
        assert_eq!(recorded_max_skew_ns(EXTERNAL).unwrap(), None);
        assert_eq!(recorded_max_skew_ns("[phase]\nmin_modulation_grey = 4.0\n").unwrap(), None);
        assert!(recorded_max_skew_ns(&format!("{EXTERNAL}max_skew_us = -1.0\n")).is_err());
    }
}
