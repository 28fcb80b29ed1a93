//! The priors of a recording.

use fringeflow_wire::prior::Priors;

use crate::{Content, Recording, RecordingError, Topic};

impl Recording {
    /// Returns all priors, in the order of their numbers.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn priors(&self) -> Result<Priors, RecordingError> {
        let mut messages = Vec::new();
        for message in self.messages_of(Topic::Prior) {
            if let Content::Prior(header, relief) = message?.content {
                messages.push((header, relief));
            }
        }
        messages.sort_by_key(|(header, _)| header.published);
        let mut priors = Priors::default();
        for (header, relief) in &messages {
            // A prior with a repeated number is ignored, as in the phase service.
            let _ = priors.push(header, relief);
        }
        Ok(priors)
    }
}
