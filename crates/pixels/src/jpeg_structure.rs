//! Checks the structure of a JPEG image before it is decoded.
//!
//! In: arbitrary bytes. Out: the length of the image. The check accepts only one complete baseline image of the
//! expected size in one scan, as cameras send it. So the decoder never fills up missing parts, and a small file cannot
//! claim much memory. Padding of the driver may follow the image.

use super::error::UnpackError;

const START: u8 = 0xd8;
const END: u8 = 0xd9;
const START_OF_SCAN: u8 = 0xda;
/// Start of a frame: baseline and extended sequential, Huffman coded.
const SEQUENTIAL: [u8; 2] = [0xc0, 0xc1];
/// Start of a frame of any kind, including progressive, lossless and arithmetic coding.
const FRAMES: std::ops::RangeInclusive<u8> = 0xc0..=0xcf;
/// Markers in this range that do not start a frame: Huffman tables, an extension, arithmetic coding conditioning.
const NOT_FRAMES: [u8; 3] = [0xc4, 0xc8, 0xcc];
/// Restart markers in a scan.
const RESTARTS: std::ops::RangeInclusive<u8> = 0xd0..=0xd7;

/// Checks an image of the expected size and returns its length, start to end, in bytes.
///
/// # Errors
/// [`UnpackError::JpegSize`], or [`UnpackError::Jpeg`] if the image is truncated or does not consist of one scan.
pub(super) fn check(bytes: &[u8], expected_px: [usize; 2]) -> Result<usize, UnpackError> {
    let mut parts = Parts { rest: bytes };
    if parts.marker()? != START {
        return Err(broken("it does not begin with FF D8"));
    }
    // Before the only scan there are tables and exactly one sequential frame, in any order.
    let mut components = None;
    loop {
        match parts.marker()? {
            START_OF_SCAN => break,
            marker if SEQUENTIAL.contains(&marker) => {
                if components.replace(frame(parts.segment()?, expected_px)?).is_some() {
                    return Err(broken("it has two frames"));
                }
            }
            marker if FRAMES.contains(&marker) && !NOT_FRAMES.contains(&marker) => {
                return Err(UnpackError::Jpeg(format!("it is coded as SOF{}; cameras send SOF0", marker & 0x0f)));
            }
            marker if marker == START || marker == END || RESTARTS.contains(&marker) => {
                return Err(broken("it has an unexpected marker before the scan"));
            }
            _ => drop(parts.segment()?),
        }
    }
    if components.is_none() || parts.segment()?.first().copied() != components {
        return Err(broken("its first scan does not contain all components"));
    }
    parts.scan()?;
    Ok(bytes.len() - parts.rest.len())
}

/// Returns the number of colour components of a frame; checks that it has the expected size.
fn frame(segment: &[u8], expected_px: [usize; 2]) -> Result<u8, UnpackError> {
    let &[bits, height1, height0, width1, width0, components, ..] = segment else {
        return Err(broken("its frame is truncated"));
    };
    let found_px = [[width1, width0], [height1, height0]].map(|side| usize::from(u16::from_be_bytes(side)));
    if found_px != expected_px {
        return Err(UnpackError::JpegSize { found_px, expected_px });
    }
    if bits != 8 || !(components == 1 || components == 3) {
        return Err(UnpackError::Jpeg(format!(
            "it has {components} components of {bits} bits; cameras send 1 or 3 of 8"
        )));
    }
    Ok(components)
}

/// The part of an image that is not read yet.
struct Parts<'a> {
    rest: &'a [u8],
}

impl<'a> Parts<'a> {
    /// Reads the next marker. Any number of FF bytes may precede it.
    fn marker(&mut self) -> Result<u8, UnpackError> {
        let after = self.rest.strip_prefix(&[0xff]).ok_or_else(|| broken("a marker is missing"))?;
        let fill = after.iter().take_while(|&&byte| byte == 0xff).count();
        let (&marker, rest) = after.get(fill..).and_then(<[u8]>::split_first).ok_or_else(truncated)?;
        self.rest = rest;
        Ok(marker)
    }

    /// Reads the segment of the marker just read, without its length.
    fn segment(&mut self) -> Result<&'a [u8], UnpackError> {
        let (&length, _) = self.rest.split_first_chunk::<2>().ok_or_else(truncated)?;
        let (segment, rest) = self.rest.split_at_checked(u16::from_be_bytes(length).into()).ok_or_else(truncated)?;
        self.rest = rest;
        segment.get(2..).ok_or_else(|| broken("a segment has no length"))
    }

    /// Skips the scan and the end marker that must follow it.
    fn scan(&mut self) -> Result<(), UnpackError> {
        loop {
            let start = self.rest.iter().position(|&byte| byte == 0xff).ok_or_else(truncated)?;
            let rest = self.rest.get(start..).unwrap_or_default();
            let &marker = rest.get(1).ok_or_else(truncated)?;
            // FF FF: the second byte may be the start of a marker.
            let skipped = if marker == 0xff { 1 } else { 2 };
            self.rest = rest.get(skipped..).unwrap_or_default();
            match marker {
                END => return Ok(()),
                0 | 0xff => {}
                marker if RESTARTS.contains(&marker) => {}
                _ => return Err(broken("it has more than one scan, or an unexpected marker in the scan")),
            }
        }
    }
}

fn broken(what: &str) -> UnpackError {
    UnpackError::Jpeg(what.to_owned())
}

fn truncated() -> UnpackError {
    broken("it is truncated")
}
