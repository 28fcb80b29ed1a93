//! The virtual scanner of a configuration: with any cameras, it takes the images of the rig.

use std::path::Path;

use fringeflow_config::ScannerConfiguration;
use fringeflow_dataset::Setup;
use fringeflow_lab::simulation::{ConfiguredScanner, SimulationOptions};
use fringeflow_runtime::ServiceArgs;

use crate::failure::Failure;

/// A configuration whose images are virtual.
pub(super) struct ConfiguredSimulation {
    pub(super) configuration: ScannerConfiguration,
    pub(super) setup: Setup,
    pub(super) scanner: ConfiguredScanner,
}

impl ConfiguredSimulation {
    /// Reads a configuration.
    pub(super) fn read(config: &Path) -> Result<Self, Failure> {
        let arguments = ServiceArgs { config: config.to_owned(), virtual_images: true, ..ServiceArgs::default() };
        let configuration = arguments.configuration()?;
        let setup = arguments.setup(&configuration)?;
        let scanner = ConfiguredScanner::from_scanner_configuration(&configuration);
        let scanner = scanner.map_err(|problem| Failure::Usage(format!("{}: {problem}", config.display())))?;
        let unusable = || Failure::Usage(format!("{}: there is no virtual scanner", config.display()));
        Ok(Self { configuration, setup, scanner: scanner.ok_or_else(unusable)? })
    }

    /// The options of a dataset that it takes while it rests.
    pub(super) fn dataset_options(&self, config: &Path) -> Result<SimulationOptions, Failure> {
        let missing = || Failure::Usage(format!("{}: there is no [measurement_volume]; add one", config.display()));
        self.scanner.dataset_options(&self.setup).ok_or_else(missing)
    }
}
