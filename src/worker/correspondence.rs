//! From two phase maps to the correspondence of every pixel of camera 1.

use std::sync::Arc;

use crate::correspondence::{Drift, KnownDrift, MatchError, MatchSettings, Matcher, Matches, SegmentTable};
use crate::phase::{Modulation, PhaseShifts};

use super::PhasePair;

/// The correspondence of every pixel of C1, and what a point needs of the phase maps beside it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Correspondences {
    /// Width of the images of C1, pixels.
    pub width: usize,
    /// What became of every pixel.
    pub matches: Matches,
    /// What later windows are told of the drift of the calibration, where there is one.
    pub drift: Option<KnownDrift>,
    /// Mean grey level of every pixel of C1.
    pub mean: Vec<u8>,
    /// Modulation of every pixel of C1.
    pub modulation: Vec<Modulation>,
    /// Standard deviation of the phase of C1 and of C2, times the modulation, grey levels.
    pub phase_noise_grey: [f32; 2],
}

/// Finds the correspondences of one rig.
#[derive(Clone, Debug)]
pub struct CorrespondenceWorker {
    table: Arc<SegmentTable>,
    /// Sense of evenly spaced shifts.
    shift_sense: Option<f64>,
    settings: MatchSettings,
    matcher: Matcher,
}

impl CorrespondenceWorker {
    /// A worker for the rig of a segment table and one cycle of shifts; slips of the sequence are found where these are evenly
    /// spaced.
    #[must_use]
    pub fn new(table: Arc<SegmentTable>, cycle: &PhaseShifts, settings: MatchSettings) -> Self {
        let shift_sense = cycle.even_sense();
        let cycle_steps = shift_sense.map(|_| cycle.steps());
        Self { table, shift_sense, settings: MatchSettings { cycle_steps, ..settings }, matcher: Matcher::default() }
    }

    /// The segment table it works with.
    #[must_use]
    pub fn table(&self) -> &SegmentTable {
        &self.table
    }

    /// Finds the correspondence of every pixel of C1; after an error `out` has no meaning.
    ///
    /// # Errors
    /// Maps of another size than the table's, maps that have nothing in common, or a calibration they do not belong to.
    pub fn step(&mut self, maps: &PhasePair, out: &mut Correspondences) -> Result<(), MatchError> {
        let with = (&self.settings, maps.known_drift.as_ref());
        self.matcher.match_phases(&maps.cam1, &maps.cam2, &self.table, with, &mut out.matches)?;
        out.drift = out.matches.drift.as_ref().map(Drift::known);
        if let Some(steps) = self.settings.cycle_steps.filter(|_| self.shift_sense == Some(-1.0)) {
            // The phase is ahead where the steps are behind.
            out.matches.slip_steps = out.matches.slip_steps.map(|ahead| (steps - ahead) % steps);
        }
        out.width = maps.cam1.width;
        out.mean.clone_from(&maps.cam1.mean);
        out.modulation.clone_from(&maps.cam1.modulation);
        out.phase_noise_grey = [&maps.cam1.fit, &maps.cam2.fit].map(|fit| fit.noise_grey * fit.noise_gain);
        Ok(())
    }
}
