//! Cache of rendered images in files, because rendering 1280 × 1024 pixels takes seconds to minutes.

use sha2::{Digest, Sha256};

use fringeflow_base::grey::PixelFormat;
use fringeflow_dataset::GreyImage;

use super::{Images, bench_folder};

/// Raise this when the virtual scanner renders other images for the same options.
const VERSION: u32 = 1;

/// Reads the images for a key from their file, or renders and saves them.
pub(super) fn read_or_render(
    key: &str,
    size_px: [usize; 2],
    format: PixelFormat,
    images: usize,
    render: impl FnOnce() -> [Vec<GreyImage>; 2] + Send,
) -> Images {
    let digest = Sha256::digest(format!("{VERSION} {key}"));
    let name: String = digest.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    let folder = bench_folder().join("scenes");
    let file = folder.join(name);
    let image_bytes = size_px[0] * size_px[1] * format.bytes();
    if let Some(bytes) = std::fs::read(&file).ok().filter(|bytes| bytes.len() == 2 * images * image_bytes) {
        let [width, height] = size_px;
        let image = |pixels: &[u8]| GreyImage { width, height, format, pixels: pixels.to_vec() };
        let mut all = bytes.chunks_exact(image_bytes).map(image);
        return Images { cameras: [0, 1].map(|_| all.by_ref().take(images).collect()) };
    }
    eprintln!("rendering {images} images of both cameras, {} × {} pixels, once ...", size_px[0], size_px[1]);
    // Use all cores, even if the measurements are limited to some.
    let cameras = rayon::ThreadPoolBuilder::new().build().unwrap().install(render);
    std::fs::create_dir_all(&folder).unwrap();
    let bytes: Vec<u8> = cameras.iter().flatten().flat_map(|image| image.pixels.iter().copied()).collect();
    std::fs::write(&file, bytes).unwrap();
    Images { cameras }
}
