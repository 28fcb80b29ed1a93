//! Compressed images: their length changes from image to image, and they become grey levels.

use fringeflow::geometry::Readout;
use fringeflow_message::{DropReason, PixelFormat};
use fringeflow_pixels::{ImageReader, SourceFormat};

use crate::guest::capture::Capture;
use crate::scenes;
use crate::support::Bench;

use super::DEVICES;
use super::writer::Writer;

/// Size of the images below.
pub(crate) const SIZE: &str = "80x72";
const SIZE_PX: [usize; 2] = [80, 72];
/// In colour; without Huffman tables, as many cameras send it; grey.
const IMAGES: [&[u8]; 3] = [
    include_bytes!("../../../../crates/pixels/src/tests/colour_420.jpg"),
    include_bytes!("../../../../crates/pixels/src/tests/colour_422_without_tables.jpg"),
    include_bytes!("../../../../crates/pixels/src/tests/grey.jpg"),
];

#[test]
#[ignore = "runs in the virtual machine"]
fn compressed_images_are_decoded_and_truncated_ones_counted() {
    let scene = &scenes::of_name(SIZE);
    let _loopback = super::load();
    let mut writer = Writer::open(DEVICES[0], SIZE_PX.map(|side| side as u32), b"MJPG");
    writer.show(IMAGES[0]);
    let bench = Bench::from_configuration(&super::scanner(scene, "MJPG", "timeout_ms = 60000"));
    let mut capture = Capture::start(&bench);
    capture.wait_for_images(1);
    for image in &IMAGES[1..] {
        capture.act_and_wait_for_images(1, || writer.show(image));
    }
    writer.show(&IMAGES[0][..700]);
    capture.wait_until("the truncated image is counted", |capture| capture.counts().dropped(DropReason::BadImage) == 1);
    capture.act_and_wait_for_images(1, || writer.show(IMAGES[0]));
    let pixels = capture.witness.first_pixels();
    let done = capture.stop();
    let mut expected = vec![0; SIZE_PX[0] * SIZE_PX[1]];
    let mut reader = ImageReader::new(SourceFormat::Mjpeg.into(), Readout::whole(SIZE_PX)).unwrap();
    reader.read(0, IMAGES[0], 0, &mut expected).unwrap();
    assert!(pixels == expected, "{:?} of {:?}", &pixels[..16], &expected[..16]);
    assert!(done.headers.iter().all(|header| header.pixel_format == PixelFormat::Grey.code()));
    assert_eq!((done.counts.taken, done.counts.passed), (5, 4), "{:?}", done.counts);
}
