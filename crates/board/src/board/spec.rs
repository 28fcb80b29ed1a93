//! The written form of a board: `kind:ACROSSxDOWN:field=value:…`, lengths in millimetres.
//!
//! | kind | counts | fields |
//! |---|---|---|
//! | `chessboard` | inner corners, as OpenCV does | `square` |
//! | `charuco` | squares, as OpenCV does | `square`, `marker`, `dictionary` |
//! | `circles` | circles | `spacing` (between centres), `diameter` |
//! | `asymmetric-circles` | circles of a row, and rows | `spacing` (between rows), `diameter` |
//! | `aprilgrid` | tags | `tag`, `gap`, `family` (36h11 unless given) |

use std::fmt;
use std::str::FromStr;

use super::{Board, BoardError, Pattern, Tags};

/// Most elements across and down.
const MOST_ELEMENTS: usize = 100;
/// Shortest and longest length, millimetres.
const LENGTHS_MM: [f64; 2] = [0.01, 5000.0];
/// Family of the tags of an AprilGrid.
const USUAL_FAMILY: &str = "36h11";

/// A kind of board.
struct Kind {
    name: &'static str,
    /// What is counted across and down, and its smallest number.
    elements: &'static str,
    least: usize,
    fields: &'static [&'static str],
    example: &'static str,
    build: fn(&Fields<'_>) -> Result<Pattern, BoardError>,
}

const KINDS: [Kind; 5] = [
    Kind {
        name: "chessboard",
        elements: "inner corners",
        least: 3,
        fields: &["square"],
        example: "chessboard:9x6:square=25",
        build: |f| Ok(Pattern::Chessboard { corners: f.count, square_mm: f.length("square")? }),
    },
    Kind {
        name: "charuco",
        elements: "squares",
        least: 3,
        fields: &["square", "marker", "dictionary"],
        example: "charuco:14x10:square=12:marker=9:dictionary=4x4_250",
        build: charuco,
    },
    Kind {
        name: "circles",
        elements: "circles",
        least: 3,
        fields: &["spacing", "diameter"],
        example: "circles:9x7:spacing=20:diameter=12",
        build: |f| {
            let [spacing_mm, diameter_mm] = f.circles(1.0)?;
            Ok(Pattern::Circles { circles: f.count, spacing_mm, diameter_mm })
        },
    },
    Kind {
        name: "asymmetric-circles",
        elements: "circles",
        least: 3,
        fields: &["spacing", "diameter"],
        example: "asymmetric-circles:4x11:spacing=20:diameter=15",
        build: |f| {
            let [spacing_mm, diameter_mm] = f.circles(std::f64::consts::SQRT_2)?;
            Ok(Pattern::AsymmetricCircles { circles: f.count, spacing_mm, diameter_mm })
        },
    },
    Kind {
        name: "aprilgrid",
        elements: "tags",
        least: 2,
        fields: &["tag", "gap", "family"],
        example: "aprilgrid:6x6:tag=20:gap=6",
        build: april_grid,
    },
];

/// The fields of a description, as text.
pub(super) struct Fields<'a> {
    kind: &'static Kind,
    count: [usize; 2],
    values: Vec<(&'a str, &'a str)>,
}

impl<'a> Fields<'a> {
    /// Checks kind, count and names of the fields.
    pub(super) fn new(kind: &str, count: &str, values: Vec<(&'a str, &'a str)>) -> Result<Self, BoardError> {
        let known = KINDS.iter().find(|known| known.name == kind);
        let kind = known.ok_or_else(|| BoardError::Kind { kind: kind.to_owned() })?;
        let Kind { elements, least, example, .. } = *kind;
        let counts = count.split_once(['x', '×']).map(|(nx, ny)| (nx.trim().parse(), ny.trim().parse()));
        let Some((Ok(nx), Ok(ny))) = counts else {
            return Err(BoardError::Size { text: count.to_owned(), elements, example });
        };
        if [nx, ny].iter().any(|n| !(least..=MOST_ELEMENTS).contains(n)) {
            return Err(BoardError::Count { nx, ny, elements, least, most: MOST_ELEMENTS, example });
        }
        for (i, (field, _)) in values.iter().enumerate() {
            if !kind.fields.contains(field) {
                return Err(BoardError::Unknown { field: (*field).to_owned(), known: kind.fields, example });
            }
            if values[..i].iter().any(|(other, _)| other == field) {
                return Err(BoardError::Twice { field: (*field).to_owned() });
            }
        }
        Ok(Self { kind, count: [nx, ny], values })
    }

    pub(super) fn board(&self) -> Result<Board, BoardError> {
        Ok(Board { pattern: (self.kind.build)(self)? })
    }

