//! `patterns.toml`: the list of a set. In: a text or a set. Out: the other.

use std::fmt::Write as _;
use std::path::Path;

use serde::Deserialize;

use fringeflow::geometry::FringePattern;
use fringeflow_base::text_file::read_text;

use crate::set::{check_period, check_size};
use crate::{
    Depth, Direction, Flip, Orientation, Output, PATTERNS_FILE, Pattern, PatternError, PatternProblem, PatternSet,
    Response, Rotation,
};

/// Most images of a set.
const MAX_IMAGES: usize = 1000;
/// Bits of a Gray code.
const GRAY_BITS: u32 = 32;

/// Explains the file in its first lines.
const REMARK: &str = "\
# Patterns of a projector, in the order in which they are shown. Pixels have their centres at integers; column 0 is left,
# row 0 at the top of the upright image. Brightness is light, from 0 to 1.
#   fringes  (1 + cos(phi + shift_rad)) / 2, where phase_sign * phi = 2 pi u / period_px + phase_offset_rad;
#            u is the column, or for direction \"rows\" the row
#   gray     bit of the Gray code that counts half periods from the left (upper) border; bit 0 is the least significant
#   chart    for focus and alignment
# The images are rotated clockwise by rotate_deg, then mirrored. A projector shows what this list says; the files beside it
# are for devices that store their images.
";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSet {
    projector_px: [usize; 2],
    #[serde(default)]
    rotate_deg: u32,
    flip: Option<String>,
    bits: Option<u8>,
    #[serde(default)]
    packed: bool,
    gamma: Option<f64>,
    gamma_table: Option<Vec<f64>>,
    images: Vec<RawImage>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawImage {
    kind: String,
    direction: Option<String>,
    period_px: Option<f64>,
    phase_sign: Option<f64>,
    phase_offset_rad: Option<f64>,
    shift_rad: Option<f64>,
    bit: Option<u32>,
    file: Option<String>,
    plane: Option<String>,
}

impl PatternSet {
    /// Reads the list of a set: the file, or `patterns.toml` of the folder.
    ///
    /// # Errors
    /// [`PatternError`], which names file, field and value.
    pub fn read(path: &Path) -> Result<Self, PatternError> {
        let file = if path.is_dir() { path.join(PATTERNS_FILE) } else { path.to_owned() };
        let text = read_text(&file).map_err(|e| PatternError::new(&file, e))?;
        Self::from_toml(&text).map_err(|problem| PatternError::new(&file, problem))
    }

    /// Reads a set from the text of its list.
    ///
    /// # Errors
    /// [`PatternProblem`], which names field and value.
    pub fn from_toml(text: &str) -> Result<Self, PatternProblem> {
        let raw: RawSet =
            toml::from_str(text).map_err(|e| PatternProblem::Toml(e.to_string().trim_end().to_owned()))?;
        check_size(raw.projector_px)?;
        let count = raw.images.len();
        if !(1..=MAX_IMAGES).contains(&count) {
            return Err(PatternProblem::value("the number of images", &count, "it must lie between 1 and 1000"));
        }
        let output = raw.output()?;
        let images = raw.images.iter().enumerate();
        let images = images.map(|(index, image)| image.pattern(&Fields { index }, raw.projector_px));
        let set = Self { projector_px: raw.projector_px, images: images.collect::<Result<_, _>>()?, output };
        for (index, image) in raw.images.iter().enumerate() {
            let fields = Fields { index };
            check_place(fields.name("file"), image.file.as_deref(), Some(set.file_name(index)))?;
            check_place(fields.name("plane"), image.plane.as_deref(), set.plane(index))?;
        }
        Ok(set)
    }

