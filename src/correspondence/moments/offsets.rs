//! The ratio of each component of parts: do the means of δ over its parts lie together, near the field?
//!
//! ```text
//! true component:  its parts lie close to a common offset from the field; the offset is as wide as the field is uncertain
//! wrong component: the means of its parts lie all over the reach about the field
//! ratio = Σ over parts of ln p(mean | true, offset) − ln p(mean | wrong), small parts counting less, − cost of the offset
//! ```
//!
//! The offset is the one that makes the true component likeliest: least squares with the weights of Student's t with
//! three degrees of freedom.

use super::likelihood::{Moments, student_cost, student_weight};
use super::model::Model;

/// Rounds of weights.
const ROUNDS: usize = 5;
/// Least variance of the field, rad².
const MIN_VARIANCE: f32 = 1e-8;

/// What the parts of a component show.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PartMean {
    pub(super) component: u32,
    pub(super) size_px: u32,
    pub(super) moments: Moments,
    /// Variance of the field there, rad².
    pub(super) field_variance: f32,
}

impl PartMean {
    fn weight(&self, model: &Model) -> f32 {
        weight(self.size_px, model)
    }
}

/// How much a part of so many pixels counts.
pub(super) fn weight(size_px: u32, model: &Model) -> f32 {
    (size_px as f32 / model.full_px).min(1.0)
}

/// The offset of a component, and the sums of its fit.
#[derive(Clone, Copy, Debug, Default)]
struct Offset {
    /// rad.
    mean: f32,
    /// Variance of the field, rad².
    variance: f32,
    weighted: f32,
    weight: f32,
    /// Log likelihood ratio of the component, nats.
    ratio: f32,
}

/// The components, and the parts from which their offsets are fitted.
#[derive(Clone, Debug, Default)]
pub(super) struct Offsets {
    pub(super) parts: Vec<PartMean>,
    of_components: Vec<Offset>,
}

impl Offsets {
    /// Log likelihood ratio of each of `count` components, true against wrong, nats.
    pub(super) fn ratios(&mut self, count: usize, model: &Model) -> impl Iterator<Item = f32> {
        let Self { parts, of_components: offsets } = self;
        offsets.clear();
        offsets.resize(count, Offset::default());
        for part in &*parts {
            let own = &mut offsets[part.component as usize];
            own.weighted += part.weight(model) * part.field_variance;
            own.weight += part.weight(model);
        }
        for own in &mut *offsets {
            own.variance = (own.weighted / own.weight.max(f32::MIN_POSITIVE)).max(MIN_VARIANCE);
        }
        // The first round has plain weights: the offset starts in the middle of the parts.
        for round in 0..=ROUNDS {
            offsets.iter_mut().for_each(|own| (own.weighted, own.weight) = (0.0, 0.0));
            for part in &*parts {
                let own = &mut offsets[part.component as usize];
                let variance = part.moments.variance_within(model);
                let off = part.moments.mean - own.mean;
                let robust = if round == 0 { 1.0 } else { student_weight(off * off / variance) };
                own.weighted += part.weight(model) * robust / variance * part.moments.mean;
                own.weight += part.weight(model) * robust / variance;
            }
            for own in &mut *offsets {
                let prior =
                    if round == 0 { 0.0 } else { student_weight(own.mean * own.mean / own.variance) / own.variance };
                own.mean = own.weighted / (own.weight + prior).max(f32::MIN_POSITIVE);
            }
        }
        offsets.iter_mut().for_each(|own| own.ratio = -student_cost(own.mean * own.mean / own.variance));
        for part in &*parts {
            let own = &mut offsets[part.component as usize];
            own.ratio += part.weight(model) * part.moments.ratio_within(own.mean, model);
        }
        offsets.iter().map(|own| own.ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(means: &[f32], field_sd: f32) -> f32 {
        let part = |mean: &f32| PartMean {
            component: 0,
            size_px: 200,
            moments: Moments { mean: *mean, variance: [1e-6; 3], share: 1.0, count: 64.0, ..Moments::default() },
            field_variance: field_sd * field_sd,
        };
        let mut offsets = Offsets { parts: means.iter().map(part).collect(), ..Offsets::default() };
        offsets.ratios(1, &Model::USUAL).next().unwrap()
    }

    #[test]
    fn parts_near_the_field_are_true_and_scattered_ones_are_not() {
        assert!(ratio(&[0.002, -0.004, 0.001, 0.003], 0.005) > 4.0);
        assert!(ratio(&[0.1, -0.08, 0.12, -0.11, 0.02], 0.005) < -4.0);
    }

    #[test]
    fn a_common_offset_costs_as_much_as_the_field_is_certain() {
        let offset = [0.052, 0.049, 0.05, 0.048, 0.051];
        let scattered = [0.052, -0.049, 0.05, -0.048, 0.051];
        assert!(ratio(&offset, 0.03) > 4.0, "the field is uncertain");
        assert!(ratio(&offset, 0.03) > ratio(&offset, 0.003) + 2.0);
        assert!(ratio(&offset, 0.03) > ratio(&scattered, 0.03) + 10.0, "parts of a surface lie together");
    }

    #[test]
    fn a_component_of_one_part_is_judged_by_its_offset() {
        let mut last = f32::INFINITY;
        for step in 0..20 {
            let now = ratio(&[0.01 * step as f32], 0.01);
            assert!(now <= last + 1e-4, "{now} after {last}");
            last = now;
        }
    }

    #[test]
    fn components_without_parts_have_no_evidence() {
        assert!(Offsets::default().ratios(2, &Model::USUAL).eq([0.0, 0.0]));
    }
}
