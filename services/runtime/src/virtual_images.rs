//! Whether the images of a running instance are virtual, in a file beside the accounts. The supervisor writes it, and
//! `status` reads it.

use std::fs;
use std::io;
use std::path::PathBuf;

use fringeflow_config::{CameraSource, ScannerConfiguration};
use fringeflow_transport::Instance;

use crate::accounts_folder;

/// Notes whether the images of an instance are virtual. Its accounts must have been removed.
///
/// # Errors
/// The file cannot be written.
pub fn note_virtual_images(instance: &Instance, configuration: &ScannerConfiguration) -> io::Result<()> {
    if configuration.cameras != CameraSource::Virtual {
        return Ok(());
    }
    fs::create_dir_all(accounts_folder(instance))?;
    fs::write(file(instance), "")
}

/// Returns whether the images of a running instance are virtual.
#[must_use]
pub fn has_virtual_images(instance: &Instance) -> bool {
    file(instance).exists()
}

fn file(instance: &Instance) -> PathBuf {
    accounts_folder(instance).join("virtual-images")
}
