//! The response of the projector: the grey level that makes a wanted light. In: light from 0 to 1. Out: a level of 8
//! bits.

/// Largest grey level.
const MAX: f64 = 255.0;
/// Entries of a table.
const ENTRIES: usize = 256;

/// How the grey level follows from the light.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Response {
    /// The light of the projector is proportional to the grey level.
    #[default]
    Linear,
    /// The light is the level (0 to 1) to this power, so the level is the light to its inverse.
    Gamma(f64),
    /// The level for the light k/255 is entry k. Between entries it is interpolated.
    Table(Vec<f64>),
}

/// A response is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ResponseError {
    /// The exponent is out of range.
    #[error("gamma is {0}; it must lie between 0.2 and 5")]
    Gamma(f64),
    /// The table has another number of entries.
    #[error("the gamma table has {0} lines; it must have 256, one for each grey level")]
    Entries(usize),
    /// A line is no number.
    #[error("line {line} of the gamma table is {text:?}; it must be a number between 0 and 255")]
    Line {
        /// Number of the line, from 1.
        line: usize,
        /// Its text.
        text: String,
    },
    /// The table decreases.
    #[error("line {line} of the gamma table is {level}, less than the line before; the table must not decrease")]
    Decreases {
        /// Number of the line, from 1.
        line: usize,
        /// Its level.
        level: f64,
    },
}

impl Response {
    /// Creates a response from the exponent of the projector.
    ///
    /// # Errors
    /// The exponent is not between 0.2 and 5.
    pub fn gamma(gamma: f64) -> Result<Self, ResponseError> {
        if (0.2..=5.0).contains(&gamma) { Ok(Self::Gamma(gamma)) } else { Err(ResponseError::Gamma(gamma)) }
    }

    /// Creates a response from a table of 256 levels.
    ///
    /// # Errors
    /// The table is too short or too long, decreases, or has a level that is not between 0 and 255.
    pub fn table(levels: Vec<f64>) -> Result<Self, ResponseError> {
        if levels.len() != ENTRIES {
            return Err(ResponseError::Entries(levels.len()));
        }
        for (index, &level) in levels.iter().enumerate() {
            let line = index + 1;
            if !(0.0..=MAX).contains(&level) {
                return Err(ResponseError::Line { line, text: level.to_string() });
            }
            if index > 0 && level < levels[index - 1] {
                return Err(ResponseError::Decreases { line, level });
            }
        }
        Ok(Self::Table(levels))
    }

    /// Parses the text of a table: a level in each line. Empty lines at the end do not count.
    ///
    /// # Errors
    /// As [`Self::table`].
    pub fn parse_table(text: &str) -> Result<Self, ResponseError> {
        let level = |(index, text): (usize, &str)| {
            text.trim().parse().map_err(|_| ResponseError::Line { line: index + 1, text: text.to_owned() })
        };
        Self::table(text.trim_end().lines().enumerate().map(level).collect::<Result<_, _>>()?)
    }

    /// Returns the grey level for a light from 0 to 1.
    #[must_use]
    pub fn level(&self, light: f64) -> u8 {
        let level = match self {
            Self::Linear => MAX * light,
            Self::Gamma(gamma) => MAX * light.powf(1.0 / gamma),
            Self::Table(levels) => {
                let place = (MAX * light).clamp(0.0, MAX);
                let (below, share) = (place.floor() as usize, place.fract());
                levels[below] * (1.0 - share) + levels[(below + 1).min(ENTRIES - 1)] * share
            }
        };
        level.round() as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_light_of_a_projector_with_gamma_is_linear() {
        for gamma in [0.5, 1.0, 2.2] {
            let response = Response::gamma(gamma).unwrap();
            for k in 0..=100 {
                let light = f64::from(k) / 100.0;
                let level = f64::from(response.level(light));
                let made = |level: f64| (level.max(0.0) / MAX).powf(gamma);
                assert!(made(level - 0.501) <= light && light <= made(level + 0.501), "{gamma} {light} {level}");
            }
        }
        assert!(Response::gamma(0.0).is_err() && Response::gamma(f64::NAN).is_err());
    }

    #[test]
    fn a_table_is_read_line_by_line_and_interpolated() {
        let text: String = (0..256).map(|k| format!("{}\n", (f64::from(k) / 255.0).sqrt() * 255.0)).collect();
        let table = Response::parse_table(&text).unwrap();
        let gamma = Response::gamma(2.0).unwrap();
        assert!((20..=255).all(|k| table.level(f64::from(k) / 255.0) == gamma.level(f64::from(k) / 255.0)));
        assert_eq!((table.level(0.0), table.level(1.0)), (0, 255));
    }

    #[test]
    fn a_wrong_table_is_refused_with_its_line() {
        let lines = |change: &dyn Fn(usize) -> String| (0..256).map(|k| change(k) + "\n").collect::<String>();
        let message = |text: String| Response::parse_table(&text).unwrap_err().to_string();
        assert!(message("1\n2\n".to_owned()).contains("2 lines"));
        assert!(message(lines(&|k| if k == 6 { "dark".to_owned() } else { k.to_string() })).contains("line 7"));
        assert!(message(lines(&|k| if k == 6 { "256".to_owned() } else { "3".to_owned() })).contains("line 7"));
        assert!(message(lines(&|k| if k == 6 { "nan".to_owned() } else { "3".to_owned() })).contains("line 7"));
        assert!(
            message(lines(&|k| if k == 6 { "2".to_owned() } else { "3".to_owned() })).contains("must not decrease")
        );
    }
}
