//! Files that OpenCV's FileStorage writes, as YAML, XML or JSON. In: a text. Out: its fields by name. Cost: one parse.
//!
//! | kind of value in OpenCV | form in the file | here |
//! |---|---|---|
//! | `cv::Mat`, `Matx`, numpy arrays | `!!opencv-matrix` with `rows`, `cols`, `dt`, `data` | [`Matrix`] |
//! | arrays of one dimension, of OpenCV 5 | `!!opencv-nd-matrix` with `sizes`, `dt`, `data` | [`Matrix`] |
//! | `Size`, `Vec`, `Point`, `std::vector` | a sequence of numbers | [`Matrix`] of one column |
//! | numbers, strings, maps, other sequences | themselves | told to people, not used |

mod node;
mod xml;
mod yaml;

pub(super) use node::{Matrix, Node};

use std::collections::BTreeMap;

use super::CalibrationProblem;

/// The fields of a file, by name.
pub(super) type Fields = BTreeMap<String, Node>;

/// Begins values that OpenCV has written in base64.
const BASE64: &str = "$base64$";

/// Parses the text of a file.
pub(super) fn parse(text: &str) -> Result<Fields, CalibrationProblem> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.contains(BASE64) {
        let what = "its values are in base64; write it without the flag FileStorage::BASE64";
        return Err(CalibrationProblem::NotFileStorage(what.to_owned()));
    }
    let is_xml = text.trim_start().starts_with('<');
    if is_xml { xml::parse(text) } else { yaml::parse(text) }
}
