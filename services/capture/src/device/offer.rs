//! The formats, image sizes and frame rates that a device offers.
//!
//! A driver is queried for one item after the other until it refuses. The lists are bounded, whatever the driver
//! answers.

use std::fmt;

use v4l::v4l_sys::{V4L2_FMT_FLAG_EMULATED, v4l2_fmtdesc, v4l2_fract, v4l2_frmivalenum, v4l2_frmsizeenum};

use fringeflow_pixels::SourceFormat;

use crate::ioctl::{
    Device, ENUM_FMT, ENUM_FRAMEINTERVALS, ENUM_FRAMESIZES, Request, frame_intervals, frame_sizes, zeroed,
};

use super::capability::text;

/// Maximum number of items that are read from a list.
const MAX_ITEMS: u32 = 128;

/// Bit of a format code: the bytes of a value are in reverse order.
const BIG_ENDIAN: u32 = 1 << 31;
/// Maximum number of sizes in the text of a format.
const MAX_SIZES_IN_TEXT: usize = 12;

/// A pixel format.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct OfferedFormat {
    /// Four-character code.
    pub name: String,
    /// Name that the driver gives it.
    pub description: String,
    /// Whether Fringeflow can use it.
    pub is_taken: bool,
    /// Whether a library on this machine makes it instead of the device.
    pub is_emulated: bool,
    /// Its sizes; empty if the driver does not list them.
    pub sizes: Vec<OfferedSize>,
}

/// An image size, or a range of sizes.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct OfferedSize {
    /// Least width and height, pixels.
    pub least_px: [u32; 2],
    /// Greatest width and height, pixels.
    pub greatest_px: [u32; 2],
    /// Ranges of the frame rate at the greatest size, from slowest to fastest; empty if the driver does not list them.
    pub rates_hz: Vec<[f64; 2]>,
}

/// Lists the formats of a buffer type, with their sizes and rates.
pub(crate) fn list_formats(device: &Device, kind: u32) -> Vec<OfferedFormat> {
    let description = |index| v4l2_fmtdesc { index, type_: kind, ..zeroed() };
    let found = enumerate(device, &ENUM_FMT, description);
    let format = |found: v4l2_fmtdesc| OfferedFormat {
        name: format_name(found.pixelformat),
        description: text(&found.description),
        is_taken: SourceFormat::from_code(found.pixelformat).is_some(),
        is_emulated: found.flags & V4L2_FMT_FLAG_EMULATED != 0,
        sizes: list_sizes(device, found.pixelformat),
    };
    found.into_iter().map(format).collect()
}

fn list_sizes(device: &Device, format: u32) -> Vec<OfferedSize> {
    let size = |index| v4l2_frmsizeenum { index, pixel_format: format, ..zeroed() };
    let offered = |found: v4l2_frmsizeenum| {
        let [least, greatest] = frame_sizes(&found).map(|size| [size.width, size.height]);
        OfferedSize { least_px: least, greatest_px: greatest, rates_hz: list_rates(device, format, greatest) }
    };
    enumerate(device, &ENUM_FRAMESIZES, size).into_iter().map(offered).collect()
}

/// Lists the ranges of the frame rate at a format and size, from slowest to fastest.
pub(crate) fn list_rates(device: &Device, format: u32, [width, height]: [u32; 2]) -> Vec<[f64; 2]> {
    let interval = |index| v4l2_frmivalenum { index, pixel_format: format, width, height, ..zeroed() };
    let range = |found: v4l2_frmivalenum| {
        let [shortest, longest] = frame_intervals(&found).map(rate_hz);
        [longest?, shortest?].into()
    };
    enumerate(device, &ENUM_FRAMEINTERVALS, interval).into_iter().filter_map(range).collect()
}

/// Returns the frame rate of a frame interval; `None` if the interval is invalid.
pub(crate) fn rate_hz(interval: v4l2_fract) -> Option<f64> {
    let is_valid = interval.numerator > 0 && interval.denominator > 0;
    is_valid.then(|| f64::from(interval.denominator) / f64::from(interval.numerator))
}

/// Reads the items of an enumeration, from index 0 until the driver refuses one.
pub(crate) fn enumerate<T: Copy>(device: &Device, request: &Request<T>, item: impl Fn(u32) -> T) -> Vec<T> {
    let answer = |index| {
        let mut item = item(index);
        device.call(request, &mut item).ok().map(|()| item)
    };
    (0..MAX_ITEMS).map_while(answer).collect()
}