    /// The text of the list. Reading it gives the same set.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let Self { projector_px, output, .. } = self;
        let mut text = REMARK.to_owned();
        if output.packed {
            text += "# Each file holds several images: bit k of green is plane Gk, and so on (DLPC350, LightCrafter 4500).\n";
        }
        let mut line = |line: String| text += &(line + "\n");
        line(format!("\nprojector_px = {projector_px:?}"));
        line(format!("rotate_deg = {}", output.orientation.rotation.degrees()));
        line(format!("flip = {:?}", output.orientation.flip.name()));
        line(format!("bits = {}", output.depth.bits()));
        line(format!("packed = {}", output.packed));
        match &output.depth {
            Depth::Eight(Response::Gamma(gamma)) => line(format!("gamma = {gamma:?}")),
            Depth::Eight(Response::Table(levels)) => line(format!("gamma_table = {levels:?}")),
            Depth::Eight(Response::Linear) | Depth::One => {}
        }
        for (index, pattern) in self.images.iter().enumerate() {
            text += &self.image_text(index, pattern);
        }
        text
    }

    fn image_text(&self, index: usize, pattern: &Pattern) -> String {
        let mut text = format!("\n[[images]]\nkind = {:?}\n", pattern.kind());
        // Writing to a text cannot fail.
        let _ = match pattern {
            Pattern::Fringes { direction, pattern: FringePattern { period_px, sign, offset_rad }, shift_rad } => {
                write!(
                    text,
                    "direction = {:?}\nperiod_px = {period_px:?}\nphase_sign = {sign:?}\nphase_offset_rad = {offset_rad:?}\n\
                 shift_rad = {shift_rad:?}\n",
                    direction.name()
                )
            }
            Pattern::Gray { direction, period_px, bit } => {
                write!(text, "direction = {:?}\nperiod_px = {period_px:?}\nbit = {bit}\n", direction.name())
            }
            Pattern::White | Pattern::Black | Pattern::Chart { .. } => Ok(()),
        };
        text += &format!("file = {:?}\n", self.file_name(index));
        text + &self.plane(index).map_or(String::new(), |plane| format!("plane = {plane:?}\n"))
    }
}

impl RawSet {
    fn output(&self) -> Result<Output, PatternProblem> {
        let rotation = Rotation::ALL.into_iter().find(|rotation| rotation.degrees() == self.rotate_deg);
        let rotation = rotation
            .ok_or_else(|| PatternProblem::value("rotate_deg", &self.rotate_deg, "it must be 0, 90, 180 or 270"))?;
        let flip = match self.flip.as_deref() {
            None => Flip::None,
            Some(name) => named("flip".to_owned(), name, &Flip::ALL, Flip::name)?,
        };
        let response = match (self.gamma, &self.gamma_table) {
            (None, None) => Response::Linear,
            (Some(gamma), None) => Response::gamma(gamma)?,
            (None, Some(levels)) => Response::table(levels.clone())?,
            (Some(gamma), Some(_)) => {
                return Err(PatternProblem::value("gamma", &gamma, "gamma_table states the response too; remove one"));
            }
        };
        let depth = match self.bits.unwrap_or(8) {
            8 => Depth::Eight(response),
            1 if response == Response::Linear => Depth::One,
            1 => {
                return Err(PatternProblem::value("bits", &1, "such images have no grey to correct; remove the gamma"));
            }
            bits => return Err(PatternProblem::value("bits", &bits, "it must be 8 or 1")),
        };
        Ok(Output { orientation: Orientation { rotation, flip }, depth, packed: self.packed })
    }
}

impl RawImage {
    fn pattern(&self, fields: &Fields, size_px: [usize; 2]) -> Result<Pattern, PatternProblem> {
        let kinds = [Pattern::White, Pattern::Black, Pattern::Chart { size_px }];
        let pattern = match self.kind.as_str() {
            "fringes" => {
                let finite = |name, value: f64| {
                    let refused =
                        || PatternProblem::value(fields.name(name), &value, "it must be a finite number of rad");
                    value.is_finite().then_some(value).ok_or_else(refused)
                };
                let sign = self.phase_sign.unwrap_or(1.0);
                if sign.abs() != 1.0 {
                    return Err(PatternProblem::value(fields.name("phase_sign"), &sign, "it must be 1 or -1"));
                }
                let period_px = self.period_px(fields)?;
                Pattern::Fringes {
                    direction: self.direction(fields)?,
                    pattern: FringePattern {
                        period_px,
                        sign,
                        offset_rad: match self.phase_offset_rad {
                            Some(offset) => finite("phase_offset_rad", offset)?,
                            None => crate::usual_fringes(period_px).offset_rad,
                        },
                    },
                    shift_rad: finite("shift_rad", fields.required("shift_rad", self.shift_rad, "give rad")?)?,
                }
            }
            "gray" => Pattern::Gray {
                direction: self.direction(fields)?,
                period_px: self.period_px(fields)?,
                bit: match fields.required("bit", self.bit, "0 is the least significant")? {
                    bit if bit < GRAY_BITS => bit,
                    bit => return Err(PatternProblem::value(fields.name("bit"), &bit, "it must lie between 0 and 31")),
                },
            },
            kind => kinds.into_iter().find(|pattern| pattern.kind() == kind).ok_or_else(|| {
                let expected = "it must be fringes, gray, white, black or chart";
                PatternProblem::value(fields.name("kind"), &format!("{kind:?}"), expected)
            })?,
        };
        self.check_unused(fields, &pattern)?;
        Ok(pattern)
    }

