//! Second stage. In: two phase maps. Out: the correspondence of every pixel of camera 1. Cost: see
//! [`crate::correspondence`]; the longest of the three stages.

use std::sync::Arc;

use crate::cloud::TriangulationInput;
use crate::correspondence::{Drift, KnownDrift, MatchError, MatchSettings, Matcher, Matches, SegmentTable};
use crate::phase::{Modulation, PhaseShifts};

use super::PhasePair;

/// The correspondence of every pixel of C1, with the phase data that triangulation needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Correspondences {
    /// Width of the images of C1, pixels.
    pub width: usize,
    /// Outcome of every pixel.
    pub matches: Matches,
    /// Drift of the calibration, for later windows, if there is any.
    pub drift: Option<KnownDrift>,
    /// Mean grey level of every pixel of C1.
    pub mean: Vec<u8>,
    /// Modulation of every pixel of C1.
    pub modulation: Vec<Modulation>,
    /// Standard deviation of the phase of C1 and C2 times the modulation, grey levels.
    pub phase_noise_grey: [f32; 2],
}

impl Correspondences {
    /// What the triangulation needs of them.
    #[must_use]
    pub fn triangulation_input(&self) -> TriangulationInput<'_> {
        let Matches { outcomes, chosen, passing, confidence, .. } = &self.matches;
        TriangulationInput {
            width: self.width,
            outcomes,
            column_px: &chosen.column_px,
            order: &chosen.order,
            delta: &chosen.delta,
            slope: &chosen.slope,
            passing,
            confidence,
            mean: &self.mean,
            modulation: &self.modulation,
            phase_noise_grey: self.phase_noise_grey,
        }
    }
}

/// Finds the correspondences of one rig.
#[derive(Clone, Debug)]
pub struct CorrespondenceWorker {
    table: Arc<SegmentTable>,
    /// Direction of evenly spaced shifts, see [`PhaseShifts::even_direction`].
    shift_direction: Option<f64>,
    settings: MatchSettings,
    matcher: Matcher,
}

impl CorrespondenceWorker {
    /// A worker for the rig of a segment table and one cycle of shifts. Slips of the sequence are found if the shifts
    /// are evenly spaced.
    #[must_use]
    pub fn new(table: Arc<SegmentTable>, cycle: &PhaseShifts, settings: MatchSettings) -> Self {
        let shift_direction = cycle.even_direction();
        let cycle_steps = shift_direction.map(|_| cycle.steps());
        let settings = MatchSettings { cycle_steps, ..settings };
        Self { table, shift_direction, settings, matcher: Matcher::default() }
    }

    /// Its segment table.
    #[must_use]
    pub fn table(&self) -> &SegmentTable {
        &self.table
    }

    /// Finds the correspondence of every pixel of C1. After an error `out` has no meaning.
    ///
    /// # Errors
    /// The maps do not have the size of the table, have nothing in common, or do not fit the calibration.
    pub fn step(&mut self, maps: &PhasePair, out: &mut Correspondences) -> Result<(), MatchError> {
        let settings = (&self.settings, maps.known_drift.as_ref());
        self.matcher.match_phases(&maps.cam1, &maps.cam2, &self.table, settings, &mut out.matches)?;
        out.drift = out.matches.drift.as_ref().map(Drift::to_known);
        if let Some(steps) = self.settings.cycle_steps.filter(|_| self.shift_direction == Some(-1.0)) {
            // With descending shifts a phase that is ahead means steps that are behind.
            out.matches.slip_steps = out.matches.slip_steps.map(|ahead| (steps - ahead) % steps);
        }
        out.width = maps.cam1.width;
        out.mean.clone_from(&maps.cam1.mean);
        out.modulation.clone_from(&maps.cam1.modulation);
        out.phase_noise_grey = [&maps.cam1.fit, &maps.cam2.fit].map(|fit| fit.noise_grey * fit.noise_gain);
        Ok(())
    }
}