    fn given(&self, field: &str) -> Option<&'a str> {
        self.values.iter().find(|(name, _)| *name == field).map(|(_, value)| *value)
    }

    fn text(&self, field: &'static str) -> Result<&'a str, BoardError> {
        self.given(field).ok_or(BoardError::Missing { field, example: self.kind.example })
    }

    fn length(&self, field: &'static str) -> Result<f64, BoardError> {
        let text = self.text(field)?;
        let [least, most] = LENGTHS_MM;
        let length = text.trim_end_matches("mm").trim().parse().ok().filter(|mm| (least..=most).contains(mm));
        length.ok_or_else(|| BoardError::Length { field, text: text.to_owned(), least, most })
    }

    /// A length that must be below a limit.
    fn below(&self, field: &'static str, limit: f64, reason: &'static str) -> Result<f64, BoardError> {
        let value = self.length(field)?;
        if value < limit { Ok(value) } else { Err(BoardError::DoesNotFit { field, value, limit, reason }) }
    }

    /// Spacing and diameter; neighbours are `apart` spacings from each other.
    fn circles(&self, apart: f64) -> Result<[f64; 2], BoardError> {
        let spacing_mm = self.length("spacing")?;
        Ok([spacing_mm, self.below("diameter", apart * spacing_mm, "or the circles touch each other")?])
    }

    fn tags(&self, field: &'static str, prefix: &str, name: &str, needed: usize) -> Result<Tags, BoardError> {
        let unknown = || {
            let known =
                Tags::names().iter().filter_map(|known| known.strip_prefix(prefix).map(str::to_owned)).collect();
            BoardError::Dictionary { field, name: name.to_owned(), known }
        };
        let tags = Tags::named(name).or_else(|| Tags::named(&format!("{prefix}{name}"))).ok_or_else(unknown)?;
        if tags.count() < needed {
            return Err(BoardError::FewMarkers { field, name: name.to_owned(), needed, available: tags.count() });
        }
        Ok(tags)
    }
}

fn charuco(f: &Fields<'_>) -> Result<Pattern, BoardError> {
    let square_mm = f.length("square")?;
    let marker_mm = f.below("marker", square_mm, "the side of a square, because a white border must surround it")?;
    let [nx, ny] = f.count;
    let dictionary = f.tags("dictionary", "", f.text("dictionary")?, nx * ny / 2)?;
    Ok(Pattern::Charuco { squares: f.count, square_mm, marker_mm, dictionary })
}

fn april_grid(f: &Fields<'_>) -> Result<Pattern, BoardError> {
    let tag_mm = f.length("tag")?;
    let gap_mm = f.below("gap", tag_mm, "the side of a tag")?;
    let family = f.tags("family", "apriltag_", f.given("family").unwrap_or(USUAL_FAMILY), f.count[0] * f.count[1])?;
    Ok(Pattern::AprilGrid { tags: f.count, tag_mm, gap_mm, family })
}

impl FromStr for Board {
    type Err = BoardError;

    fn from_str(text: &str) -> Result<Self, BoardError> {
        let mut parts = text.trim().split(':');
        let kind = parts.next().unwrap_or_default();
        let count = parts.next().unwrap_or_default();
        let values = parts.map(|part| part.split_once('=').unwrap_or((part, ""))).collect();
        Fields::new(kind, count, values)?.board()
    }
}

impl fmt::Display for Board {
    /// Writes the description that gives the same board.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.pattern {
            Pattern::Chessboard { corners: [nx, ny], square_mm } => {
                write!(f, "chessboard:{nx}x{ny}:square={square_mm}")
            }
            Pattern::Charuco { squares: [nx, ny], square_mm, marker_mm, dictionary } => {
                let name = dictionary.name();
                write!(f, "charuco:{nx}x{ny}:square={square_mm}:marker={marker_mm}:dictionary={name}")
            }
            Pattern::Circles { circles: [nx, ny], spacing_mm, diameter_mm } => {
                write!(f, "circles:{nx}x{ny}:spacing={spacing_mm}:diameter={diameter_mm}")
            }
            Pattern::AsymmetricCircles { circles: [nx, ny], spacing_mm, diameter_mm } => {
                write!(f, "asymmetric-circles:{nx}x{ny}:spacing={spacing_mm}:diameter={diameter_mm}")
            }
            Pattern::AprilGrid { tags: [nx, ny], tag_mm, gap_mm, family } => {
                write!(f, "aprilgrid:{nx}x{ny}:tag={tag_mm}:gap={gap_mm}")?;
                match family.name().trim_start_matches("apriltag_") {
                    USUAL_FAMILY => Ok(()),
                    other => write!(f, ":family={other}"),
                }
            }
        }
    }
}
