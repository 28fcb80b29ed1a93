//! The channels of a file, and which of them are those of Fringeflow.

use std::collections::BTreeMap;

use crate::Topic;
use crate::fields::Fields;

/// A channel of a file.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    /// Name of its topic.
    pub(super) name: String,
    /// `None` if the channel is not one of Fringeflow.
    pub(super) topic: Option<Topic>,
    /// Name of its schema; empty if it has none.
    schema: String,
    encoding: String,
}

/// The channels found so far, by their id.
#[derive(Debug, Default)]
pub(super) struct Channels {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
}

impl Channels {
    /// Adds the schema of a record. `None` if the record is truncated.
    pub(super) fn add_schema(&mut self, body: &[u8]) -> Option<()> {
        let mut fields = Fields(body);
        self.schemas.insert(fields.u16()?, fields.string()?.to_owned());
        Some(())
    }

    /// Adds the channel of a record. `None` if the record is truncated.
    pub(super) fn add(&mut self, body: &[u8]) -> Option<()> {
        let mut fields = Fields(body);
        let (id, schema, name, encoding) = (fields.u16()?, fields.u16()?, fields.string()?, fields.string()?);
        let schema = self.schemas.get(&schema).cloned().unwrap_or_default();
        let topic = Topic::of_channel(name, &schema, encoding);
        self.channels.insert(id, Channel { name: name.to_owned(), topic, schema, encoding: encoding.to_owned() });
        Some(())
    }

    pub(super) fn get(&self, id: u16) -> Option<&Channel> {
        self.channels.get(&id)
    }

    /// Whether the file has a channel with a schema of Fringeflow.
    pub(super) fn has_own(&self) -> bool {
        self.channels.values().any(|channel| channel.schema.starts_with("fringeflow."))
    }

    /// Describes each channel in a few words, in the order of their ids.
    pub(super) fn descriptions(&self) -> Vec<String> {
        let describe = |Channel { name, schema, encoding, .. }: &Channel| {
            let form: Vec<&str> =
                [schema, encoding].into_iter().map(String::as_str).filter(|s| !s.is_empty()).collect();
            if form.is_empty() { name.clone() } else { format!("{name} ({})", form.join(", ")) }
        };
        self.channels.values().map(describe).collect()
    }
}
