//! What was known of each window beforehand.

use std::collections::BTreeMap;

use fringeflow::prior::{Moment, Prior, WindowTimes};
use fringeflow_message::{PriorHeader, Window};
use fringeflow_wire as wire;

use super::content::Content;
use super::error::RecordingError;
use super::{Recording, Topic};

/// The priors of a recording.
#[derive(Clone, Debug, Default)]
pub struct Priors {
    by_number: BTreeMap<u64, (PriorHeader, Option<Prior>)>,
}

/// What a window was decoded with.
#[derive(Clone, Debug, PartialEq)]
pub enum Known<'a> {
    /// A prior of this age; `None` for none.
    Prior(Option<(&'a Prior, Moment)>),
    /// A prior that the recording does not hold.
    Missing,
}

impl Recording {
    /// All priors.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn priors(&self) -> Result<Priors, RecordingError> {
        let mut priors = Priors::default();
        for message in self.messages_of(Topic::Prior) {
            if let Content::Prior(header, relief) = message?.content {
                // Of two with one number the phase service takes the first.
                let prior = || (*header, wire::prior::read(&header, &relief));
                priors.by_number.entry(header.published).or_insert_with(prior);
            }
        }
        Ok(priors)
    }
}

impl Priors {
    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.by_number.is_empty()
    }

    /// What a window says that it was decoded with.
    #[must_use]
    pub fn of(&self, window: &Window) -> Known<'_> {
        let Some(number) = window.prior_number() else { return Known::Prior(None) };
        match self.by_number.get(&number) {
            Some((header, prior)) => {
                let moment = wire::prior::times(window).moment_after(header.centre_ns);
                Known::Prior(prior.as_ref().map(|prior| (prior, moment)))
            }
            None => Known::Missing,
        }
    }

    /// What a window would be decoded with live, whose last image came at a time.
    #[must_use]
    pub fn at(&self, received_ns: u64, times: &WindowTimes) -> Option<(&Prior, Moment)> {
        let is_settled = |(header, _): &&(PriorHeader, Option<Prior>)| header.is_settled_at(received_ns);
        let (header, prior) = self.by_number.values().rev().find(is_settled)?;
        prior.as_ref().map(|prior| (prior, times.moment_after(header.centre_ns)))
    }
}
