//! YAML and JSON of OpenCV.
//!
//! OpenCV writes `%YAML:1.0`, which is not a valid directive. When it appends to a file, it ends the document with
//! `...` and begins another. So the documents are read one by one and their fields collected.

use serde_saphyr::NonFiniteFloatPolicy;

use super::super::CalibrationProblem;
use super::Fields;

/// Parses all documents of a text.
pub(super) fn parse(text: &str) -> Result<Fields, CalibrationProblem> {
    let mut fields = Fields::new();
    // NaN and infinity pass here, so that the check of the values can name their field.
    let options = serde_saphyr::options! { non_finite_float_policy: NonFiniteFloatPolicy::PassThrough };
    for document in documents(text) {
        let parsed: Fields = serde_saphyr::from_str_with_options(&document, options.clone())
            .map_err(|e| CalibrationProblem::NotFileStorage(first_line(&e.to_string())))?;
        fields.extend(parsed);
    }
    Ok(fields)
}

/// Splits a text at its document marks. Drops directives and OpenCV's type tags: the shape of a value says the same.
fn documents(text: &str) -> Vec<String> {
    let mut documents = vec![String::new()];
    for line in text.lines() {
        let content = line.split(" #").next().unwrap_or_default().trim_end();
        match content {
            "---" | "..." => documents.push(String::new()),
            content if content.starts_with('%') => {}
            _ => {
                if let Some(last) = documents.last_mut() {
                    last.push_str(&line.replace("!!opencv-matrix", "").replace("!!opencv-nd-matrix", ""));
                    last.push('\n');
                }
            }
        }
    }
    documents.retain(|d| !d.trim().is_empty());
    documents
}

fn first_line(text: &str) -> String {
    text.lines().next().unwrap_or_default().to_owned()
}
