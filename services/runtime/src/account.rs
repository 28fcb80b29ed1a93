//! Counts of a stage, in a file that outlives the process.
//!
//! Each change is written before the item moves on. If a service is killed, its successor continues the account and
//! counts the items in work as dropped by the restart. So `taken = passed + Σ dropped + in work` holds at any time.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};

use fringeflow_message::{Counts, DropReason, Incident, Stage};
use fringeflow_transport::Instance;

/// Version of the file layout. Files of other versions are ignored.
const VERSION: u64 = 3;
/// Maximum number of input channels of a stage.
const MAX_SOURCES: usize = 8;

/// An input of a stage: `items` items of the stage `from` make one item of this stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Source {
    /// The stage that sends the items.
    pub from: Stage,
    /// Number of its items in one item of the receiving stage.
    pub items: u64,
}

/// Returns the inputs of a stage; the index is the number of the source. The first stages of the pipeline have none.
/// The recorder has none either, because it numbers its channels itself.
#[must_use]
pub fn sources(stage: Stage) -> &'static [Source] {
    const fn one_to_one(from: Stage) -> Source {
        Source { from, items: 1 }
    }
    match stage {
        Stage::Camera1 | Stage::Camera2 | Stage::Projector | Stage::Recorder => &[],
        Stage::Pattern => const { &[one_to_one(Stage::Projector)] },
        Stage::Pairing => const { &[one_to_one(Stage::Camera1), one_to_one(Stage::Camera2)] },
        Stage::Windowing => const { &[Source { from: Stage::Pairing, items: 2 }] },
        Stage::Phase => const { &[one_to_one(Stage::Windowing)] },
        Stage::Correspondence => const { &[one_to_one(Stage::Phase)] },
        Stage::Cloud => const { &[one_to_one(Stage::Correspondence)] },
        Stage::Tracking => const { &[one_to_one(Stage::Cloud)] },
    }
}

/// Returns the number of messages that a stage has sent, from its counts. The tracking reports clouds without a pose
/// too, which count as dropped.
#[must_use]
pub fn sent_messages(stage: Stage, counts: &Counts) -> u64 {
    let without_pose = if stage == Stage::Tracking { counts.dropped(DropReason::NotTracked) } else { 0 };
    counts.passed + without_pose
}

/// Content of the file.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
struct Record {
    version: u64,
    counts: Counts,
    /// Number of the next message, by source.
    next: [u64; MAX_SOURCES],
    /// Session and number of the last item passed on, if its channel numbers by session.
    last: [u64; 2],
}

/// Counts of one stage, kept in a file.
#[derive(Debug)]
pub struct Account {
    stage: Stage,
    file: File,
    path: PathBuf,
    record: Record,
    arrivals: [Arrivals; MAX_SOURCES],
}

/// Finds the missing messages of a channel, whose messages are numbered without gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Arrivals {
    /// Number of the next message.
    pub next: u64,
    /// Messages below this number were counted as lost before this process listened.
    floor: u64,
}

impl Arrivals {
    /// Expects message `next` first.
    #[must_use]
    pub fn new(next: u64) -> Self {
        Self { next, floor: 0 }
    }

    /// Skips the first `sent` messages of the channel, and returns how many of them have not arrived.
    pub fn catch_up(&mut self, sent: u64) -> u64 {
        let missed = sent.saturating_sub(self.next);
        self.floor = sent;
        self.next += missed;
        missed
    }

    /// Takes message `number`, and returns how many messages are missing before it. Returns `None` if the message was
    /// already counted as lost; it must not be used. A lower number than expected comes from a restarted publisher.
    pub fn arrive(&mut self, number: u64) -> Option<u64> {
        if number < self.floor {
            return None;
        }
        let missing = number.saturating_sub(self.next);
        *self = Self { next: number + 1, floor: 0 };
        Some(missing)
    }
}

/// An account cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: the account cannot be written: {source}; free space there, or set another folder with FRINGEFLOW_RUNTIME_DIR",
    path.display()
)]
pub struct AccountError {
    /// Its file.
    pub path: PathBuf,
    /// The system error.
    #[source]
    pub source: io::Error,
}

