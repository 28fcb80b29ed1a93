//! Mean and spread over the seeds of each object, way and number of steps.

use fringeflow_lab::paper_experiment::{DeltaFigures, Figures, Spread, Way};

/// The measurements of one object by one way with one number of steps, one for each seed.
pub(super) struct Group<'a> {
    pub(super) object: &'static str,
    pub(super) way: Way,
    pub(super) steps: usize,
    figures: Vec<&'a Figures>,
}

/// Groups the measurements, in the order in which they first appear.
pub(super) fn groups(measurements: &[Figures]) -> Vec<Group<'_>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    for figures in measurements {
        let Figures { object, way, steps, .. } = *figures;
        match groups.iter_mut().find(|g| (g.object, g.way, g.steps) == (object, way, steps)) {
            Some(group) => group.figures.push(figures),
            None => groups.push(Group { object, way, steps, figures: vec![figures] }),
        }
    }
    groups
}

impl Group<'_> {
    /// Spread of a figure; `None` if no measurement has it.
    pub(super) fn spread(&self, figure: impl Fn(&Figures) -> f64) -> Option<Spread> {
        Spread::of_values(self.figures.iter().map(|figures| figure(figures)))
    }

    /// Spread of a figure of δ; `None` with Gray code.
    pub(super) fn delta(&self, figure: impl Fn(&DeltaFigures) -> f64) -> Option<Spread> {
        Spread::of_values(self.figures.iter().filter_map(|figures| figures.delta.as_ref().map(&figure)))
    }

    /// Images of each camera that were read; `None` if the seeds differ.
    pub(super) fn images(&self) -> Option<u64> {
        let first = self.figures.first()?.images;
        self.figures.iter().all(|figures| figures.images == first).then_some(first)
    }
}
