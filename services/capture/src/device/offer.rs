//! What a device offers: formats, their sizes, and the rates of each.
//!
//! Drivers are asked for item after item until they refuse; whatever they say, the lists end.

use std::fmt;

use v4l::v4l_sys::{V4L2_FMT_FLAG_EMULATED, v4l2_fmtdesc, v4l2_fract, v4l2_frmivalenum, v4l2_frmsizeenum};

use fringeflow_pixels::SourceFormat;

use crate::ioctl::{Device, ENUM_FMT, ENUM_FRAMEINTERVALS, ENUM_FRAMESIZES, Request, intervals, sizes, zeroed};

use super::capability::text;

/// Most items of a list that are read.
const MOST_ITEMS: u32 = 128;

/// Bit of a code.
const BIG_ENDIAN: u32 = 1 << 31;
/// Sizes of a format that a line for people names.
const SHOWN_SIZES: usize = 12;

/// A pixel format.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct OfferedFormat {
    /// Letters of its code.
    pub name: String,
    /// What the driver calls it.
    pub description: String,
    /// Whether cameras of Fringeflow can send it.
    pub is_taken: bool,
    /// Whether a library on this machine makes it, not the device.
    pub is_emulated: bool,
    /// Its sizes; empty where the driver does not list them.
    pub sizes: Vec<OfferedSize>,
}

/// A size of images, or a range of sizes.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct OfferedSize {
    /// Least width and height, pixels.
    pub least_px: [u32; 2],
    /// Greatest width and height, pixels.
    pub greatest_px: [u32; 2],
    /// Rates at the greatest size, slowest and fastest of each; empty where the driver does not list them.
    pub rates_hz: Vec<[f64; 2]>,
}

/// All that a kind of buffers can hold.
pub(crate) fn formats(device: &Device, kind: u32) -> Vec<OfferedFormat> {
    let description = |index| v4l2_fmtdesc { index, type_: kind, ..zeroed() };
    let found = list(device, &ENUM_FMT, description);
    let format = |found: v4l2_fmtdesc| OfferedFormat {
        name: format_name(found.pixelformat),
        description: text(&found.description),
        is_taken: SourceFormat::from_code(found.pixelformat).is_some(),
        is_emulated: found.flags & V4L2_FMT_FLAG_EMULATED != 0,
        sizes: offered_sizes(device, found.pixelformat),
    };
    found.into_iter().map(format).collect()
}

fn offered_sizes(device: &Device, format: u32) -> Vec<OfferedSize> {
    let size = |index| v4l2_frmsizeenum { index, pixel_format: format, ..zeroed() };
    let of = |found: v4l2_frmsizeenum| {
        let [least, greatest] = sizes(&found).map(|size| [size.width, size.height]);
        OfferedSize { least_px: least, greatest_px: greatest, rates_hz: rates(device, format, greatest) }
    };
    list(device, &ENUM_FRAMESIZES, size).into_iter().map(of).collect()
}

/// Rates of a format and size, slowest and fastest of each.
pub(crate) fn rates(device: &Device, format: u32, [width, height]: [u32; 2]) -> Vec<[f64; 2]> {
    let interval = |index| v4l2_frmivalenum { index, pixel_format: format, width, height, ..zeroed() };
    let of = |found: v4l2_frmivalenum| {
        let [shortest, longest] = intervals(&found).map(rate_hz);
        [longest?, shortest?].into()
    };
    list(device, &ENUM_FRAMEINTERVALS, interval).into_iter().filter_map(of).collect()
}

/// Images a second of an interval; `None` for one that is none.
pub(crate) fn rate_hz(interval: v4l2_fract) -> Option<f64> {
    let is_one = interval.numerator > 0 && interval.denominator > 0;
    is_one.then(|| f64::from(interval.denominator) / f64::from(interval.numerator))
}

