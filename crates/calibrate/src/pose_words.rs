//! A pose of the board in words.

/// Where the board is and how it is tilted, as a person in front of the scanner would say it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct PoseWords {
    /// Left, middle, right of C1's image; upper, middle, lower; near, middle, far: −1, 0, 1 each.
    pub place: [i8; 3],
    /// Turns about the x axis and the y axis of C1: −1, 0, 1 each.
    pub tilt: [i8; 2],
}

impl PoseWords {
    /// The tilts that are told apart.
    pub const TILTS: [[i8; 2]; 5] = [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]];
}

impl std::fmt::Display for PoseWords {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [column, row, distance] = self.place;
        let pick = |k: i8, names: [&'static str; 3]| names[(k + 1).clamp(0, 2) as usize];
        let place = match (pick(row, ["upper ", "", "lower "]), pick(column, ["left", "", "right"])) {
            ("", "") => "in the middle of the image".to_owned(),
            (row, "") => format!("in the {row}part of the image"),
            ("", column) => format!("in the {column} part of the image"),
            (row, column) => format!("in the {row}{column} part of the image"),
        };
        // A turn about x by a positive angle moves the lower edge away (z grows with y).
        let tilt = match self.tilt {
            [1, _] => "with its lower edge away from the scanner",
            [-1, _] => "with its upper edge away from the scanner",
            [_, 1] => "with its left edge away from the scanner",
            [_, -1] => "with its right edge away from the scanner",
            _ => "facing the scanner",
        };
        write!(f, "{}, {place}, {tilt}", pick(distance, ["near", "at medium distance", "far"]))
    }
}
