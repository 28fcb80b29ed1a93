//! Configurations of scanners with V4L2 cameras.

use crate::scenes::Scene;
use crate::support::NAME;

/// A scanner with the rig of a scene. `cameras` is the table of that name, without its source; `rest` are other tables.
pub(crate) fn configuration(scene: &Scene, cameras: &str, rest: &str) -> String {
    format!(
        "[instance]\nname = \"{NAME}\"\n[cameras]\nsource = \"v4l2\"\n{cameras}\n[projector]\ndriver = \"cycle\"\n\
         {rest}\n{}",
        scene.rig()
    )
}
