//! The whole chain, from two phase maps to a decision about every pixel of C1.

use rayon::prelude::*;

use fringeflow_base::outcome::{Outcome, OutcomeCounts};
use fringeflow_simd::{Kernel, Lanes, Level};

use crate::phase::PhaseMap;

use super::agreement::{MatchError, check_scatter, check_share};
use super::candidates::Candidate;
use super::chosen::ChosenCandidates;
use super::delta_histogram::HistogramScratch;
use super::delta_measurement::DeltaScratch;
use super::delta_statistics::{DeltaStatistics, DeltaSums};
use super::drift::{Drift, KnownDrift};
use super::epipolar_image::EpipolarImage;
use super::moments::{self, Confidence, Grounds};
use super::reference_methods::paper;
use super::segment_table::SegmentTable;
use super::settings::{MatchSettings, ResolutionMethod};
use super::slip::correct_slip;
use super::view::View;

/// Relative change of sd after the paper's resolution that triggers a second pass with the new threshold.
const SD_CHANGE: f64 = 0.5;

/// Correspondences of all pixels of C1, row by row, and the statistics behind them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matches {
    /// The decision about each pixel.
    pub outcomes: Vec<Outcome>,
    /// The chosen candidate of each pixel with a found outcome.
    pub chosen: ChosenCandidates,
    /// Orders in the volume that the surface around each point leaves possible; with the paper's method, candidates that
    /// pass the back-projection test.
    pub passing: Vec<u8>,
    /// Probability that each point is true; [`Confidence::NONE`] everywhere with the paper's method.
    pub confidence: Vec<Confidence>,
    /// Statistics of δ that gave the threshold.
    pub delta: DeltaStatistics,
    /// Histogram of δ over all candidates of a sample of the pixels, in equal parts of −π to π rad.
    pub delta_counts: Vec<u32>,
    /// Mean and sd of δ over the chosen candidates, rad.
    pub chosen_delta_rad: (f64, f64),
    /// The drift of the calibration about which δ was tested, if the method estimates one.
    pub drift: Option<Drift>,
    /// Steps, 0 to N − 1, by which the patterns seen by C1 and C2 were ahead of the declared phase shifts. The phases
    /// were corrected by these first.
    pub slip_steps: [usize; 2],
}

impl Matches {
    /// The candidate chosen for a pixel, if it has one.
    #[must_use]
    #[inline]
    pub fn candidate(&self, pixel: usize) -> Option<Candidate> {
        self.outcomes[pixel].is_found().then(|| self.chosen.at(pixel))
    }

    /// Counts and sums over all pixels.
    fn sums(&self) -> Sums {
        let delta = self.chosen.delta.par_chunks(Sums::PIXELS);
        let chunks = self.outcomes.par_chunks(Sums::PIXELS).zip(self.passing.par_chunks(Sums::PIXELS)).zip(delta);
        let of_chunk =
            |((outcomes, passing), delta)| fringeflow_simd::run(Level::in_use(), SumChunk { outcomes, passing, delta });
        chunks.map(of_chunk).reduce(Sums::default, Sums::merged)
    }
}

/// Finds the correspondence of every pixel of C1.
///
/// # Errors
/// The maps have another size than the table, have nothing in common, or do not belong to the calibration.
pub fn match_phases(
    cam1: &PhaseMap,
    cam2: &PhaseMap,
    table: &SegmentTable,
    settings: &MatchSettings,
) -> Result<Matches, MatchError> {
    let mut matches = Matches::default();
    Matcher::default().match_phases(cam1, cam2, table, (settings, None), &mut matches)?;
    Ok(matches)
}

/// As [`match_phases`], with the grounds of each decision, from which `examples/fit_confidence.rs` fits the confidence.
/// The paper's method has no grounds.
///
/// # Errors
/// As [`match_phases`].
pub fn match_phases_with_grounds(
    cam1: &PhaseMap,
    cam2: &PhaseMap,
    table: &SegmentTable,
    settings: &MatchSettings,
) -> Result<(Matches, Vec<Grounds>), MatchError> {
    let (mut matches, mut grounds) = (Matches::default(), Vec::new());
    Matcher::default().match_with_grounds(cam1, cam2, table, (settings, None), &mut matches, Some(&mut grounds))?;
    Ok((matches, grounds))
}

/// Matches pairs of phase maps one after the other, reusing its memory.
#[derive(Clone, Debug, Default)]
pub struct Matcher {
    /// Phase of C2 in the epipolar frame.
    cam2: EpipolarImage,
    histogram: HistogramScratch,
    delta: DeltaScratch,
    moments: moments::Scratch,
}

