//! How good something is.

/// State of a quantity or of the scanner, the better first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum HealthState {
    /// Too few windows have told anything of it.
    #[default]
    NotKnown = 0,
    /// As it should be.
    Ok = 1,
    /// Beyond what it should be; results still hold.
    Warn = 2,
    /// So far beyond that results are not what they claim.
    Bad = 3,
}

impl HealthState {
    /// All states.
    pub const ALL: [Self; 4] = [Self::NotKnown, Self::Ok, Self::Warn, Self::Bad];

    /// The state of a code in a message; not known for a code that is none.
    #[must_use]
    pub fn from_code(code: u32) -> Self {
        Self::ALL.into_iter().find(|state| *state as u32 == code).unwrap_or_default()
    }

    /// Its word for people, files and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NotKnown => "not known",
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Bad => "bad",
        }
    }

    /// The state of a word; `None` for one that is none.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }
}
