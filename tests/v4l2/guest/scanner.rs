//! Configurations of scanners with V4L2 cameras.

use crate::scenes::Scene;
use crate::support::NAME;

/// A scanner with the rig of a scene. `cameras` is appended to the table `[cameras]`, `rest` to `[recorder]`; both may
/// add further tables. Windows hold one cycle, because the images after it may show another scene.
pub(crate) fn configuration(scene: &Scene, cameras: &str, rest: &str) -> String {
    format!(
        "[instance]\nname = \"{NAME}\"\n[projector]\ndriver = \"cycle\"\n[cameras]\nsource = \"v4l2\"\n{cameras}\n\
         {}\n[phase]\nextra_images = 0\n[monitor]\nenabled = false\n[recorder]\nmin_free_mb = 0\n{rest}\n",
        scene.rig_tables()
    )
}
