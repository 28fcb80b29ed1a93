//! Arguments of a service, and the configuration, setup and segment table that they name.

use std::path::{Path, PathBuf};

use fringeflow::correspondence::{SegmentFileError, SegmentTable};
use fringeflow_config::{ConfigurationError, ScannerConfiguration, SetupTextError};
use fringeflow_dataset::{CALIBRATION_FILE, META_FILE, Setup, SetupError, SetupText};
use fringeflow_lab::simulation::{read_configuration, read_virtual_configuration, setup_text};

use crate::ServiceKind;
use crate::processors::{self, AffinityError, ResourceGrants};

/// Arguments that every service takes.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ServiceArgs {
    /// Configuration of the scanner, see configs/demo.toml.
    #[arg(long, value_name = "FILE")]
    pub config: PathBuf,
    /// Let the virtual scanner take the images of the rig in the configuration, in the place of cameras and projector.
    #[arg(long = "virtual")]
    pub virtual_images: bool,
    /// Folder with meta.json and calibration.yml, instead of the rig in the configuration.
    #[arg(long, value_name = "FOLDER")]
    pub setup: Option<PathBuf>,
    /// File of the segment table, instead of the one in the configuration. It is read if it exists, else computed and
    /// written. The services correspondence and cloud use it.
    #[arg(long, value_name = "FILE")]
    pub segment_table: Option<PathBuf>,
    /// Number of restarts of the service in this instance.
    #[arg(long, hide = true, default_value_t = 0)]
    pub restarts: u32,
    /// Stop when standard input ends.
    #[arg(long, hide = true)]
    pub supervised: bool,
}

/// Arguments that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ArgumentError {
    /// The configuration file cannot be used.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    /// A service cannot have the CPUs that the configuration gives it.
    #[error("{}: in [processors.{service}]: {source}", config.display())]
    Processors {
        /// The configuration file.
        config: PathBuf,
        /// The service.
        service: &'static str,
        /// What is wrong.
        #[source]
        source: AffinityError,
    },
    /// The rig in the configuration cannot be used.
    #[error("{}: {source}", config.display())]
    Rig {
        /// The configuration file.
        config: PathBuf,
        /// What is wrong.
        #[source]
        source: SetupTextError,
    },
    /// A file of the setup folder cannot be read.
    #[error("{}: cannot be read: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The system error.
        #[source]
        source: std::io::Error,
    },
    /// The setup is invalid.
    #[error("{}: {source}", from.display())]
    Setup {
        /// Where the setup comes from.
        from: PathBuf,
        /// What is wrong.
        #[source]
        source: SetupError,
    },
    /// The setup has no measurement volume.
    #[error(
        "{}: the setup has no measurement volume; add one to the configuration (key measurement_volume)",
        from.display()
    )]
    NoVolume {
        /// Where the setup comes from.
        from: PathBuf,
    },
    /// The rig has no segment table, or its file cannot be used.
    #[error(transparent)]
    SegmentFile(#[from] SegmentFileError),
}

impl ServiceArgs {
    /// Returns the arguments of the command line of a service, without those that a supervisor adds.
    #[must_use]
    pub fn to_command_line(&self, service: ServiceKind) -> Vec<String> {
        let table = self.segment_table.as_ref().filter(|_| service.reads_segment_table());
        let named = [("--config", Some(&self.config)), ("--setup", self.setup.as_ref()), ("--segment-table", table)]
            .into_iter();
        let given = named.filter_map(|(name, path)| Some([name.to_owned(), path?.to_string_lossy().into_owned()]));
        let virtual_images = self.virtual_images.then(|| "--virtual".to_owned());
        given.flatten().chain(virtual_images).collect()
    }

    /// Reads the configuration.
    ///
    /// # Errors
    /// [`ArgumentError::Configuration`].
    pub fn configuration(&self) -> Result<ScannerConfiguration, ArgumentError> {
        let read = if self.virtual_images { read_virtual_configuration } else { read_configuration };
        Ok(read(&self.config)?)
    }

    /// Checks that this process may use the CPUs that the configuration gives to services.
    ///
    /// # Errors
    /// [`ArgumentError::Processors`].
    pub fn check_processors(&self, configuration: &ScannerConfiguration) -> Result<(), ArgumentError> {
        processors::check(&configuration.processors).map_err(|error| self.processors_error(error))
    }

    /// Applies the CPUs, threads, priority and memory lock of a service. Called before it starts threads.
    pub(crate) fn apply_processors(
        &self,
        configuration: &ScannerConfiguration,
        service: &'static str,
    ) -> Result<Option<ResourceGrants>, ArgumentError> {
        processors::apply(&configuration.processors, service).map_err(|error| self.processors_error(error))
    }

    fn processors_error(&self, (service, source): (&'static str, AffinityError)) -> ArgumentError {
        ArgumentError::Processors { config: self.config.clone(), service, source }
    }

    /// Reads the setup from its folder, or else from the configuration.
    ///
    /// # Errors
    /// A file cannot be read, or the setup is invalid.
    pub fn setup(&self, configuration: &ScannerConfiguration) -> Result<Setup, ArgumentError> {
        let (text, from) = match &self.setup {
            Some(folder) => (read_folder(folder)?, folder),
            None => {
                let text = setup_text(configuration);
                let rig = |source| ArgumentError::Rig { config: self.config.clone(), source };
                (text.map_err(rig)?, &self.config)
            }
        };
        let setup = |source| ArgumentError::Setup { from: from.clone(), source };
        let mut parsed = Setup::parse(text, None).map_err(setup)?;
        if let Some(volume) = &configuration.measurement.volume {
            parsed.volume = Some(*volume);
        }
        Ok(parsed)
    }

    /// Loads or computes the segment table of a setup.
    ///
    /// # Errors
    /// There is no measurement volume, the rig has no segment table, or its file cannot be used.
    pub fn segment_table(
        &self,
        configuration: &ScannerConfiguration,
        setup: &Setup,
    ) -> Result<SegmentTable, ArgumentError> {
        let from = self.setup.as_ref().unwrap_or(&self.config);
        let volume = setup.volume.as_ref().ok_or_else(|| ArgumentError::NoVolume { from: from.clone() })?;
        let path = self.segment_table.as_deref().or(configuration.segment_table.as_deref());
        Ok(SegmentTable::load_or_build(path, &setup.rig, volume, &setup.sequence.pattern)?)
    }
}

fn read_folder(folder: &Path) -> Result<SetupText, ArgumentError> {
    let read = |name| {
        let file = folder.join(name);
        std::fs::read_to_string(&file).map_err(|source| ArgumentError::Unreadable { file, source })
    };
    Ok(SetupText { description: read(META_FILE)?, calibration: read(CALIBRATION_FILE)? })
}
