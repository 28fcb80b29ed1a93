//! Images that hold the views of both cameras.

/// Arrangement of two views in one image. View 0 is that of camera 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StereoLayout {
    /// View 0 is the left half.
    SideBySide,
    /// View 0 is the upper half.
    TopBottom,
}

impl StereoLayout {
    /// All arrangements.
    pub const ALL: [Self; 2] = [Self::SideBySide, Self::TopBottom];

    /// Name in configurations and datasets.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SideBySide => "side-by-side",
            Self::TopBottom => "top-bottom",
        }
    }

    /// The side of an image that the views divide: 0 the width, 1 the height.
    pub(super) fn divided_side(self) -> usize {
        match self {
            Self::SideBySide => 0,
            Self::TopBottom => 1,
        }
    }
}

impl std::fmt::Display for StereoLayout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
