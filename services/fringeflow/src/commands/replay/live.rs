//! `fringeflow replay` over the channels: runs the services of the live pipeline on the images of the recording.

use std::path::Path;

use fringeflow_dataset::{CALIBRATION_FILE, META_FILE};
use fringeflow_recording::{CONFIGURATION_FILE, Recording, Topic};
use fringeflow_replayer::{Compared, Comparison, Pace, Player, replay_configuration};
use fringeflow_runtime::{ServiceArgs, ServiceKind, measurement_services};
use fringeflow_supervisor::{Plan, run};

use crate::failure::Failure;
use crate::globals::Globals;
use crate::output_folder;
use crate::run_summary::{self, Summary};

use super::{Args, no_clouds};

impl Args {
    /// Plays a recording onto the channels.
    pub(super) fn play(&self, recording: &Recording, globals: &Globals) -> Result<(), Failure> {
        if self.verify && recording.count(Topic::Cloud) == 0 {
            return Err(no_clouds(&self.input));
        }
        globals.start_log("replay");
        let folder = output_folder::temporary()?;
        let plan = self.plan(recording, folder.path(), globals)?;
        let comparison = if self.verify { Comparison::from_recording(recording)? } else { Comparison::default() };
        let mut player = Player::new(recording, self.pace(), comparison);
        let outcome = run(&plan, Some(&mut player))?;
        let compared = self.verify.then(|| player.comparison.compared());
        run_summary::print(&Summary::from_replay(&outcome, compared), self.json)?;
        match compared {
            Some(compared) => run_summary::check_balance(&outcome).and_then(|()| self.check_comparison(&compared)),
            None => run_summary::check(&outcome),
        }
    }

    fn pace(&self) -> Pace {
        self.rate.unwrap_or(Pace::Rate(1.0))
    }

    /// Plans the run. Writes configuration and setup of the recording to a folder for the services.
    fn plan(&self, recording: &Recording, folder: &Path, globals: &Globals) -> Result<Plan, Failure> {
        let name = self.instance.clone().unwrap_or_else(|| format!("replay-{}", std::process::id()));
        let configuration = replay_configuration(recording, &name, self.pace());
        let configuration = configuration.map_err(|e| Failure::Usage(format!("{}: {e}", self.input.display())))?;
        let text = &recording.setup().text;
        let files = [
            (CONFIGURATION_FILE, &configuration),
            (META_FILE, &text.description),
            (CALIBRATION_FILE, &text.calibration),
        ];
        files.into_iter().try_for_each(|(name, text)| std::fs::write(folder.join(name), text))?;
        let arguments = ServiceArgs {
            config: folder.join(CONFIGURATION_FILE),
            setup: Some(folder.to_owned()),
            segment_table: Some(folder.join("rig.segments")),
            ..ServiceArgs::default()
        };
        let recorder = self.record.as_ref().map(|_| ServiceKind::Recorder);
        let services = measurement_services(&arguments.configuration()?).chain(recorder).collect();
        let recording = self.record.as_ref().map(|file| file.to_string_lossy().into_owned());
        crate::commands::run::plan(&arguments, globals, services, recording)
    }

    fn check_comparison(&self, compared: &Compared) -> Result<(), Failure> {
        let file = self.input.display();
        if compared.different > 0 {
            return Err(Failure::Mismatch(format!(
                "{file}: {} clouds differ from the recorded ones",
                compared.different
            )));
        }
        if compared.missing > 0 {
            let why = match self.pace() {
                Pace::Rate(_) => "this machine was too slow; --rate max loses no window",
                Pace::Fastest => "the recording lacks messages for them, see `fringeflow check`",
            };
            return Err(Failure::Losses(format!(
                "{file}: {} recorded clouds were not reproduced: {why}",
                compared.missing
            )));
        }
        Ok(())
    }
}
