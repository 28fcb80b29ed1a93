//! What bundle adjustment finds: lenses, arrangement, poses and shape of the board; and how a step changes it.

use fringeflow::geometry::{Pose, Vector3};
use nalgebra::{DVectorView, Translation3, UnitQuaternion, Vector2};

use crate::lens::{INTRINSICS, Lens};
use crate::shape::BoardShape;

/// Parameters of a pose: a rotation vector applied after the rotation, and a shift.
pub const POSE: usize = 6;

/// Number of the projector among the devices, after C1 and C2.
pub const PROJECTOR: usize = 2;

/// A camera or the projector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Device {
    /// Its lens.
    pub lens: Lens,
    /// Its frame from that of the first device.
    pub from_first: Pose,
}

/// All that is estimated.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// The devices. The frame of the first one is that of all others.
    pub devices: Vec<Device>,
    /// Pose of the board in the frame of the first device, for each view.
    pub boards: Vec<Pose>,
    /// How the board deviates from a plane.
    pub shape: BoardShape,
}

/// Where the parameters stand in a vector: lenses, arrangement, shape, poses of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    devices: usize,
    shape: usize,
    views: usize,
}

impl Layout {
    /// The layout of a state.
    #[must_use]
    pub fn of(state: &State) -> Self {
        Self { devices: state.devices.len(), shape: state.shape.modes().len(), views: state.boards.len() }
    }

    /// First intrinsic parameter of a device.
    #[must_use]
    pub fn lens(&self, device: usize) -> usize {
        device * INTRINSICS
    }

    /// First parameter of the pose of a device; the first device has none.
    #[must_use]
    pub fn arrangement(&self, device: usize) -> Option<usize> {
        device.checked_sub(1).map(|k| self.devices * INTRINSICS + k * POSE)
    }

    /// First mode of the shape.
    #[must_use]
    pub fn shape(&self) -> usize {
        self.devices * INTRINSICS + self.devices.saturating_sub(1) * POSE
    }

    /// Number of parameters of the rig, which come before those of shape and poses.
    #[must_use]
    pub fn rig(&self) -> usize {
        self.shape()
    }

    /// First parameter of the pose of the board in a view.
    #[must_use]
    pub fn board(&self, view: usize) -> usize {
        self.shape() + self.shape + view * POSE
    }

    /// Number of parameters.
    #[must_use]
    pub fn len(&self) -> usize {
        self.board(self.views)
    }

    /// Whether there is nothing to estimate.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl State {
    /// The state after a step.
    #[must_use]
    pub fn moved(&self, step: DVectorView<'_, f64>) -> Self {
        let layout = Layout::of(self);
        let pose = |pose: &Pose, at: usize| {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[at], step[at + 1], step[at + 2]));
            let shift = Vector3::new(step[at + 3], step[at + 4], step[at + 5]);
            Pose::from_parts(Translation3::from(pose.translation.vector + shift), turn * pose.rotation)
        };
        let devices = self.devices.iter().enumerate().map(|(d, device)| Device {
            lens: Lens(std::array::from_fn(|k| device.lens.0[k] + step[layout.lens(d) + k])),
            from_first: layout.arrangement(d).map_or(device.from_first, |at| pose(&device.from_first, at)),
        });
        Self {
            devices: devices.collect(),
            boards: self.boards.iter().enumerate().map(|(v, board)| pose(board, layout.board(v))).collect(),
            shape: self.shape.moved(|mode| step[layout.shape() + mode]),
        }
    }

    /// A point of the board in the frame of the first device.
    #[must_use]
    pub fn point(&self, view: usize, position_m: Vector2<f64>) -> Vector3 {
        let board = &self.boards[view];
        board.rotation * self.shape.point(position_m) + board.translation.vector
    }
}
