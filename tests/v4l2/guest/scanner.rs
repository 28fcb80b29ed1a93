//! Configurations of scanners with V4L2 cameras.

use crate::scenes::Scene;
use crate::support::NAME;

/// A scanner with the rig of a scene. `cameras` is more of the table of that name, `rest` more of the table of the recorder;
/// either may go on with other tables. After a cycle the images may show another scene, so windows hold no more than that.
pub(crate) fn configuration(scene: &Scene, cameras: &str, rest: &str) -> String {
    format!(
        "[instance]\nname = \"{NAME}\"\n[projector]\ndriver = \"cycle\"\n[cameras]\nsource = \"v4l2\"\n{cameras}\n\
         {}\n[phase]\nextra_images = 0\n[monitor]\nenabled = false\n[recorder]\nmin_free_mb = 0\n{rest}\n",
        scene.rig()
    )
}
