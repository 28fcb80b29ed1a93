//! Configurations of scanners with V4L2 cameras.

use crate::scenes;
use crate::support::NAME;

/// A scanner with the rig of the scenes. `cameras` is the table of that name, its first lines first; `rest` are tables, or lines of
/// tables, of other names.
pub(crate) fn configuration(cameras: &str, rest: &str) -> String {
    let rig = scenes::all()[0].rig();
    format!(
        "[instance]\nname = \"{NAME}\"\n[cameras]\nsource = \"v4l2\"\n{cameras}\n[projector]\ndriver = \"cycle\"\n\
         [recorder]\nfolder = \"recordings\"\nmin_free_mb = 0\n{rest}\n{rig}"
    )
}