    fn check_unused(&self, fields: &Fields, pattern: &Pattern) -> Result<(), PatternProblem> {
        let (is_fringes, is_plain) =
            (pattern.kind() == "fringes", !matches!(pattern, Pattern::Fringes { .. } | Pattern::Gray { .. }));
        let given = [
            ("direction", self.direction.is_some() && is_plain),
            ("period_px", self.period_px.is_some() && is_plain),
            ("phase_sign", self.phase_sign.is_some() && !is_fringes),
            ("phase_offset_rad", self.phase_offset_rad.is_some() && !is_fringes),
            ("shift_rad", self.shift_rad.is_some() && !is_fringes),
            ("bit", self.bit.is_some() && pattern.kind() != "gray"),
        ];
        let unused = given.into_iter().find(|(_, is_unused)| *is_unused);
        unused
            .map_or(Ok(()), |(name, _)| Err(PatternProblem::Unused { field: fields.name(name), kind: pattern.kind() }))
    }

    fn direction(&self, fields: &Fields) -> Result<Direction, PatternProblem> {
        let name = fields.required("direction", self.direction.as_deref(), "it must be \"columns\" or \"rows\"")?;
        named(fields.name("direction"), name, &Direction::BOTH, Direction::name)
    }

    fn period_px(&self, fields: &Fields) -> Result<f64, PatternProblem> {
        let period_px = fields.required("period_px", self.period_px, "give projector pixels")?;
        check_period(&fields.name("period_px"), period_px).map(|()| period_px)
    }
}

/// Names of the fields of an image.
struct Fields {
    /// Index of the image.
    index: usize,
}

impl Fields {
    fn name(&self, field: &str) -> String {
        format!("images[{}].{field}", self.index)
    }

    fn required<T>(&self, field: &str, value: Option<T>, expected: &'static str) -> Result<T, PatternProblem> {
        value.ok_or_else(|| PatternProblem::Missing { field: self.name(field), expected })
    }
}

fn named<T: Copy>(field: String, name: &str, all: &[T], name_of: fn(T) -> &'static str) -> Result<T, PatternProblem> {
    all.iter().copied().find(|&value| name_of(value) == name).ok_or_else(|| {
        let known: Vec<String> = all.iter().map(|&value| format!("{:?}", name_of(value))).collect();
        PatternProblem::value(field, &format!("{name:?}"), format!("it must be one of {}", known.join(", ")))
    })
}

