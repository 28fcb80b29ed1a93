//! An image and the decisions about its pixels, on which all steps work.

use rayon::prelude::*;

use fringeflow_base::outcome::Outcome;

use crate::correspondence::candidates::{Candidate, DeltaGate};
use crate::correspondence::chosen::ChosenCandidates;
use crate::correspondence::delta_statistics::DeltaStatistics;
use crate::correspondence::neighbourhood::{ABSENT, TURN};
use crate::correspondence::search::Candidates;
use crate::correspondence::settings::ResolutionSettings;
use crate::correspondence::view::View;

/// Inputs of the method.
#[derive(Clone, Copy)]
pub(in crate::correspondence) struct Scene<'a> {
    pub(in crate::correspondence) view: View<'a>,
    pub(in crate::correspondence) delta: &'a DeltaStatistics,
    pub(in crate::correspondence) settings: &'a ResolutionSettings,
}

/// An image and the decisions so far.
pub(super) struct Image<'a> {
    pub(super) scene: Scene<'a>,
    /// The back-projection test with 3·sd (2.1), and the wider one that all candidates pass.
    pub(super) gate: DeltaGate,
    pub(super) readmission: DeltaGate,
    pub(super) candidates: &'a Candidates,
    /// Whether each candidate was contradicted.
    pub(super) is_excluded: Vec<bool>,
    pub(super) passing: Vec<u8>,
    pub(super) outcomes: Vec<Outcome>,
    /// Absolute phase that each pixel is decided for, turns · 65536; [`ABSENT`] while undecided.
    pub(super) absolute: Vec<i32>,
    /// δ and number of the candidate that it is decided for; undefined while undecided.
    pub(super) delta: Vec<i16>,
    pub(super) number: Vec<u8>,
    /// Tolerated difference of δ between neighbours on one surface, turns · 65536.
    pub(super) tolerance: i32,
}

impl<'a> Image<'a> {
    /// Collects the candidates by the δ-criterion (2.2: "In a first step all candidates concerning the δ-criterion are
    /// collected"). Nothing is decided yet.
    pub(super) fn new(scene: Scene<'a>, [gate, readmission]: [DeltaGate; 2], candidates: &'a Candidates) -> Self {
        let pixels = scene.view.cam1.phase.len();
        let passing = |pixel: usize| candidates.for_pixel(pixel).iter().filter(|c| gate.passes(c.delta)).count() as u8;
        let passing: Vec<u8> = (0..pixels).into_par_iter().map(passing).collect();
        let outcome = |(pixel, &passing): (usize, &u8)| match (candidates.for_pixel(pixel), passing) {
            ([], _) => Outcome::NoCandidate,
            (_, 0) => Outcome::RejectedByDelta,
            _ => Outcome::Ambiguous,
        };
        Self {
            scene,
            gate,
            readmission,
            candidates,
            is_excluded: vec![false; candidates.all().len()],
            outcomes: passing.iter().enumerate().map(outcome).collect(),
            passing,
            absolute: vec![ABSENT; pixels],
            delta: vec![0; pixels],
            number: vec![0; pixels],
            tolerance: scene.delta.tolerance(),
        }
    }

    pub(super) fn is_decided(&self, pixel: usize) -> bool {
        self.absolute[pixel] != ABSENT
    }

    /// Absolute phase of a candidate of a pixel, turns · 65536.
    pub(super) fn absolute_of(&self, pixel: usize, candidate: &Candidate) -> i32 {
        i32::from(candidate.order) * TURN + i32::from(self.scene.view.cam1.phase[pixel])
    }

    /// The candidate that a pixel is decided for.
    pub(super) fn candidate(&self, pixel: usize) -> Option<&Candidate> {
        self.is_decided(pixel).then(|| &self.candidates.for_pixel(pixel)[usize::from(self.number[pixel])])
    }

    pub(super) fn decide(&mut self, pixel: usize, number: u8, outcome: Outcome) {
        let candidate = &self.candidates.for_pixel(pixel)[usize::from(number)];
        self.absolute[pixel] = self.absolute_of(pixel, candidate);
        (self.delta[pixel], self.number[pixel], self.outcomes[pixel]) = (candidate.delta, number, outcome);
    }

    /// Takes a decision back, if there is one.
    pub(super) fn undecide(&mut self, pixel: usize, outcome: Outcome) {
        if self.is_decided(pixel) {
            (self.absolute[pixel], self.outcomes[pixel]) = (ABSENT, outcome);
        }
    }

    /// Takes decisions back, and excludes their candidates.
    pub(super) fn exclude(&mut self, pixels: &[usize]) {
        for &pixel in pixels {
            self.is_excluded[self.candidates.first_index(pixel) + usize::from(self.number[pixel])] = true;
            self.undecide(pixel, Outcome::Contradicted);
        }
    }

    pub(super) fn chosen(&self) -> ChosenCandidates {
        let mut chosen = ChosenCandidates::default();
        chosen.resize(self.absolute.len());
        let width = self.scene.view.cam1.width.max(1);
        chosen.rows_mut(width).enumerate().for_each(|(v, mut row)| {
            (0..width).for_each(|u| row.set(u, self.candidate(v * width + u).copied()));
        });
        chosen
    }
}
