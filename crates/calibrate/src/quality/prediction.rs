//! Expected errors of measurements with a calibration: depth, distance from the epipolar line, and δ.
//!
//! In: the covariance of the rig's parameters and points of the measurement volume. Out: standard deviations. A small
//! error of the parameters moves the point that both cameras triangulate, and with it the column of the projector that it
//! should have. All is linear in the error, so the covariance carries over.

use std::f64::consts::TAU;

use fringeflow::geometry::{Pose, Vector3};
use nalgebra::{DMatrix, DVector, Matrix3, Vector2};

use crate::adjustment::{Layout, State, by_pose};
use crate::lens::{INTRINSICS, Imaged};

/// Number of points across, down and in depth.
const GRID: [usize; 3] = [7, 5, 4];

/// Expected errors at a point, or their root mean squares over points.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct ExpectedError {
    /// Standard deviation of the depth, millimetres.
    pub depth_mm: f64,
    /// Standard deviation of the distance from the epipolar line, pixels of C2.
    pub epipolar_px: f64,
    /// Standard deviation of the projector's column, pixels of the projector.
    pub column_px: f64,
}

impl ExpectedError {
    /// Standard deviation of δ for fringes of this period, rad.
    #[must_use]
    pub fn delta_rad(&self, period_px: f64) -> f64 {
        TAU * self.column_px / period_px
    }
}

/// How a point's errors depend on the rig's parameters.
#[derive(Clone, Debug)]
struct Sensitivity {
    depth_mm: DVector<f64>,
    epipolar_px: DVector<f64>,
    column_px: DVector<f64>,
}

/// Points of the measurement volume, with the sensitivity of their errors.
#[derive(Clone, Debug, Default)]
pub struct Probes {
    points: Vec<(Vector3, Sensitivity)>,
}

impl Probes {
    /// Points that both cameras and the projector see, on a grid of C1's image, between the nearest and the farthest pose
    /// of the board.
    #[must_use]
    pub fn between_poses(state: &State, sizes_px: &[[usize; 2]]) -> Self {
        let mut depths_m: Vec<f64> = state.boards.iter().map(|board| board.translation.z).collect();
        depths_m.sort_by(f64::total_cmp);
        let (Some(near_m), Some(far_m)) = (depths_m.first(), depths_m.last()) else {
            return Self { points: Vec::new() };
        };
        let camera = state.devices[0].lens.camera(sizes_px[0]);
        let share = |k: usize, of: usize| (k as f64 + 0.5) / of as f64;
        let mut points = Vec::new();
        for index in 0..GRID.iter().product() {
            let [i, j, k] = [index % GRID[0], index / GRID[0] % GRID[1], index / (GRID[0] * GRID[1])];
            let pixel = nalgebra::Point2::new(
                share(i, GRID[0]) * sizes_px[0][0] as f64 - 0.5,
                share(j, GRID[1]) * sizes_px[0][1] as f64 - 0.5,
            );
            let depth_m = near_m + (far_m - near_m) * k as f64 / (GRID[2] - 1) as f64;
            if let Some(ray) = camera.ray(&pixel) {
                points.push(ray * depth_m);
            }
        }
        Self::at(state, sizes_px, points)
    }

    /// The points that all devices see, in the frame of C1, metres.
    #[must_use]
    pub fn at(state: &State, sizes_px: &[[usize; 2]], points_m: Vec<Vector3>) -> Self {
        let visible = points_m.into_iter().filter_map(|point| {
            let sees = |d: usize| {
                let imaged = image(state, d, &point)?;
                state.devices[d].lens.camera(sizes_px[d]).sees(&imaged.image.pixel).then_some(imaged)
            };
            Some((point, sensitivity(state, &[sees(0)?, sees(1)?, sees(2)?])?))
        });
        Self { points: visible.collect() }
    }

    /// The points, in the frame of C1, metres.
    pub fn points_m(&self) -> impl Iterator<Item = &Vector3> {
        self.points.iter().map(|(point, _)| point)
    }

    /// Expected errors at each point. `covariance` is that of the rig's parameters, or of more that follow.
    #[must_use]
    pub fn errors(&self, covariance: &DMatrix<f64>) -> Vec<ExpectedError> {
        let sd = |by_parameters: &DVector<f64>| {
            let rig = covariance.view((0, 0), (by_parameters.len(), by_parameters.len()));
            (rig * by_parameters).dot(by_parameters).max(0.0).sqrt()
        };
        let errors = self.points.iter().map(|(_, by)| ExpectedError {
            depth_mm: sd(&by.depth_mm),
            epipolar_px: sd(&by.epipolar_px),
            column_px: sd(&by.column_px),
        });
        errors.collect()
    }