/// Returns the name of a format: the four characters of its code, with `_BE` for [`BIG_ENDIAN`].
pub(crate) fn format_name(code: u32) -> String {
    let letters = text(&(code & !BIG_ENDIAN).to_le_bytes());
    if code & BIG_ENDIAN != 0 { letters + "_BE" } else { letters }
}

/// Describes the usable formats and their sizes in one line.
pub(crate) fn formats_text(formats: &[OfferedFormat]) -> String {
    let usable: Vec<&OfferedFormat> = formats.iter().filter(|format| format.is_taken).collect();
    // Consecutive formats often have the same sizes.
    let groups = usable.chunk_by(|a, b| a.sizes == b.sizes);
    let group = |group: &[&OfferedFormat]| {
        let names: Vec<&str> = group.iter().map(|format| format.name.as_str()).collect();
        let sizes = group.first().map_or(&[][..], |format| &format.sizes[..]);
        format!("{} in {}", names.join(", "), sizes_text(sizes))
    };
    let groups: Vec<String> = groups.map(group).collect();
    if groups.is_empty() { "no supported format".to_owned() } else { groups.join("; ") }
}

fn sizes_text(sizes: &[OfferedSize]) -> String {
    let shown = sizes.iter().take(MAX_SIZES_IN_TEXT).map(OfferedSize::to_string);
    let more = sizes.len().saturating_sub(MAX_SIZES_IN_TEXT);
    let more = (more > 0).then(|| format!("{more} more sizes"));
    let sizes: Vec<String> = shown.chain(more).collect();
    if sizes.is_empty() { "unlisted sizes".to_owned() } else { sizes.join(", ") }
}

/// Formats ranges of the frame rate in one line.
#[must_use]
pub fn rates_text(rates_hz: &[[f64; 2]]) -> String {
    let rate = |&[slowest, fastest]: &[f64; 2]| match slowest == fastest {
        true => rate_text(fastest),
        false => format!("{} to {}", rate_text(slowest), rate_text(fastest)),
    };
    rates_hz.iter().map(rate).collect::<Vec<_>>().join(", ")
}

/// Formats a rate with at most three decimals.
pub(crate) fn rate_text(rate_hz: f64) -> String {
    format!("{}", (rate_hz * 1e3).round() / 1e3)
}

impl fmt::Display for OfferedSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [[width, height], [to_width, to_height]] = [self.least_px, self.greatest_px];
        write!(f, "{width}x{height}")?;
        if self.least_px == self.greatest_px { Ok(()) } else { write!(f, " to {to_width}x{to_height}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offered_formats_are_described_in_one_line() {
        let size =
            |width, height| OfferedSize { least_px: [width, height], greatest_px: [width, height], rates_hz: vec![] };
        let range = OfferedSize { least_px: [16, 16], greatest_px: [1920, 1080], rates_hz: vec![] };
        let format = |name: &str, sizes| OfferedFormat {
            name: name.into(),
            description: String::new(),
            is_taken: name != "RGB3",
            is_emulated: false,
            sizes,
        };
        let two = vec![size(640, 480), size(1280, 1024)];
        let offered = [
            format("GREY", two.clone()),
            format("RGB3", vec![]),
            format("Y10", two),
            format("Y12", vec![range]),
            format("MJPG", vec![]),
        ];
        let expected = "GREY, Y10 in 640x480, 1280x1024; Y12 in 16x16 to 1920x1080; MJPG in unlisted sizes";
        assert_eq!(formats_text(&offered), expected);
        assert_eq!(formats_text(&offered[1..2]), "no supported format");
        assert!(formats_text(&[format("GREY", vec![size(1, 1); 20])]).ends_with("1x1, 8 more sizes"));
        assert_eq!(rates_text(&[[30.0, 30.0], [1.0, 59.940_06]]), "30, 1 to 59.94");
    }

    #[test]
    fn an_invalid_interval_has_no_rate() {
        let rate = |numerator, denominator| rate_hz(v4l2_fract { numerator, denominator });
        assert_eq!((rate(1, 30), rate(0, 30), rate(1, 0)), (Some(30.0), None, None));
    }

    #[test]
    fn every_format_code_has_a_name() {
        assert_eq!(format_name(u32::from_le_bytes(*b"Y10 ")), "Y10");
        assert_eq!(format_name(u32::from_le_bytes(*b"RG24")), "RG24");
        assert_eq!(format_name(0), "");
        assert_eq!(format_name(SourceFormat::Y16BigEndian.code()), SourceFormat::Y16BigEndian.name());
        assert_eq!(format_name(u32::MAX), "\u{fffd}".repeat(3) + "\u{fffd}_BE");
    }
}
