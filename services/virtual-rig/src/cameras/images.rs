//! The images of the virtual cameras: loaded from the cache file, or rendered and saved there.

use std::ops::ControlFlow;
use std::path::Path;

use fringeflow_lab::simulation::{ConfiguredScanner, ImageLoop, VirtualScanner};
use fringeflow_runtime::{Host, ServiceError};

/// Number of images of a pose: one per camera.
const IMAGES_PER_POSE: usize = 2;

/// Returns the image loop of a virtual scanner; `None` if the service is stopped before all images are rendered.
pub(crate) fn load_or_render(host: &Host, options: &ConfiguredScanner) -> Result<Option<ImageLoop>, ServiceError> {
    let unusable = |e: fringeflow_lab::simulation::SimulationError| ServiceError::Unusable(e.to_string());
    let scanner = VirtualScanner::new(options.scanner).map_err(unusable)?;
    let speed = scanner.speed();
    let (mean_mm, max_mm) = (speed.mean_mm, speed.max_mm);
    tracing::info!("the object moves by {mean_mm:.3} mm from image to image on average, by {max_mm:.3} mm at most");
    let Some(file) = &options.cache else { return render(host, &scanner) };
    let problem = match ImageLoop::load(&scanner, file) {
        Ok(images) => return Ok(Some(images)),
        Err(problem) => problem,
    };
    tracing::info!("{} {problem}", file.display());
    let images = render(host, &scanner)?;
    match &images {
        Some(images) if problem.may_be_replaced() => save(images, &scanner, file),
        Some(_) => tracing::warn!("{} is not replaced; the next start renders the images again", file.display()),
        None => (),
    }
    Ok(images)
}

/// Saves the images. Without the file the next start renders them again, so an error is only logged.
fn save(images: &ImageLoop, scanner: &VirtualScanner, file: &Path) {
    // If this fails, saving the file reports the error.
    drop(file.parent().map(std::fs::create_dir_all));
    if let Err(error) = images.save(scanner, file) {
        tracing::warn!("{error}; the next start renders the images again");
    }
}

fn render(host: &Host, scanner: &VirtualScanner) -> Result<Option<ImageLoop>, ServiceError> {
    let images = IMAGES_PER_POSE * scanner.sweep().poses();
    tracing::info!("rendering {images} images of the virtual scanner");
    let mut preparing = host.begin_preparation("Rendering images of the virtual scanner", images as u64);
    let on_pose = |pose: usize| {
        preparing.set_done((IMAGES_PER_POSE * (pose + 1)) as u64);
        if host.stop.is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    ImageLoop::render(scanner, on_pose).map_err(|e| ServiceError::Unusable(e.to_string()))
}
