//! Shared by all lines: the extent of the measurement, the scenes, and the peers.

use std::cell::OnceCell;
use std::rc::Rc;
use std::sync::Arc;

use fringeflow::correspondence::SegmentTable;
use fringeflow_base::grey::PixelFormat;

use super::peers::Peers;
use super::scenes::{FULL_PX, Geometry, Images, SMALL_PX, Scene};

/// Steps per window.
pub(crate) const STEPS: usize = 4;

/// Settings and shared data of a run.
pub(crate) struct Bench {
    /// Whether this run measures. Otherwise it only checks that all lines work.
    pub(crate) is_measured: bool,
    /// Whether the growth of memory is measured over ten minutes.
    pub(crate) is_long: bool,
    /// Interleaved repetitions per line.
    pub(crate) repetitions: usize,
    pub(crate) size_px: [usize; 2],
    easy: OnceCell<Rc<PreparedScene>>,
    hard: OnceCell<Rc<PreparedScene>>,
    peers: Option<Result<Peers, String>>,
}

/// A scene with its segment table and one window.
pub(crate) struct PreparedScene {
    pub(crate) scene: Scene,
    pub(crate) table: Arc<SegmentTable>,
    pub(crate) images: Images,
}

impl Bench {
    pub(crate) fn new(arguments: &[String]) -> Self {
        let has = |name: &str| arguments.iter().any(|argument| argument == name);
        // `cargo test` runs benches without `--bench`.
        let is_measured = has("--bench");
        let repetitions = if !is_measured {
            1
        } else if has("--quick") {
            5
        } else {
            15
        };
        let size_px = if is_measured { FULL_PX } else { SMALL_PX };
        let (easy, hard) = (OnceCell::new(), OnceCell::new());
        Self { is_measured, is_long: has("--long"), repetitions, size_px, easy, hard, peers: None }
    }

    /// The scene with the projector inside the base.
    pub(crate) fn easy(&self) -> Rc<PreparedScene> {
        Rc::clone(self.easy.get_or_init(|| Rc::new(PreparedScene::new(Geometry::Easy, self.size_px))))
    }

    /// The scene with the projector outside the base.
    pub(crate) fn hard(&self) -> Rc<PreparedScene> {
        Rc::clone(self.hard.get_or_init(|| Rc::new(PreparedScene::new(Geometry::Hard, self.size_px))))
    }

    /// The peers in Python, or the reason why they are missing.
    pub(crate) fn peers(&mut self) -> Result<&mut Peers, String> {
        if self.peers.is_none() {
            let peers = if self.is_measured {
                Peers::start(&self.easy())
            } else {
                Err("not measured: the peers are not set up".to_owned())
            };
            self.peers = Some(peers);
        }
        match self.peers.as_mut() {
            Some(Ok(peers)) => Ok(peers),
            Some(Err(why)) => Err(why.clone()),
            None => Err(String::new()),
        }
    }
}

impl PreparedScene {
    pub(crate) fn new(geometry: Geometry, size_px: [usize; 2]) -> Self {
        let scene = Scene::new(geometry, size_px);
        let (table, images) = (Arc::new(scene.table()), scene.images(STEPS, PixelFormat::Grey));
        Self { scene, table, images }
    }
}
