//! Text files as other people's editors and programs write them. In: a path. Out: its text without a byte order mark,
//! or what the file is instead. Cost: one read.

use std::path::Path;

/// Beginnings of files that are not text, and what they are with the remedy.
const SIGNATURES: [(&[u8], &str); 8] = [
    (b"\x1f\x8b", "is compressed by gzip; unpack it (gunzip)"),
    (b"PK\x03\x04", "is a ZIP archive, such as .npz; write its values as text"),
    (b"\x93NUMPY", "is a NumPy array; write its values as text"),
    (b"MATLAB 5.0 MAT-file", "is a MATLAB file; write its values as text"),
    (b"\x89HDF\r\n", "is an HDF5 file, such as MATLAB 7.3 writes; write its values as text"),
    (b"\x89PNG", "is a PNG image"),
    (b"\xff\xfe", "is text in UTF-16; save it as UTF-8"),
    (b"\xfe\xff", "is text in UTF-16; save it as UTF-8"),
];

/// Why a file is not text.
#[derive(Debug, thiserror::Error)]
pub enum TextError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    /// The file is another kind of file.
    #[error("{0}")]
    OtherKind(&'static str),
    /// A byte is not UTF-8.
    #[error("is not text in UTF-8 (byte {offset}); save it as UTF-8")]
    NotUtf8 {
        /// Offset of the first such byte.
        offset: usize,
    },
}

/// Reads a text file. A byte order mark is left out.
///
/// # Errors
/// The file cannot be read, or is not text in UTF-8.
pub fn read_text(path: &Path) -> Result<String, TextError> {
    text_of(std::fs::read(path)?)
}

fn text_of(bytes: Vec<u8>) -> Result<String, TextError> {
    if let Some((_, kind)) = SIGNATURES.iter().find(|(signature, _)| bytes.starts_with(signature)) {
        return Err(TextError::OtherKind(kind));
    }
    let text = String::from_utf8(bytes).map_err(|e| TextError::NotUtf8 { offset: e.utf8_error().valid_up_to() })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_order_mark_is_left_out_and_other_files_are_told() {
        assert_eq!(text_of("\u{feff}K1: 1".into()).unwrap(), "K1: 1");
        assert_eq!(text_of("K1: 1".into()).unwrap(), "K1: 1");
        let utf16: Vec<u8> = "\u{feff}K1".encode_utf16().flat_map(u16::to_le_bytes).collect();
        for (bytes, told) in [
            (utf16, "UTF-16"),
            (b"\x1f\x8b\x08".to_vec(), "gzip"),
            (b"MATLAB 5.0 MAT-file, Platform".to_vec(), "MATLAB"),
            (b"Br\xe4uer".to_vec(), "byte 2"),
        ] {
            let error = text_of(bytes).unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
    }
}
