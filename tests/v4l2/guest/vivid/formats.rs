//! Formats: what vivid shows is the same in each, to the bit as far as the format has bits.

use std::collections::BTreeSet;

use super::super::capture::Capture;
use super::super::driver::Driver;
use super::super::scanner::configuration;
use crate::scenes;
use crate::support::Bench;

#[test]
#[ignore = "runs in the virtual machine"]
fn deep_images_keep_every_bit() {
    let _vivid = super::load();
    let grey = image("GREY");
    assert!(grey.iter().collect::<BTreeSet<_>>().len() >= 8, "the test pattern has eight bars");
    // The driver repeats the 8 bits that it paints with in the low bits of 16.
    for (format, factor) in [("Y10", 4), ("Y12", 16), ("Y16", 257), ("Y16_BE", 257)] {
        let deep: Vec<u16> = image(format).chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        assert!(deep.iter().copied().eq(grey.iter().map(|&grey| u16::from(grey) * factor)), "{format}");
    }
}

#[test]
#[ignore = "runs in the virtual machine"]
fn luma_is_the_same_however_it_lies_in_memory() {
    let _vivid = super::load();
    let luma = image("YUYV");
    assert!(luma.iter().collect::<BTreeSet<_>>().len() >= 8);
    for format in ["UYVY", "NV12"] {
        assert!(image(format) == luma, "{format}");
    }
}

#[test]
#[ignore = "runs in the virtual machine"]
fn planes_in_buffers_of_their_own_are_read_too() {
    let inputs = ["n_devs=2", "node_types=0x1,0x1", "num_inputs=1,1", "input_types=3,3"];
    let _vivid = Driver::load("vivid", &[&inputs[..], &["multiplanar=2,2"]].concat());
    assert!(image("NM12") == image("NV12"));
}

/// An image of camera 1 in a format, without the driver's clock in it.
fn image(format: &str) -> Vec<u8> {
    let camera = |number: usize| {
        format!(
            "[cameras.cam{0}]\ndevice = \"bus:platform:vivid-00{number}\"\nvideo_timings = \"1280x720@50\"\n\
             [cameras.cam{0}.controls]\nosd_text_mode = \"None\"\n",
            number + 1
        )
    };
    let cameras = format!("rate_hz = 50.0\nformat = \"{format}\"\n{}{}", camera(0), camera(1));
    let bench = Bench::of(&configuration(&scenes::all()[0], &cameras, ""));
    let mut capture = Capture::start(&bench);
    let (header, pixels) = capture.image();
    capture.stop();
    assert_eq!(pixels.len(), (header.stride_bytes * header.height_px) as usize, "{header:?}");
    pixels
}
