//! From candidates to unique correspondences (2.2).

use super::candidates::{Candidate, Candidates};
use super::phase::Phases;

/// How far reference correspondences are looked for along the epipolar direction, and rows across it, pixels.
const ALONG: isize = 6;
const ACROSS: isize = 3;
/// Reference correspondences that must speak for a candidate.
const SUPPORT: usize = 3;
/// Rounds of decisions and contradictions, and sweeps of one kind in a round.
const ROUNDS: usize = 3;
const SWEEPS: usize = 8;

/// The candidate that each pixel was given.
pub(super) fn resolve(cam1: &Phases, candidates: &Candidates, [width, height]: [usize; 2]) -> Vec<Option<Candidate>> {
    let mut image = Image { cam1, candidates, width, height, decided: vec![None; width * height] };
    image.select_references();
    for _ in 0..ROUNDS {
        let along = image.sweep_until_settled(0);
        let across = image.sweep_until_settled(ACROSS);
        if image.contradict() + along + across == 0 {
            break;
        }
    }
    image.decided
}

struct Image<'a> {
    cam1: &'a Phases,
    candidates: &'a Candidates,
    width: usize,
    height: usize,
    decided: Vec<Option<Candidate>>,
}

impl Image<'_> {
    /// Pixels with exactly one candidate, whose neighbours have one too and agree (2.2.1).
    fn select_references(&mut self) {
        let unique: Vec<Option<Candidate>> = (0..self.decided.len())
            .map(|i| match self.candidates.of_pixel(i) {
                [only] => Some(*only),
                _ => None,
            })
            .collect();
        for i in 1..unique.len() - 1 {
            let Some(candidate) = unique[i] else { continue };
            let agrees = |k: usize| unique[k].is_some_and(|other| self.holds(i, &candidate, k, &other));
            if agrees(i - 1) && agrees(i + 1) {
                self.decided[i] = Some(candidate);
            }
        }
    }

    /// Eq. (2): the absolute phase of a reference differs by less than a period, and its place in C2 lies on the side of the
    /// candidate's that its phase says.
    fn holds(&self, pixel: usize, candidate: &Candidate, other: usize, reference: &Candidate) -> bool {
        let ahead = (reference.order - candidate.order) as f32 + self.cam1.phase[other] - self.cam1.phase[pixel];
        let beyond_px = reference.column_px - candidate.column_px;
        let is_ordered =
            ahead.abs() < 0.02 || beyond_px.abs() < 0.5 || ((ahead > 0.0) == (beyond_px > 0.0)) == candidate.rises;
        ahead.abs() < 0.5 && is_ordered
    }

    /// How many references about a pixel speak for a candidate, and against it.
    fn votes(&self, pixel: usize, candidate: &Candidate, across: isize) -> [usize; 2] {
        let (u, v) = ((pixel % self.width) as isize, (pixel / self.width) as isize);
        let mut votes = [0; 2];
        for row in (v - across).max(0)..=(v + across).min(self.height as isize - 1) {
            // Across, those right above and below speak; further aside the surface is another.
            let reach = if row == v { ALONG } else { 1 };
            for column in (u - reach).max(0)..=(u + reach).min(self.width as isize - 1) {
                let other = row as usize * self.width + column as usize;
                if other != pixel
                    && let Some(reference) = &self.decided[other]
                {
                    votes[usize::from(!self.holds(pixel, candidate, other, reference))] += 1;
                }
            }
        }
        votes
    }

    /// Decides what can be decided, until nothing changes; how many pixels were.
    fn sweep_until_settled(&mut self, across: isize) -> usize {
        let mut all = 0;
        for _ in 0..SWEEPS {
            let new: Vec<(usize, Candidate)> =
                (0..self.decided.len()).filter_map(|i| Some((i, self.decide(i, across)?))).collect();
            new.iter().for_each(|&(i, candidate)| self.decided[i] = Some(candidate));
            all += new.len();
            if new.is_empty() {
                break;
            }
        }
        all
    }

    /// The candidate of an open pixel for which alone Eq. (2) holds (2.2.2).
    fn decide(&self, pixel: usize, across: isize) -> Option<Candidate> {
        if self.decided[pixel].is_some() {
            return None;
        }
        let mut holding = self.candidates.of_pixel(pixel).iter().filter(|candidate| {
            let [for_it, against] = self.votes(pixel, candidate, across);
            for_it >= SUPPORT && for_it > 2 * against
        });
        let first = holding.next()?;
        holding.next().is_none().then_some(*first)
    }

    /// Takes back what more of its neighbours contradict than confirm (2.2.3); how many.
    fn contradict(&mut self) -> usize {
        let is_contradicted = |&i: &usize| {
            self.decided[i].is_some_and(|candidate| {
                let [for_it, against] = self.votes(i, &candidate, ACROSS);
                for_it <= against
            })
        };
        let contradicted: Vec<usize> = (0..self.decided.len()).filter(is_contradicted).collect();
        contradicted.iter().for_each(|&i| self.decided[i] = None);
        contradicted.len()
    }
}