/// The items of an enumeration, from 0 until the driver refuses one.
pub(crate) fn list<T: Copy>(device: &Device, request: &Request<T>, item: impl Fn(u32) -> T) -> Vec<T> {
    let answer = |index| {
        let mut item = item(index);
        device.call(request, &mut item).ok().map(|()| item)
    };
    (0..MOST_ITEMS).map_while(answer).collect()
}

/// Name of a format: the letters of its code, whatever they are; the highest bit marks the reverse order of bytes.
pub(crate) fn format_name(code: u32) -> String {
    let letters = text(&(code & !BIG_ENDIAN).to_le_bytes());
    if code & BIG_ENDIAN != 0 { letters + "_BE" } else { letters }
}

/// Formats that can be taken and their sizes in one line, for people.
pub(crate) fn summary(formats: &[OfferedFormat]) -> String {
    let taken: Vec<&OfferedFormat> = formats.iter().filter(|format| format.is_taken).collect();
    // Many formats share their sizes.
    let groups = taken.chunk_by(|a, b| a.sizes == b.sizes);
    let group = |group: &[&OfferedFormat]| {
        let names: Vec<&str> = group.iter().map(|format| format.name.as_str()).collect();
        let sizes = group.first().map_or(&[][..], |format| &format.sizes[..]);
        format!("{} in {}", names.join(", "), sizes_text(sizes))
    };
    let groups: Vec<String> = groups.map(group).collect();
    if groups.is_empty() { "no supported format".to_owned() } else { groups.join("; ") }
}

fn sizes_text(sizes: &[OfferedSize]) -> String {
    let shown = sizes.iter().take(SHOWN_SIZES).map(OfferedSize::to_string);
    let more = sizes.len().saturating_sub(SHOWN_SIZES);
    let more = (more > 0).then(|| format!("{more} more sizes"));
    let sizes: Vec<String> = shown.chain(more).collect();
    if sizes.is_empty() { "unlisted sizes".to_owned() } else { sizes.join(", ") }
}

/// Rates in one line, for people.
#[must_use]
pub fn rates_text(rates_hz: &[[f64; 2]]) -> String {
    let rate = |&[slowest, fastest]: &[f64; 2]| match slowest == fastest {
        true => shown(fastest),
        false => format!("{} to {}", shown(slowest), shown(fastest)),
    };
    rates_hz.iter().map(rate).collect::<Vec<_>>().join(", ")
}

/// A rate with as many digits as tell it from others.
pub(crate) fn shown(rate_hz: f64) -> String {
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
    fn what_is_offered_is_told_in_a_line() {
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
        let told = "GREY, Y10 in 640x480, 1280x1024; Y12 in 16x16 to 1920x1080; MJPG in unlisted sizes";
        assert_eq!(summary(&offered), told);
        assert_eq!(summary(&offered[1..2]), "no supported format");
        assert!(summary(&[format("GREY", vec![size(1, 1); 20])]).ends_with("1x1, 8 more sizes"));
        assert_eq!(rates_text(&[[30.0, 30.0], [1.0, 59.940_06]]), "30, 1 to 59.94");
    }

    #[test]
    fn an_interval_that_is_none_has_no_rate() {
        let rate = |numerator, denominator| rate_hz(v4l2_fract { numerator, denominator });
        assert_eq!((rate(1, 30), rate(0, 30), rate(1, 0)), (Some(30.0), None, None));
    }

    #[test]
    fn formats_have_names_whatever_the_driver_says() {
        assert_eq!(format_name(u32::from_le_bytes(*b"Y10 ")), "Y10");
        assert_eq!(format_name(u32::from_le_bytes(*b"RG24")), "RG24");
        assert_eq!(format_name(0), "");
        assert_eq!(format_name(SourceFormat::Y16BigEndian.code()), SourceFormat::Y16BigEndian.name());
        assert_eq!(format_name(u32::MAX), "\u{fffd}".repeat(3) + "\u{fffd}_BE");
    }
}
