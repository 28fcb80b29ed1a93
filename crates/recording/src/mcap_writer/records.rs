//! Parts of records. Numbers are little-endian; texts and maps are preceded by their length in bytes.

use std::collections::BTreeMap;

/// Adds a record: opcode, length of the content, content.
pub(super) fn push_record(out: &mut Vec<u8>, opcode: u8, content: impl FnOnce(&mut Vec<u8>)) {
    out.push(opcode);
    push_counted(out, content, u64::to_le_bytes);
}

/// Adds a text.
pub(super) fn push_string(out: &mut Vec<u8>, text: &str) {
    push_counted(out, |out| out.extend(text.as_bytes()), short);
}

/// Adds a map of texts.
pub(super) fn push_map(out: &mut Vec<u8>, entries: &BTreeMap<String, String>) {
    let content = |out: &mut Vec<u8>| {
        for (key, value) in entries {
            push_string(out, key);
            push_string(out, value);
        }
    };
    push_counted(out, content, short);
}

/// Adds a map of numbers.
pub(super) fn push_numbers(out: &mut Vec<u8>, entries: &BTreeMap<u16, u64>) {
    let content = |out: &mut Vec<u8>| {
        for (key, value) in entries {
            out.extend(key.to_le_bytes());
            out.extend(value.to_le_bytes());
        }
    };
    push_counted(out, content, short);
}

/// Adds content preceded by its length.
pub(super) fn push_counted<const N: usize>(
    out: &mut Vec<u8>,
    content: impl FnOnce(&mut Vec<u8>),
    length: impl FnOnce(u64) -> [u8; N],
) {
    let start = out.len();
    out.extend([0; N]);
    content(out);
    let bytes = length((out.len() - start - N) as u64);
    out[start..start + N].copy_from_slice(&bytes);
}

/// Converts a length to 32 bits, which is enough for every part that has one.
pub(super) fn short(length: u64) -> [u8; 4] {
    (length as u32).to_le_bytes()
}
