//! The images that the cameras show: from the file that keeps them, or rendered first.

use std::ops::ControlFlow;
use std::path::Path;

use fringeflow_lab::simulation::{ConfiguredScanner, ImageLoop, VirtualScanner};
use fringeflow_runtime::{Host, ServiceError};

/// Poses from one line of the log to the next.
const LOGGED_POSES: usize = 24;

/// The image loop of a virtual scanner; `None` if the service is to end before it is rendered.
pub(crate) fn prepare(host: &Host, options: &ConfiguredScanner) -> Result<Option<ImageLoop>, ServiceError> {
    let unusable = |e: fringeflow_lab::simulation::SimulationError| ServiceError::Unusable(e.to_string());
    let scanner = VirtualScanner::new(options.scanner).map_err(unusable)?;
    let speed = scanner.speed();
    tracing::info!(mean_mm = speed.mean_mm, max_mm = speed.max_mm, "motion of the object from image to image");
    let Some(file) = &options.cache else { return render(host, &scanner) };
    let problem = match ImageLoop::load(&scanner, file) {
        Ok(images) => return Ok(Some(images)),
        Err(problem) => problem,
    };
    tracing::info!("{}: {problem}; the images are rendered", file.display());
    let images = render(host, &scanner)?;
    match &images {
        Some(images) if problem.may_be_replaced() => save(images, &scanner, file),
        Some(_) => tracing::warn!("{}: is left as it is; the images are not kept", file.display()),
        None => (),
    }
    Ok(images)
}

/// Keeps the images; without the file the next start renders them again.
fn save(images: &ImageLoop, scanner: &VirtualScanner, file: &Path) {
    // If this fails, writing the file says so.
    drop(file.parent().map(std::fs::create_dir_all));
    if let Err(error) = images.save(scanner, file) {
        tracing::warn!("{error}; the images are rendered again at the next start");
    }
}

fn render(host: &Host, scanner: &VirtualScanner) -> Result<Option<ImageLoop>, ServiceError> {
    let poses = scanner.sweep().poses();
    let on_pose = |pose: usize| {
        if pose.is_multiple_of(LOGGED_POSES) {
            tracing::info!("rendered pose {} of {poses}", pose + 1);
        }
        if host.stop.is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    ImageLoop::render(scanner, on_pose).map_err(|e| ServiceError::Unusable(e.to_string()))
}
