//! How two devices stand to each other, from the poses of the board in both; and which images were taken of which pose.
//!
//! In: the pose of the board in the frame of each device, by view. Out: the arrangement that most views agree with
//! (least median of squares, Rousseeuw 1984), and how far each view is from it, pixels. Cost: for each pair of images a
//! projection of some points in all views.

use fringeflow::geometry::{Pose, Vector3};
use nalgebra::{UnitQuaternion, Vector2};

use crate::lens::Lens;
use crate::median::median;

/// Poses of the board in the frame of one device, by view; `None` where it does not see the board.
pub(crate) type Poses<'a> = &'a [Option<Pose>];

/// How a view fits an arrangement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewPose {
    /// Distance between where the second device sees the board and where the first one says that it should, pixels.
    pub deviation_px: f64,
    /// Whether the second device counts the features of the board from the opposite corner.
    pub half_turn: bool,
}

/// The arrangement of two devices.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrangement {
    /// The frame of the second device from that of the first.
    pub second_from_first: Pose,
    /// For each view that both devices see how it fits.
    pub views: Vec<Option<ViewPose>>,
    /// Median of the deviations, pixels.
    pub median_px: f64,
}

/// What finding an arrangement needs.
pub(crate) struct Devices<'a> {
    pub(crate) first: Poses<'a>,
    pub(crate) second: Poses<'a>,
    /// Lens of the second device.
    pub(crate) lens: &'a Lens,
    /// Points spread over the board, metres.
    pub(crate) probes_m: &'a [Vector2<f64>],
    /// Whether the board looks the same after half a turn.
    pub(crate) symmetric: bool,
}

impl Devices<'_> {
    /// The arrangement that fits most views; `None` if no view is seen by both.
    pub(crate) fn arrangement(&self) -> Option<Arrangement> {
        let candidates = (0..self.first.len()).flat_map(|view| self.hypotheses(view, view));
        let best = candidates.min_by(|a, b| self.median_px(a).total_cmp(&self.median_px(b)))?;
        let views = (0..self.first.len()).map(|view| self.fit(&best, view, view)).collect();
        Some(Arrangement { second_from_first: best, views, median_px: self.median_px(&best) })
    }

    /// For each view of the first device the view of the second device that shows the same pose, under the arrangement for
    /// which most images find a partner within `limit_px`.
    pub(crate) fn partners(&self, limit_px: f64) -> Vec<Option<usize>> {
        let count = self.first.len();
        let partner = |hypothesis: &Pose, view: usize| {
            let fits = (0..count).filter_map(|other| Some((self.fit(hypothesis, view, other)?.deviation_px, other)));
            let (deviation_px, other) = fits.min_by(|a, b| a.0.total_cmp(&b.0))?;
            (deviation_px <= limit_px).then_some(other)
        };
        let partners = |hypothesis: &Pose| (0..count).map(|view| partner(hypothesis, view)).collect::<Vec<_>>();
        let pairs = (0..count).flat_map(|i| (0..count).map(move |j| (i, j)));
        let candidates = pairs.flat_map(|(i, j)| self.hypotheses(i, j)).map(|hypothesis| partners(&hypothesis));
        candidates.max_by_key(|partners| partners.iter().flatten().count()).unwrap_or_default()
    }

    /// How an image of the second device fits one of the first if both were exchanged, pixels.
    pub(crate) fn exchanged_px(&self, second_from_first: &Pose, view: usize) -> Option<f64> {
        let (first, second) = (self.first[view]?, self.second[view]?);
        let fits = self.turns().map(|turn| self.deviation_px(&(second_from_first * second), &(first * turn)));
        fits.min_by(f64::total_cmp)
    }

    /// The arrangements for which two images show one pose.
    fn hypotheses(&self, first: usize, second: usize) -> Vec<Pose> {
        let (Some(first), Some(second)) = (self.first[first], self.second[second]) else { return Vec::new() };
        self.turns().map(|turn| second * turn * first.inverse()).collect()
    }

    fn turns(&self) -> impl Iterator<Item = UnitQuaternion<f64>> {
        let half_turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        std::iter::once(UnitQuaternion::identity()).chain(self.symmetric.then_some(half_turn))
    }

    fn median_px(&self, hypothesis: &Pose) -> f64 {
        let fits = (0..self.first.len()).filter_map(|view| self.fit(hypothesis, view, view));
        median(fits.map(|fit| fit.deviation_px).collect()).unwrap_or(f64::INFINITY)
    }

    /// How an image of the second device fits one of the first.
    fn fit(&self, second_from_first: &Pose, first: usize, second: usize) -> Option<ViewPose> {
        let predicted = second_from_first * self.first[first]?;
        let seen = self.second[second]?;
        let fits = self.turns().map(|turn| self.deviation_px(&predicted, &(seen * turn)));
        let (turn, deviation_px) = fits.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(ViewPose { deviation_px, half_turn: turn == 1 })
    }

    /// Root mean square distance of the images of the probes at two poses, pixels; infinite behind the device.
    fn deviation_px(&self, predicted: &Pose, seen: &Pose) -> f64 {
        let image = |pose: &Pose, probe: &Vector2<f64>| {
            let point = pose.rotation * probe.push(0.0) + pose.translation.vector;
            self.lens.image(&point).map(|image| image.pixel)
        };
        let squares = self.probes_m.iter().map(|probe| match (image(predicted, probe), image(seen, probe)) {
            (Some(a), Some(b)) => (a - b).norm_squared(),
            _ => f64::INFINITY,
        });
        (squares.sum::<f64>() / self.probes_m.len().max(1) as f64).sqrt()
    }
}
