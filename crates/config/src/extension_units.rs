//! `extension_units` of a camera: bytes for the extension units of a UVC device.
//!
//! In: entries `{ unit = 3, selector = 2, bytes = "01 00" }`. Out: the same, checked, in the order of the file.

use super::ConfigurationProblem;
use super::raw::{RawExtensionUnit, checked};

/// Maximum number of bytes of a setting. The longest that known cameras have is a block of 512 bytes.
const MAX_BYTES: usize = 4096;

/// A setting of an extension unit: a control of a UVC device that its driver maps to no V4L2 control.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExtensionUnitSetting {
    /// Number of the unit in the device.
    pub unit: u8,
    /// Number of the control in the unit.
    pub selector: u8,
    /// The value, as the device takes it.
    pub bytes: Vec<u8>,
}

pub(super) fn setting(raw: &RawExtensionUnit) -> Result<ExtensionUnitSetting, ConfigurationProblem> {
    let number = |key, number| checked(key, number, |n| *n > 0, "it must lie between 1 and 255");
    Ok(ExtensionUnitSetting {
        unit: number("extension_units.unit", raw.unit)?,
        selector: number("extension_units.selector", raw.selector)?,
        bytes: bytes(&raw.bytes)?,
    })
}

fn bytes(text: &str) -> Result<Vec<u8>, ConfigurationProblem> {
    let is_byte = |word: &str| word.len() == 2 && word.bytes().all(|digit| digit.is_ascii_hexdigit());
    let byte = |word| u8::from_str_radix(word, 16).ok().filter(|_| is_byte(word));
    let bytes: Option<Vec<u8>> = text.split_ascii_whitespace().map(byte).collect();
    bytes.filter(|bytes| (1..=MAX_BYTES).contains(&bytes.len())).ok_or_else(|| ConfigurationProblem::Value {
        key: "extension_units.bytes",
        value: format!("{text:?}"),
        expected: "it must hold 1 to 4096 bytes of two hexadecimal digits each, separated by spaces, such as \"01 0a\"",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<ExtensionUnitSetting, String> {
        let raw = toml::from_str(text).map_err(|e| e.to_string())?;
        setting(&raw).map_err(|e| e.to_string())
    }

    #[test]
    fn bytes_are_hexadecimal() {
        let read = parse("unit = 3\nselector = 2\nbytes = \" 01  fF 00\"").unwrap();
        assert_eq!(read, ExtensionUnitSetting { unit: 3, selector: 2, bytes: vec![1, 255, 0] });
    }

    #[test]
    fn malformed_entries_are_refused() {
        for bad in ["", " ", "1", "001", "0x01", "01,02", "g0", "+1", "é1", &"00 ".repeat(MAX_BYTES + 1)] {
            let error = parse(&format!("unit = 3\nselector = 2\nbytes = {bad:?}")).unwrap_err();
            assert!(
                error.contains("key extension_units.bytes is") && error.contains("two hexadecimal digits"),
                "{error}"
            );
        }
        let refused = |text: &str| parse(text).unwrap_err();
        assert!(refused("unit = 0\nselector = 2\nbytes = \"00\"").contains("key extension_units.unit is 0"));
        assert!(refused("unit = 1\nselector = 0\nbytes = \"00\"").contains("key extension_units.selector is 0"));
        assert!(refused("unit = 256\nselector = 1\nbytes = \"00\"").contains("256"));
        assert!(refused("unit = 1\nbytes = \"00\"").contains("selector"));
        assert!(refused("unit = 1\nselector = 1\nbyte = \"00\"").contains("byte"));
    }
}