/// Checks a stated file or plane, which follow from the order of the images.
fn check_place(field: String, stated: Option<&str>, place: Option<String>) -> Result<(), PatternProblem> {
    let Some(stated) = stated.filter(|stated| Some(*stated) != place.as_deref()) else { return Ok(()) };
    let expected = match place {
        Some(place) => format!("from its place in the list it is {place:?}; correct it or leave it out"),
        None => "only packed images have a plane; remove it".to_owned(),
    };
    Err(PatternProblem::value(field, &format!("{stated:?}"), expected))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FringeCycle;

    #[test]
    fn a_set_is_read_as_it_was_written() {
        let cycle = FringeCycle {
            pattern: FringePattern { period_px: 18.3, sign: -1.0, offset_rad: 0.1 },
            shifts_rad: vec![0.0, 2.1, 4.2],
        };
        let calibration = PatternSet::calibration([64, 40], &cycle).unwrap();
        let chart = PatternSet::chart([64, 40]).unwrap();
        let table = Response::table((0..256).map(f64::from).collect()).unwrap();
        let depths =
            [Depth::One, Depth::Eight(Response::Linear), Depth::Eight(Response::Gamma(2.2)), Depth::Eight(table)];
        for depth in depths {
            for (packed, rotation, flip) in
                [(true, Rotation::Half, Flip::None), (false, Rotation::Quarter, Flip::Vertical)]
            {
                let output = Output { orientation: Orientation { rotation, flip }, depth: depth.clone(), packed };
                for set in [&calibration, &chart] {
                    let set = PatternSet { output: output.clone(), ..set.clone() };
                    assert_eq!(PatternSet::from_toml(&set.to_toml()).unwrap(), set);
                }
            }
        }
    }

    #[test]
    fn a_short_list_has_defaults() {
        let text = "projector_px = [64, 40]\n[[images]]\nkind = \"fringes\"\ndirection = \"columns\"\nperiod_px = 16\n\
                    shift_rad = 0\n";
        let set = PatternSet::from_toml(text).unwrap();
        let cycle = FringeCycle { shifts_rad: vec![0.0], ..FringeCycle::even(4, 16.0) };
        let Pattern::Fringes { pattern, .. } = set.images[0] else { panic!("{set:?}") };
        assert_eq!((pattern, set.output), (cycle.pattern, Output::default()));
    }

    #[test]
    fn wrong_lists_are_refused_with_field_and_value() {
        let image = |fields: &str| {
            let text = format!("projector_px = [64, 40]\n[[images]]\nkind = \"white\"\n[[images]]\n{fields}");
            PatternSet::from_toml(&text).unwrap_err().to_string()
        };
        let head = |fields: &str| {
            let text = format!("{fields}\n[[images]]\nkind = \"white\"\n");
            PatternSet::from_toml(&text).unwrap_err().to_string()
        };
        for (message, told) in [
            (image("kind = \"stripes\""), "images[1].kind is \"stripes\""),
            (image("kind = \"white\"\nbit = 3"), "images[1].bit does not apply"),
            (image("kind = \"gray\"\ndirection = \"rows\"\nperiod_px = 16"), "images[1].bit is missing"),
            (image("kind = \"gray\"\ndirection = \"rows\"\nperiod_px = 16\nbit = 32"), "images[1].bit is 32"),
            (
                image("kind = \"gray\"\ndirection = \"down\"\nperiod_px = 16\nbit = 2"),
                "images[1].direction is \"down\"",
            ),
            (
                image("kind = \"fringes\"\ndirection = \"rows\"\nperiod_px = 1\nshift_rad = 0"),
                "images[1].period_px is 1",
            ),
            (
                image("kind = \"fringes\"\ndirection = \"rows\"\nperiod_px = 16\nshift_rad = inf"),
                "images[1].shift_rad is inf",
            ),
            (
                image("kind = \"fringes\"\ndirection = \"rows\"\nperiod_px = 16\nshift_rad = 0\nphase_sign = 2"),
                "images[1].phase_sign is 2",
            ),
            (image("kind = \"black\"\nfile = \"../black.png\""), "images[1].file is \"../black.png\""),
            (image("kind = \"black\"\nplane = \"G0\""), "only packed images"),
            (image("kind = \"black\"\nlight = 2"), "unknown field `light`"),
            (head("projector_px = [64, 0]"), "projector_px is [64, 0]"),
            (head("projector_px = [64, 40]\nrotate_deg = 45"), "rotate_deg is 45"),
            (head("projector_px = [64, 40]\nflip = \"both\""), "flip is \"both\""),
            (head("projector_px = [64, 40]\nbits = 4"), "bits is 4"),
            (head("projector_px = [64, 40]\nbits = 1\ngamma = 2"), "bits is 1"),
            (head("projector_px = [64, 40]\ngamma = -1"), "gamma is -1"),
            (head("projector_px = [64, 40]\ngamma_table = [1, 2]"), "2 lines"),
            (head("projector_px = [64, 40]\ngamme = 2"), "unknown field `gamme`"),
            (head("projector_px = \"big\""), "not a valid list"),
        ] {
            assert!(message.contains(told), "{told}: {message}");
        }
        let none = PatternSet::from_toml("projector_px = [64, 40]\nimages = []").unwrap_err().to_string();
        assert!(none.contains("the number of images is 0"), "{none}");
    }

    #[test]
    fn a_missing_or_other_file_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let message = PatternSet::read(folder.path()).unwrap_err().to_string();
        assert!(message.contains("patterns.toml: cannot be read"), "{message}");
        let file = folder.path().join("list.toml");
        std::fs::write(&file, b"\x89PNG").unwrap();
        let message = PatternSet::read(&file).unwrap_err().to_string();
        assert!(message.contains("list.toml: is a PNG image"), "{message}");
    }
}
