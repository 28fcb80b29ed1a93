//! What each constant and each step of the order decision is worth: scenes are measured with one of them changed.

use std::time::{Duration, Instant};

use fringeflow::correspondence::{Constant, Model, Step};
use fringeflow::reconstruction::Settings;

use super::measure::Window;
use super::{ListedScene, SceneError};

/// Factor by which a constant is multiplied and divided.
pub const FACTOR: f32 = 1.5;

/// A change of the model.
#[derive(Clone, Copy, Debug)]
pub enum Change {
    /// None.
    Usual,
    /// A constant times a factor.
    Times(&'static Constant, f32),
    /// A step is left out.
    Without(Step),
}

/// Mean figures of scenes with a changed model.
#[derive(Clone, Copy, Debug)]
pub struct Sensitivity {
    /// The change.
    pub change: Change,
    /// Scenes that gave a cloud.
    pub scenes: usize,
    /// com, percent.
    pub com_percent: f64,
    /// com of the interior, percent, of the scenes that have one.
    pub interior_percent: f64,
    /// fpc, percent.
    pub fpc_percent: f64,
    /// Time from images to cloud and its scores.
    pub time: Duration,
}

impl Change {
    /// All changes, [`Self::Usual`] first.
    pub fn all() -> impl Iterator<Item = Self> {
        let factors = [FACTOR, 1.0 / FACTOR];
        let constants = Model::CONSTANTS.iter();
        let constants = constants.flat_map(move |constant| factors.map(|factor| Self::Times(constant, factor)));
        std::iter::once(Self::Usual).chain(constants).chain(Step::ALL.map(Self::Without))
    }

    /// The model with this change.
    #[must_use]
    pub fn model(self) -> Model {
        let mut model = Model::USUAL;
        match self {
            Self::Usual => {}
            Self::Times(constant, factor) => *(constant.of)(&mut model) *= factor,
            Self::Without(step) => model.without = Some(step),
        }
        model
    }
}

/// Measures scenes with every change, one after another. Calls `on_scene` after each scene.
///
/// # Errors
/// [`SceneError`]: a scene is not possible. A change with which a scene gives no cloud leaves it out of its means.
pub fn measure_sensitivity(scenes: &[ListedScene], on_scene: impl Fn()) -> Result<Vec<Sensitivity>, SceneError> {
    let none = |change| Sensitivity {
        change,
        scenes: 0,
        com_percent: 0.0,
        interior_percent: 0.0,
        fpc_percent: 0.0,
        time: Duration::ZERO,
    };
    let mut all: Vec<(Sensitivity, usize)> = Change::all().map(|change| (none(change), 0)).collect();
    for scene in scenes {
        let simulation = scene.simulation()?;
        let window = Window::take(scene, &simulation)?;
        let table = simulation.segment_table()?;
        let measure = |change: Change| {
            let mut settings = Settings::default();
            settings.matching.model = change.model();
            let begin = Instant::now();
            (window.measure(&simulation, table.clone(), settings), begin.elapsed())
        };
        // The first run of a scene takes longer than all others, so it does not count.
        let _first = measure(Change::Usual);
        for (sums, interiors) in &mut all {
            let (measured, time) = measure(sums.change);
            let Ok((_, evaluation)) = measured else { continue };
            sums.scenes += 1;
            sums.com_percent += evaluation.scores.com_percent;
            sums.fpc_percent += evaluation.scores.fpc_percent;
            sums.time += time;
            if let Some(interior_percent) = evaluation.scores.interior_percent {
                sums.interior_percent += interior_percent;
                *interiors += 1;
            }
        }
        on_scene();
    }
    let means = all.into_iter().map(|(sums, interiors)| Sensitivity {
        com_percent: sums.com_percent / sums.scenes.max(1) as f64,
        interior_percent: sums.interior_percent / interiors.max(1) as f64,
        fpc_percent: sums.fpc_percent / sums.scenes.max(1) as f64,
        time: sums.time.div_f64(sums.scenes.max(1) as f64),
        ..sums
    });
    Ok(means.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_changes_one_thing() {
        let usual = Model::USUAL;
        for change in Change::all() {
            let mut model = change.model();
            let mut others = Model::CONSTANTS.iter();
            let changed = others.clone().filter(|c| *(c.of)(&mut model) != *(c.of)(&mut usual.clone())).count();
            let expected = usize::from(matches!(change, Change::Times(..)));
            assert_eq!(changed, expected, "{change:?}");
            assert_eq!(model.without.is_some(), matches!(change, Change::Without(_)));
            assert!(others.all(|c| *(c.of)(&mut model) != 0.0));
        }
    }
}
