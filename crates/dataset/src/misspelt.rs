//! Misspelt fields of `meta.json`. Other fields are notes of whoever made the file, and are left alone.

use serde_json::Value;

use super::error::Problem;

/// The fields of each object of `meta.json`, by its name.
const KNOWN: [(&str, &[&str]); 7] = [
    (
        "",
        &[
            "name",
            "unit",
            "image_size",
            "readout",
            "bits",
            "source",
            "steps",
            "phase_shift_rad",
            "period_px",
            "phase_sign",
            "phase_offset_rad",
            "gray",
            "second_direction",
            "volume",
            "motion",
        ],
    ),
    ("second_direction", &["phase_shift_rad", "period_px", "phase_sign", "phase_offset_rad", "gray"]),
    ("gray", &["images", "cell_periods"]),
    ("volume", &["R_v", "T_v", "R_v_exact", "T_v_exact", "min", "max"]),
    ("readout", &["sensor_size", "region", "binning"]),
    ("motion", &["Rm", "tm", "t_ref"]),
    ("source", &["format", "bayer", "stereo_layout"]),
];

/// Refuses a field whose name resembles that of a known one.
///
/// # Errors
/// [`Problem::Misspelt`].
pub(super) fn check(text: &str) -> Result<(), Problem> {
    // A text that is not JSON is refused with its line where it is read.
    serde_json::from_str(text).map_or(Ok(()), |value| check_object("", "", &value))
}

/// Checks the fields of an object. `path` is its name with those of the objects around it.
fn check_object(name: &str, path: &str, value: &Value) -> Result<(), Problem> {
    let Value::Object(fields) = value else { return Ok(()) };
    let Some((_, known)) = KNOWN.iter().find(|(object, _)| *object == name) else { return Ok(()) };
    for (field, value) in fields {
        let path = if path.is_empty() { field.clone() } else { format!("{path}.{field}") };
        if known.contains(&field.as_str()) {
            check_object(field, &path, value)?;
        } else if let Some(meant) = known.iter().find(|known| resembles(field, known)) {
            return Err(Problem::Misspelt { field: path, meant });
        }
    }
    Ok(())
}

/// Whether two names differ in a few letters only, or in capitals and underscores.
fn resembles(field: &str, known: &str) -> bool {
    let [field, known] = [field, known].map(|name| name.to_lowercase().replace(['_', '-', ' '], ""));
    strsim::osa_distance(&field, &known) <= (known.chars().count() / 4).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_that_resemble_known_ones_are_refused_and_notes_are_not() {
        for (text, refused) in [
            (r#"{ "bit": 12 }"#, Some(("bit", "bits"))),
            (r#"{ "phase_Sign": 1 }"#, Some(("phase_Sign", "phase_sign"))),
            (r#"{ "phase_shifts_rad": [] }"#, Some(("phase_shifts_rad", "phase_shift_rad"))),
            (r#"{ "volume": { "Rv": 1, "note": "" } }"#, Some(("volume.Rv", "R_v"))),
            (r#"{ "gray": { "cell_period": 1 } }"#, Some(("gray.cell_period", "cell_periods"))),
            (r#"{ "note": "", "pattern": "", "noise": {}, "truth": "", "seed": 1, "rate_hz": 9 }"#, None),
            (r#"{ "motion": { "model": "", "mm_per_image": 1 }, "n_phase_images": 4, "scene": "nose" }"#, None),
        ] {
            match (check(text), refused) {
                (Ok(()), None) => {}
                (Err(Problem::Misspelt { field, meant }), Some(expected)) => {
                    assert_eq!((field.as_str(), meant), expected);
                }
                (result, _) => panic!("{text}: {result:?}"),
            }
        }
    }
}
