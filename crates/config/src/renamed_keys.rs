//! Former names of keys: refused in files with a hint, and renamed in recordings.

use toml::{Table, Value};

use super::ConfigurationProblem;

/// Refuses a former key. Accepts text that is not TOML: the parser will report the position of the error.
pub(super) fn refuse_former_keys(text: &str) -> Result<(), ConfigurationProblem> {
    let Ok(table) = text.parse::<Table>() else { return Ok(()) };
    let former = table.get("correspondence").and_then(|section| section.get("drift_alarm_rad"));
    former.map_or(Ok(()), |value| {
        Err(ConfigurationProblem::Value {
            key: "correspondence.drift_alarm_rad",
            value: value.to_string(),
            expected: "this key was replaced: write drift_rad = { warn = … } in table [health]",
        })
    })
}

/// Renames the former keys of a recorded configuration.
pub fn rename_former_keys(recorded: &mut Table) {
    let Some(Value::Table(correspondence)) = recorded.get_mut("correspondence") else { return };
    let Some(warn) = correspondence.remove("drift_alarm_rad") else { return };
    // The former key had no `bad` limit.
    let bad = warn.as_float().map_or(Value::Float(1.0), |warn| Value::Float((2.0 * warn).max(0.2)));
    let limits = Table::from_iter([("warn".to_owned(), warn), ("bad".to_owned(), bad)]);
    let health = recorded.entry("health").or_insert_with(|| Value::Table(Table::new()));
    if let Value::Table(health) = health {
        health.entry("drift_rad").or_insert(Value::Table(limits));
    }
}

/// Returns the text of a recorded configuration with the current names of keys.
pub(super) fn with_current_names(recorded: &str) -> Result<String, ConfigurationProblem> {
    let mut table: Table = recorded.parse()?;
    rename_former_keys(&mut table);
    Ok(table.to_string())
}