impl Account {
    /// Opens the account of a stage in a folder. Items that the previous process left in work are counted as dropped.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub fn open(folder: &Path, stage: Stage) -> Result<Self, AccountError> {
        let path = path(folder, stage);
        let fail = |source| AccountError { path: path.clone(), source };
        fs::create_dir_all(folder).map_err(fail)?;
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false).mode(0o600);
        let file = options.open(&path).map_err(fail)?;
        let record = read_record(&file).unwrap_or(Record { version: VERSION, ..Record::zeroed() });
        let arrivals = record.next.map(Arrivals::new);
        let mut account = Self { stage, file, path: path.clone(), record, arrivals };
        let in_work = account.counts().in_work().unwrap_or(0);
        account.drop_many(DropReason::Restart, in_work)?;
        Ok(account)
    }

    /// Reads the present counts of a stage. Returns `None` if the stage has no account.
    #[must_use]
    pub fn read_counts(folder: &Path, stage: Stage) -> Option<Counts> {
        read_record(&File::open(path(folder, stage)).ok()?).map(|record| record.counts)
    }

    /// Reads session and number of the last item that a stage passed on. Returns `None` if the stage has no account or
    /// has passed nothing on.
    #[must_use]
    pub fn read_last_item(folder: &Path, stage: Stage) -> Option<[u64; 2]> {
        let record = read_record(&File::open(path(folder, stage)).ok()?)?;
        (record.counts.passed > 0).then_some(record.last)
    }

    /// Returns the counts.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.record.counts
    }

    /// Returns the arrivals from a source.
    #[must_use]
    pub fn arrivals(&self, source: usize) -> &Arrivals {
        &self.arrivals[source]
    }

    /// Counts all items as lost that the stages before have sent and this stage has not received. Those that still
    /// arrive must not be used.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn catch_up(&mut self, folder: &Path, reason: DropReason) -> Result<(), AccountError> {
        for (number, source) in sources(self.stage).iter().enumerate() {
            let sent = Self::read_counts(folder, source.from).map_or(0, |counts| counts.passed / source.items);
            self.catch_up_to(number, sent, reason)?;
        }
        Ok(())
    }

    /// Returns whether the stages before have sent items that have not arrived.
    #[must_use]
    pub fn is_behind(&self, folder: &Path) -> bool {
        let sent =
            |source: &Source| Self::read_counts(folder, source.from).map_or(0, |counts| counts.passed / source.items);
        sources(self.stage).iter().zip(&self.arrivals).any(|(source, arrivals)| sent(source) > arrivals.next)
    }

    fn catch_up_to(&mut self, source: usize, sent: u64, reason: DropReason) -> Result<(), AccountError> {
        let missed = self.arrivals[source].catch_up(sent);
        self.record.counts.taken += missed;
        self.drop_many(reason, missed)
    }

    /// Counts the arrival of message `published`. Messages missing before it were overwritten in the channel. Returns
    /// `false` if the message was already counted as lost; it must not be used.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn count_arrival(&mut self, source: usize, published: u64) -> Result<bool, AccountError> {
        self.count_arrival_with(source, published, DropReason::Overrun)
    }

    /// Counts an arrival as [`Self::count_arrival`] does, but missing messages with `reason`. For stages that may skip
    /// messages.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn count_arrival_with(
        &mut self,
        source: usize,
        published: u64,
        reason: DropReason,
    ) -> Result<bool, AccountError> {
        let Some(missing) = self.arrivals[source].arrive(published) else { return Ok(false) };
        self.record.counts.taken += missing + 1;
        self.record.counts.drop_many(reason, missing);
        self.write()?;
        Ok(true)
    }

    /// Counts items as taken that did not come through a channel.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn count_taken(&mut self, count: u64) -> Result<(), AccountError> {
        self.record.counts.taken += count;
        self.write()
    }

    /// Counts one item as taken and passed on, in a single write. Returns its number in the output channel.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn count_taken_and_passed(&mut self) -> Result<u64, AccountError> {
        self.record.counts.taken += 1;
        self.count_passed()
    }

    /// Counts one item as passed on; called before it is sent. Returns its number in the output channel.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn count_passed(&mut self) -> Result<u64, AccountError> {
        let published = self.record.counts.passed;
        self.record.counts.passed += 1;
        self.write()?;
        Ok(published)
    }

    /// Counts an item as [`Self::count_passed`] does, and stores its session and number. For channels that number by
    /// session.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn count_passed_item(&mut self, session: u64, sequence: u64) -> Result<u64, AccountError> {
        self.record.last = [session, sequence];
        self.count_passed()
    }

    /// Counts one item as dropped.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn drop_one(&mut self, reason: DropReason) -> Result<(), AccountError> {
        self.drop_many(reason, 1)
    }

    /// Counts items as dropped.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn drop_many(&mut self, reason: DropReason, count: u64) -> Result<(), AccountError> {
        self.record.counts.drop_many(reason, count);
        self.write()
    }

    /// Counts incidents of one kind.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn note(&mut self, incident: Incident, count: u64) -> Result<(), AccountError> {
        self.record.counts.note(incident, count);
        self.write()
    }

    /// Replaces the counts and the numbers of the next messages, by source. For stages whose counts another component
    /// keeps.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn set(&mut self, counts: &Counts, next: &[u64]) -> Result<(), AccountError> {
        self.record.counts = *counts;
        for (arrivals, &next) in self.arrivals.iter_mut().zip(next) {
            arrivals.next = next;
        }
        self.write()
    }

    fn write(&mut self) -> Result<(), AccountError> {
        self.record.next = self.arrivals.map(|arrivals| arrivals.next);
        let written = self.file.write_all_at(bytemuck::bytes_of(&self.record), 0);
        written.map_err(|source| AccountError { path: self.path.clone(), source })
    }
}

