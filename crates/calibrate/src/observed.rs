//! All poses of a folder, observed.

use fringeflow_board::Board;
use nalgebra::Vector2;
use rayon::prelude::*;

use crate::folder::{CalibrationFolder, FolderError, PoseFiles, read_image};
use crate::images::{ImageSigns, NoView, observe};
use crate::observations::{CameraView, View};
use crate::rig::RigViews;

/// What the images of one pose showed.
#[derive(Clone, Debug)]
pub struct ObservedPose {
    /// What people call it.
    pub name: String,
    /// Of each camera: the signs of its images, or why it saw no board.
    pub cameras: [Result<ImageSigns, NoView>; 2],
}

/// All poses of a folder.
#[derive(Clone, Debug)]
pub struct Observed {
    /// The poses, as many as views.
    pub poses: Vec<ObservedPose>,
    /// What the calibration is computed from.
    pub views: RigViews,
    /// Period of the fringes along the columns, projector pixels; `None` without patterns.
    pub period_px: Option<f64>,
}

impl Observed {
    /// Reads all images and finds the board in them. Calls `on_pose` after each pose. The poses are read by all threads,
    /// and the result does not depend on their number.
    ///
    /// # Errors
    /// An image cannot be read, or has another size than the others of its camera.
    pub fn read(
        folder: &CalibrationFolder,
        board: &Board,
        scale: [f64; 2],
        on_pose: impl Fn() + Sync,
    ) -> Result<Self, FolderError> {
        let observed: Vec<_> = folder
            .poses
            .par_iter()
            .map(|pose| {
                let observed = observe_pose(folder, board, pose);
                on_pose();
                observed
            })
            .collect::<Result<_, _>>()?;
        let mut sizes_px = vec![observed[0].2[0], observed[0].2[1]];
        for (pose, (.., sizes)) in folder.poses.iter().zip(&observed) {
            for camera in 0..2 {
                let ([width, height], [expected_width, expected_height]) = (sizes[camera], sizes_px[camera]);
                if sizes[camera] != sizes_px[camera] {
                    let problem =
                        fringeflow_dataset::Problem::ImageSize { width, height, expected_width, expected_height };
                    return Err(FolderError { path: pose.cameras[camera][0].clone(), problem: problem.into() });
                }
            }
        }
        sizes_px.extend(folder.order.as_ref().map(|order| order.projector_px));
        let features = board.features();
        let features_m = features.iter().map(|f| Vector2::new(f[0] * scale[0], f[1] * scale[1]) * 1e-3);
        let views = RigViews {
            features_m: features_m.collect(),
            symmetric: board.turns() > 1,
            free_shape: false,
            sizes_px,
            views: observed.iter().map(|(view, ..)| view.clone()).collect(),
        };
        let period_px = folder.order.as_ref().map(crate::images::PatternOrder::period_px);
        Ok(Self { poses: observed.into_iter().map(|(_, pose, _)| pose).collect(), views, period_px })
    }
}

fn observe_pose(
    folder: &CalibrationFolder,
    board: &Board,
    pose: &PoseFiles,
) -> Result<(View, ObservedPose, [[usize; 2]; 2]), FolderError> {
    let mut view = View::default();
    let mut sizes_px = [[0; 2]; 2];
    let mut signs = [Err(NoView::Sizes), Err(NoView::Sizes)];
    for camera in 0..2 {
        let images = pose.cameras[camera].iter().map(|path| read_image(path)).collect::<Result<Vec<_>, _>>()?;
        sizes_px[camera] = images.first().map_or([0; 2], |image| [image.width, image.height]);
        signs[camera] = match observe(board, &images, folder.order.as_ref()) {
            Ok((seen, signs)) => {
                view.cameras[camera] = seen;
                Ok(signs)
            }
            Err(why) => {
                view.cameras[camera] = CameraView::default();
                Err(why)
            }
        };
    }
    Ok((view, ObservedPose { name: pose.name.clone(), cameras: signs }, sizes_px))
}
