//! Each format yields the grey levels that the camera sends, with all their bits.

use fringeflow_message::PixelFormat;

use crate::guest::capture::Capture;
use crate::guest::driver::{Driver, v4l2_ctl};
use crate::guest::vivid;
use crate::scenes;
use crate::support::Bench;

/// A picture that does not change.
const PICTURE: &str = "test_pattern = \"Gray Ramp\"\nosd_text_mode = \"None\"";

/// Extracts the grey levels of an image with this number of pixels from the bytes that the camera sends.
type Layout = fn(&[u8], usize) -> Vec<u8>;

#[test]
#[ignore = "runs in the virtual machine"]
fn images_have_the_grey_levels_of_the_camera() {
    let _vivid = vivid::load();
    assert_formats(&[
        ("GREY", PixelFormat::Grey, first),
        ("Y10", PixelFormat::Y10, words),
        ("Y12", PixelFormat::Y12, words),
        ("Y16", PixelFormat::Y16, words),
        ("Y16_BE", PixelFormat::Y16, swapped_words),
        ("YUYV", PixelFormat::Grey, even),
        ("UYVY", PixelFormat::Grey, odd),
        ("NV12", PixelFormat::Grey, first),
        ("YU12", PixelFormat::Grey, first),
    ]);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn images_in_several_planes_have_the_grey_levels_of_the_camera() {
    let parameters = ["n_devs=2", "node_types=0x1,0x1", "num_inputs=1,1", "input_types=3,3", "multiplanar=2,2"];
    let _vivid = Driver::load("vivid", &parameters);
    // For some formats, vivid leaves a gap before the first plane.
    assert_formats(&[
        ("GREY", PixelFormat::Grey, first),
        ("YUYV", PixelFormat::Grey, even),
        ("NM12", PixelFormat::Grey, first),
        ("YM12", PixelFormat::Grey, first),
    ]);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn region_and_binning_sum_the_grey_levels_of_the_camera() {
    let _vivid = vivid::load();
    let [x, y, width, height] = [17, 9, 256, 140];
    for (name, layout) in [("GREY", first as Layout), ("YUYV", even)] {
        let cameras =
            format!("\nformat = \"{name}\"\nregion_px = [{x}, {y}, {width}, {height}]\nbinning = 2\n[cameras.cam1]");
        let bench = Bench::from_configuration(&vivid::scanner(PICTURE).replace("\n[cameras.cam1]", &cameras));
        let mut capture = Capture::start(&bench);
        capture.wait_for_images(1);
        let (header, pixels) = (capture.witness.headers()[0], capture.witness.first_pixels());
        capture.stop();
        assert_eq!((header.width_px, header.height_px), (width / 2, height / 2));
        assert_eq!(PixelFormat::from_code(header.pixel_format), Some(PixelFormat::Y10), "{name}");
        let [whole_width, whole_height] = scenes::all()[0].image(1, 0).1;
        let sent = layout(&read_image(&bench), (whole_width * whole_height) as usize);
        let grey = |u: u32, v: u32| u16::from(sent[((y + v) * whole_width + x + u) as usize]);
        let sum = |u, v| grey(u, v) + grey(u + 1, v) + grey(u, v + 1) + grey(u + 1, v + 1);
        let expected: Vec<u8> =
            (0..height / 2).flat_map(|v| (0..width / 2).flat_map(move |u| sum(2 * u, 2 * v).to_le_bytes())).collect();
        assert!(pixels == expected, "{name}: {:?} of {:?}", &pixels[..16], &expected[..16]);
        assert!(count_levels(&pixels, 2) > 64, "{name} has {} grey levels", count_levels(&pixels, 2));
    }
}

fn assert_formats(formats: &[(&str, PixelFormat, Layout)]) {
    for &(name, format, layout) in formats {
        let scanner =
            vivid::scanner(PICTURE).replace("\n[cameras.cam1]", &format!("\nformat = \"{name}\"\n[cameras.cam1]"));
        let bench = Bench::from_configuration(&scanner);
        let mut capture = Capture::start(&bench);
        capture.wait_for_images(1);
        let (header, pixels) = (capture.witness.headers()[0], capture.witness.first_pixels());
        capture.stop();
        assert_eq!(PixelFormat::from_code(header.pixel_format), Some(format), "{name}");
        assert_eq!(header.stride_bytes as usize, header.width_px as usize * format.bytes(), "{name}");
        // The device still has the format.
        let sent = read_image(&bench);
        let expected = layout(&sent, (header.width_px * header.height_px) as usize);
        assert!(pixels == expected, "{name}: {:?} of {:?} in {:?}", &pixels[..16], &expected[..16], &sent[..32]);
        let levels = count_levels(&pixels, format.bytes());
        assert!(levels > 64, "{name} has {levels} grey levels");
    }
}

/// Reads the next image with another program.
fn read_image(bench: &Bench) -> Vec<u8> {
    let file = bench.path("image.raw");
    let to = format!("--stream-to={}", file.display());
    v4l2_ctl(vivid::DEVICE, &["--stream-mmap", "--stream-count=1", &to]);
    std::fs::read(file).unwrap()
}

/// Number of different grey levels.
fn count_levels(pixels: &[u8], bytes: usize) -> usize {
    pixels.chunks_exact(bytes).collect::<std::collections::BTreeSet<_>>().len()
}

fn first(sent: &[u8], pixels: usize) -> Vec<u8> {
    sent[..pixels].to_vec()
}

fn words(sent: &[u8], pixels: usize) -> Vec<u8> {
    sent[..2 * pixels].to_vec()
}

fn swapped_words(sent: &[u8], pixels: usize) -> Vec<u8> {
    sent[..2 * pixels].chunks_exact(2).flat_map(|word| [word[1], word[0]]).collect()
}

fn even(sent: &[u8], pixels: usize) -> Vec<u8> {
    sent[..2 * pixels].iter().step_by(2).copied().collect()
}

fn odd(sent: &[u8], pixels: usize) -> Vec<u8> {
    sent[1..2 * pixels].iter().step_by(2).copied().collect()
}