impl Matcher {
    /// As the function [`match_phases`], into the memory of earlier matches. Earlier matches have no influence on the
    /// result. A known drift does where the images alone show none. After an error `out` has no meaning.
    ///
    /// # Errors
    /// As [`match_phases`].
    pub fn match_phases(
        &mut self,
        cam1: &PhaseMap,
        cam2: &PhaseMap,
        table: &SegmentTable,
        (settings, known): (&MatchSettings, Option<&KnownDrift>),
        out: &mut Matches,
    ) -> Result<(), MatchError> {
        self.match_with_grounds(cam1, cam2, table, (settings, known), out, None)
    }

    fn match_with_grounds(
        &mut self,
        cam1: &PhaseMap,
        cam2: &PhaseMap,
        table: &SegmentTable,
        (settings, known): (&MatchSettings, Option<&KnownDrift>),
        out: &mut Matches,
        grounds: Option<&mut Vec<Grounds>>,
    ) -> Result<(), MatchError> {
        let (found, expected) = ([cam1.width, cam1.height], table.size_px());
        let size_error = MatchError::Size { found, expected };
        if found != expected {
            return Err(size_error);
        }
        let raw_cam2 = cam2;
        let Self { cam2, histogram: histogram_scratch, delta: delta_scratch, moments } = self;
        if !cam2.resample_into(raw_cam2, table) {
            return Err(size_error);
        }
        // A slip is corrected first: it moves every δ.
        let mut histogram = histogram_scratch.count(View { cam1, cam2, table, model: &settings.model }, 0);
        let mut slip_steps = [0; 2];
        let mut corrected = None;
        if let Some(steps) = settings.cycle_steps {
            let view = View { cam1, cam2, table, model: &settings.model };
            if let Some(found) = correct_slip(view, &histogram, steps, moments) {
                (slip_steps, *cam2) = (found.slip_steps, found.cam2);
                histogram = histogram_scratch.count(View { cam1: &found.cam1, cam2, table, model: &settings.model }, 0);
                corrected = Some(found.cam1);
            }
        }
        let view = View { cam1: corrected.as_ref().unwrap_or(cam1), cam2, table, model: &settings.model };
        let measured = delta_scratch.measure(view, &histogram, settings.resolution.min_votes);
        let mut delta = measured.ok_or(MatchError::NothingInCommon)?;
        if let Some(sd_rad) = settings.delta_sd_rad {
            delta.sd_rad = sd_rad;
        }
        let matching = Matching { view, raw_cam2, settings };
        match settings.method {
            ResolutionMethod::Moments => matching.by_moments(delta, known, moments, out, grounds)?,
            ResolutionMethod::Paper => matching.by_paper(delta, out)?,
        }
        out.delta_counts.clear();
        out.delta_counts.extend(histogram.from_minus_to_plus_pi());
        out.slip_steps = slip_steps;
        Ok(())
    }
}

/// Inputs of matching one pair of phase maps.
struct Matching<'a> {
    view: View<'a>,
    /// The phase map of C2 before resampling.
    raw_cam2: &'a PhaseMap,
    settings: &'a MatchSettings,
}