    /// Root mean squares of the expected errors; `None` if there is no point.
    #[must_use]
    pub fn rms(&self, covariance: &DMatrix<f64>) -> Option<ExpectedError> {
        let errors = self.errors(covariance);
        let rms = |of: fn(&ExpectedError) -> f64| {
            (errors.iter().map(|error| of(error).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
        };
        (!errors.is_empty()).then(|| ExpectedError {
            depth_mm: rms(|error| error.depth_mm),
            epipolar_px: rms(|error| error.epipolar_px),
            column_px: rms(|error| error.column_px),
        })
    }
}

/// Derivatives with respect to the rig's parameters at the triangulated point: of the projector's column, and of the distance
/// from the epipolar line. `None` behind a device.
pub(crate) fn scan_sensitivity(state: &State, point: &Vector3) -> Option<[DVector<f64>; 2]> {
    let seen = [image(state, 0, point)?, image(state, 1, point)?, image(state, 2, point)?];
    let Sensitivity { column_px, epipolar_px, .. } = sensitivity(state, &seen)?;
    Some([column_px, epipolar_px])
}

/// A point as a device images it.
struct Seen {
    device: usize,
    image: Imaged,
    /// The point turned into the device's directions, before the device's shift.
    turned: Vector3,
    from_first: Pose,
}

fn image(state: &State, device: usize, point: &Vector3) -> Option<Seen> {
    let from_first = state.devices[device].from_first;
    let turned = from_first.rotation * point;
    let image = state.devices[device].lens.image(&(turned + from_first.translation.vector))?;
    Some(Seen { device, image, turned, from_first })
}

impl Seen {
    /// Derivatives of column and row with respect to the point.
    fn by_point(&self) -> nalgebra::Matrix2x3<f64> {
        self.image.by_point * self.from_first.rotation.to_rotation_matrix().matrix()
    }

    /// Derivatives of column and row with respect to all parameters of the rig.
    fn by_rig(&self, layout: &Layout) -> DMatrix<f64> {
        let mut by_rig = DMatrix::zeros(2, layout.rig());
        by_rig.view_mut((0, layout.lens(self.device)), (2, INTRINSICS)).copy_from(&self.image.by_intrinsics);
        if let Some(at) = layout.arrangement(self.device) {
            for (k, column) in by_pose(&self.image.by_point, &self.turned).into_iter().enumerate() {
                by_rig.set_column(at + k, &column);
            }
        }
        by_rig
    }
}

fn sensitivity(state: &State, [cam1, cam2, projector]: &[Seen; 3]) -> Option<Sensitivity> {
    let layout = Layout::of(state);
    let (in_cam1, in_cam2) = (cam1.by_point(), cam2.by_point());
    // C1's frame is the first, so the turned point is the point itself, and the direction of C1's ray.
    let along = in_cam2 * cam1.turned;
    // The triangulated point is the one of C1's ray next to C2's ray, so its image in C1 stays, and that in C2 moves
    // across this direction only.
    let next = along.transpose() * (in_cam2 * in_cam2.transpose()).try_inverse()?;
    let mut held = Matrix3::zeros();
    held.fixed_rows_mut::<2>(0).copy_from(&in_cam1);
    held.fixed_rows_mut::<1>(2).copy_from(&(next * in_cam2));
    let cam2_by_rig = cam2.by_rig(&layout);
    let mut by_rig = DMatrix::zeros(3, layout.rig());
    by_rig.rows_mut(0, 2).copy_from(&cam1.by_rig(&layout));
    by_rig.row_mut(2).copy_from(&(next * &cam2_by_rig));
    let moved = -held.try_inverse()? * by_rig;
    let across = Vector2::new(-along.y, along.x).try_normalize(0.0)?;
    let in_projector = projector.by_point() * &moved + projector.by_rig(&layout);
    Some(Sensitivity {
        depth_mm: moved.row(2).transpose() * 1e3,
        epipolar_px: (in_cam2 * &moved + cam2_by_rig).transpose() * across,
        column_px: in_projector.row(0).transpose(),
    })
}