fn path(folder: &Path, stage: Stage) -> PathBuf {
    folder.join(stage.name())
}

fn read_record(file: &File) -> Option<Record> {
    let mut record = Record::zeroed();
    file.read_exact_at(bytemuck::bytes_of_mut(&mut record), 0).ok()?;
    (record.version == VERSION).then_some(record)
}

/// Returns the folder of the accounts of an instance. It lies beside the folder of the channels, so it stays if that
/// folder is removed.
#[must_use]
pub fn accounts_folder(instance: &Instance) -> PathBuf {
    instance.runtime_dir().join(format!("{}.accounts", instance.name()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn balance(account: &Account) -> [u64; 4] {
        let counts = account.counts();
        [counts.taken, counts.passed, counts.all_dropped(), counts.in_work().unwrap()]
    }

    #[test]
    fn a_gap_in_the_numbers_counts_as_overrun() {
        let folder = tempfile::tempdir().unwrap();
        let mut account = Account::open(folder.path(), Stage::Phase).unwrap();
        assert!(account.count_arrival(0, 0).unwrap());
        assert_eq!(account.count_passed().unwrap(), 0);
        assert!(account.count_arrival(0, 4).unwrap());
        assert_eq!(balance(&account), [5, 1, 3, 1]);
        assert_eq!(account.counts().dropped(DropReason::Overrun), 3);
        assert_eq!(Account::read_counts(folder.path(), Stage::Phase).unwrap(), *account.counts());
    }

    #[test]
    fn a_restart_continues_the_account_and_drops_items_in_work() {
        let folder = tempfile::tempdir().unwrap();
        let mut account = Account::open(folder.path(), Stage::Cloud).unwrap();
        account.count_arrival(0, 0).unwrap();
        account.count_passed().unwrap();
        account.count_arrival(0, 1).unwrap();
        drop(account);
        let mut account = Account::open(folder.path(), Stage::Cloud).unwrap();
        assert_eq!(balance(&account), [2, 1, 1, 0]);
        assert_eq!(account.counts().dropped(DropReason::Restart), 1);
        // Messages 2 to 4 were sent while the service was down. Message 4 is still in the channel, but already counted.
        account.catch_up_to(0, 5, DropReason::Restart).unwrap();
        assert!(!account.count_arrival(0, 4).unwrap());
        assert!(account.count_arrival(0, 5).unwrap());
        assert_eq!(account.counts().dropped(DropReason::Restart), 4);
        assert_eq!(account.count_passed().unwrap(), 1);
        assert_eq!(balance(&account), [6, 2, 4, 0]);
    }

    #[test]
    fn the_numbers_of_a_restarted_publisher_are_followed() {
        let folder = tempfile::tempdir().unwrap();
        let mut account = Account::open(folder.path(), Stage::Cloud).unwrap();
        account.count_arrival(0, 0).unwrap();
        account.count_arrival(0, 1).unwrap();
        assert!(account.count_arrival(0, 0).unwrap());
        assert_eq!(balance(&account), [3, 0, 0, 3]);
        assert_eq!(account.arrivals(0).next, 1);
    }

    #[test]
    fn a_truncated_account_starts_at_zero() {
        let folder = tempfile::tempdir().unwrap();
        Account::open(folder.path(), Stage::Cloud).unwrap().count_taken(3).unwrap();
        let file = path(folder.path(), Stage::Cloud);
        OpenOptions::new().write(true).open(&file).unwrap().set_len(20).unwrap();
        assert_eq!(balance(&Account::open(folder.path(), Stage::Cloud).unwrap()), [0; 4]);
    }
}