impl Matching<'_> {
    fn by_moments(
        &self,
        delta: DeltaStatistics,
        known: Option<&KnownDrift>,
        scratch: &mut moments::Scratch,
        out: &mut Matches,
        grounds: Option<&mut Vec<Grounds>>,
    ) -> Result<(), MatchError> {
        let known = known.and_then(|known| Drift::from_known(known, self.view.table));
        let Matches { outcomes, chosen, passing, confidence, .. } = &mut *out;
        let mut decisions = moments::Decisions { outcomes, chosen, passing, confidence, grounds };
        let limits = moments::Limits {
            min_region_px: self.settings.resolution.min_region_px,
            min_confidence: self.settings.min_confidence,
        };
        let learned = scratch.explain(self.view, known.as_ref());
        let is_doubtful = self.is_measured() && learned.is_scattered(&self.settings.model);
        if is_doubtful
            && let Some(exchanged) = self.explain_exchanged()
            && !exchanged.is_scattered(&self.settings.model)
            && exchanged.nats > learned.nats
        {
            let [sd_rad, exchanged_sd_rad] = [&learned, &exchanged].map(|learned| learned.field.residual_sd_rad);
            return Err(MatchError::Exchanged { sd_rad, exchanged_sd_rad });
        }
        let scattered_rad = learned.field.residual_sd_rad;
        let field = scratch.resolve(self.view, learned, &limits, &mut decisions);
        let sums = out.sums();
        let invalid = OutcomeCounts::from_outcomes(&out.outcomes).get(Outcome::Invalid) as usize;
        check_share(scattered_rad, (is_doubtful, field.share), sums.found, out.outcomes.len() - invalid)?;
        out.chosen_delta_rad = sums.delta.mean_and_sd_rad();
        out.delta = delta;
        out.drift = Some(field);
        Ok(())
    }

    /// What surfaces show with the images exchanged, if both have one size.
    fn explain_exchanged(&self) -> Option<moments::Learned> {
        let image = self.exchanged_image()?;
        let view = View { cam1: self.raw_cam2, cam2: &image, ..self.view };
        Some(moments::Scratch::default().explain(view, None))
    }

    fn by_paper(&self, mut delta: DeltaStatistics, out: &mut Matches) -> Result<(), MatchError> {
        self.check_scatter(&delta)?;
        let mut sums = self.resolve_by_paper(&delta, out);
        // The first sd came from a sample. If that of the result differs much, its threshold was wrong.
        let changed = (out.chosen_delta_rad.1 / delta.sd_rad - 1.0).abs() > SD_CHANGE;
        if changed && self.is_measured() && sums.found > 0 {
            (delta.mean_rad, delta.sd_rad) = out.chosen_delta_rad;
            self.check_scatter(&delta)?;
            sums = self.resolve_by_paper(&delta, out);
        }
        let doubtful = self.is_measured() && delta.is_suspicious();
        let share = sums.found as f64 / sums.with_candidates as f64;
        check_share(delta.sd_rad, (doubtful, share), sums.found, sums.with_candidates)?;
        out.confidence.clear();
        out.confidence.resize(out.outcomes.len(), Confidence::NONE);
        out.delta = delta;
        out.drift = None;
        Ok(())
    }

    fn resolve_by_paper(&self, delta: &DeltaStatistics, out: &mut Matches) -> Sums {
        let decisions = paper::resolve(paper::Scene { view: self.view, delta, settings: &self.settings.resolution });
        (out.outcomes, out.chosen, out.passing) = (decisions.outcomes, decisions.chosen, decisions.passing);
        let sums = out.sums();
        out.chosen_delta_rad = sums.delta.mean_and_sd_rad();
        sums
    }

    fn is_measured(&self) -> bool {
        self.settings.delta_sd_rad.is_none()
    }

    /// Refuses a measured δ that scatters too widely to distinguish orders.
    fn check_scatter(&self, delta: &DeltaStatistics) -> Result<(), MatchError> {
        if self.is_measured() { check_scatter(delta, || self.exchanged()) } else { Ok(()) }
    }

    /// Statistics of δ with the images exchanged, if both have one size.
    fn exchanged(&self) -> Option<DeltaStatistics> {
        let view = View { cam1: self.raw_cam2, cam2: &self.exchanged_image()?, ..self.view };
        let histogram = HistogramScratch::default().count(view, 0);
        DeltaScratch::default().measure(view, &histogram, self.settings.resolution.min_votes)
    }

    /// The phase of C1 resampled as if it were that of C2, if the images have one size.
    fn exchanged_image(&self) -> Option<EpipolarImage> {
        let View { cam1, table, .. } = self.view;
        let is_of_size = [self.raw_cam2.width, self.raw_cam2.height] == table.size_px();
        is_of_size.then(|| EpipolarImage::resample(cam1, table))?
    }
}

/// Counts and sums over the decided pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// Pixels with a correspondence.
    found: usize,
    /// Pixels with candidates that pass.
    with_candidates: usize,
    /// δ of the chosen candidates.
    delta: DeltaSums,
}

impl Sums {
    /// Pixels summed at a time: few enough for 32-bit sums.
    const PIXELS: usize = 1 << 15;

    fn merged(self, other: Self) -> Self {
        Self {
            found: self.found + other.found,
            with_candidates: self.with_candidates + other.with_candidates,
            delta: self.delta.merged(other.delta),
        }
    }
}

/// Sums over at most [`Sums::PIXELS`] pixels.
struct SumChunk<'a> {
    outcomes: &'a [Outcome],
    passing: &'a [u8],
    delta: &'a [i16],
}

impl Kernel for SumChunk<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Sums {
        let Self { outcomes, passing, delta } = self;
        let (passing, delta) = (&passing[..outcomes.len()], &delta[..outcomes.len()]);
        let (mut found, mut with_candidates, mut sum, mut squares) = (0_u32, 0_u32, 0_i32, 0_u64);
        for i in 0..outcomes.len() {
            let own = if outcomes[i].is_found() { i32::from(delta[i]) } else { 0 };
            found += u32::from(outcomes[i].is_found());
            with_candidates += u32::from(passing[i] > 0);
            sum += own;
            squares += u64::from((own * own) as u32);
        }
        let delta = DeltaSums::new(found, i64::from(sum), squares);
        Sums { found: found as usize, with_candidates: with_candidates as usize, delta }
    }
}
