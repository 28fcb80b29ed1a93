//! The account of a stage: its counts, in a file that outlives the process.
//!
//! Every change is written before the item moves on. A service that is killed leaves its account as it stood; the one
//! started in its place continues it and counts what was in work as lost by the restart. So `taken = passed + Σ dropped +
//! in work` holds at every moment, whoever dies.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};

use fringeflow_message::{Counts, DropReason, Incident, Stage};

/// Version of the file, so that leftovers of another one are not misread.
const VERSION: u64 = 2;
/// Channels that a stage can take from.
pub const SOURCES: usize = 8;

/// What a stage takes: so many `items` of the stage `from` make one of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Source {
    /// The stage before.
    pub from: Stage,
    /// Its items in one of the stage.
    pub items: u64,
}

/// What a stage takes from the stages before, by the number of the source; nothing for those that begin the pipeline, and for
/// the recorder, which numbers its channels itself.
#[must_use]
pub fn sources(stage: Stage) -> &'static [Source] {
    const fn all_of(from: Stage) -> Source {
        Source { from, items: 1 }
    }
    match stage {
        Stage::Camera1 | Stage::Camera2 | Stage::Projector | Stage::Recorder => &[],
        Stage::Pattern => const { &[all_of(Stage::Projector)] },
        Stage::Pairing => const { &[all_of(Stage::Camera1), all_of(Stage::Camera2)] },
        Stage::Windowing => const { &[Source { from: Stage::Pairing, items: 2 }] },
        Stage::Phase => const { &[all_of(Stage::Windowing)] },
        Stage::Correspondence => const { &[all_of(Stage::Phase)] },
        Stage::Cloud => const { &[all_of(Stage::Correspondence)] },
        Stage::Tracking => const { &[all_of(Stage::Cloud)] },
    }
}

/// Messages that a stage has put into its channel, by its counts: those on clouds without a pose count as dropped, and are
/// told nevertheless.
#[must_use]
pub fn messages(stage: Stage, counts: &Counts) -> u64 {
    let told = if stage == Stage::Tracking { counts.dropped(DropReason::NotTracked) } else { 0 };
    counts.passed + told
}

/// What the file holds.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
struct Record {
    version: u64,
    counts: Counts,
    /// Per channel that the stage takes from: the number of the next message.
    next: [u64; SOURCES],
    /// Session and number of the item that was put out last.
    last: [u64; 2],
}

/// Counts of one stage, kept in a file.
#[derive(Debug)]
pub struct Account {
    stage: Stage,
    file: File,
    path: PathBuf,
    record: Record,
    arrivals: [Arrivals; SOURCES],
}

/// Which messages of a channel have come: they are numbered without gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Arrivals {
    /// Number of the next message.
    pub next: u64,
    /// Messages below this number were counted as lost before anyone listened.
    floor: u64,
}

impl Arrivals {
    /// Nothing has come; the next message has this number.
    #[must_use]
    pub fn beginning_at(next: u64) -> Self {
        Self { next, floor: 0 }
    }

    /// Begins to listen after `sent` messages; how many of them were missed.
    pub fn catch_up(&mut self, sent: u64) -> u64 {
        let missed = sent.saturating_sub(self.next);
        self.floor = sent;
        self.next += missed;
        missed
    }

    /// Takes message `number`; how many are missing before it. `None` for one that was counted as lost already, which must
    /// not be used. A lower number than expected is that of a publisher that began anew.
    pub fn arrive(&mut self, number: u64) -> Option<u64> {
        if number < self.floor {
            return None;
        }
        let missing = number.saturating_sub(self.next);
        *self = Self { next: number + 1, floor: 0 };
        Some(missing)
    }
}

/// An account that cannot be kept.
#[derive(Debug, thiserror::Error)]
#[error("{}: the account cannot be written: {source}; make room there, or set another folder by FRINGEFLOW_RUNTIME_DIR", path.display())]
pub struct AccountError {
    /// Its file.
    pub path: PathBuf,
    /// What the system said.
    #[source]
    pub source: io::Error,
}

impl Account {
    /// Opens the account of a stage in a folder; what was in work when its last keeper died is dropped.
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
        let arrivals = record.next.map(Arrivals::beginning_at);
        let mut account = Self { stage, file, path: path.clone(), record, arrivals };
        let in_work = account.counts().in_work().unwrap_or(0);
        account.drop_many(DropReason::Restart, in_work)?;
        Ok(account)
    }

    /// The counts of a stage as they stand; `None` where it keeps no account.
    #[must_use]
    pub fn read(folder: &Path, stage: Stage) -> Option<Counts> {
        read_record(&File::open(path(folder, stage)).ok()?).map(|record| record.counts)
    }

    /// Session and number of the item that a stage put out last; `None` where it keeps no account or has put out none.
    #[must_use]
    pub fn read_last(folder: &Path, stage: Stage) -> Option<[u64; 2]> {
        let record = read_record(&File::open(path(folder, stage)).ok()?)?;
        (record.counts.passed > 0).then_some(record.last)
    }

    /// The counts.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.record.counts
    }

    /// Which messages of a source have come.
    #[must_use]
    pub fn arrivals(&self, source: usize) -> &Arrivals {
        &self.arrivals[source]
    }

    /// Counts as lost what the stages before have put out and this one did not get; what of it still comes must not be used.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn catch_up(&mut self, folder: &Path, reason: DropReason) -> Result<(), AccountError> {
        for (number, source) in sources(self.stage).iter().enumerate() {
            let sent = Self::read(folder, source.from).map_or(0, |counts| counts.passed / source.items);
            self.catch_up_to(number, sent, reason)?;
        }
        Ok(())
    }

    /// Whether the stages before have put out something that has not come.
    #[must_use]
    pub fn is_behind(&self, folder: &Path) -> bool {
        let sent = |source: &Source| Self::read(folder, source.from).map_or(0, |counts| counts.passed / source.items);
        sources(self.stage).iter().zip(&self.arrivals).any(|(source, arrivals)| sent(source) > arrivals.next)
    }

    fn catch_up_to(&mut self, source: usize, sent: u64, reason: DropReason) -> Result<(), AccountError> {
        let missed = self.arrivals[source].catch_up(sent);
        self.record.counts.taken += missed;
        self.drop_many(reason, missed)
    }

    /// Takes message number `published` of a channel; what is missing before it was overwritten in the channel. `false`
    /// for a message that was counted as lost already, which must not be used.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn arrive(&mut self, source: usize, published: u64) -> Result<bool, AccountError> {
        self.arrive_after(source, published, DropReason::Overrun)
    }

    /// [`Self::arrive`] at a stage for which it is no loss if messages are overwritten, with the reason that it has for it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn arrive_after(&mut self, source: usize, published: u64, reason: DropReason) -> Result<bool, AccountError> {
        let Some(missing) = self.arrivals[source].arrive(published) else { return Ok(false) };
        self.record.counts.taken += missing + 1;
        self.record.counts.drop_many(reason, missing);
        self.write()?;
        Ok(true)
    }

    /// Counts items that no channel brought.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn take(&mut self, count: u64) -> Result<(), AccountError> {
        self.record.counts.taken += count;
        self.write()
    }

    /// [`Self::take`] and [`Self::pass`] of one item at once.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn take_and_pass(&mut self) -> Result<u64, AccountError> {
        self.record.counts.taken += 1;
        self.pass()
    }

    /// Counts one item as passed on, before it is; its number in the channel behind.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn pass(&mut self) -> Result<u64, AccountError> {
        let published = self.record.counts.passed;
        self.record.counts.passed += 1;
        self.write()?;
        Ok(published)
    }

    /// [`Self::pass`] of an item whose channel numbers by session: its session and number.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn pass_as(&mut self, session: u64, sequence: u64) -> Result<u64, AccountError> {
        self.record.last = [session, sequence];
        self.pass()
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

    /// Counts incidents of a kind.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn note(&mut self, incident: Incident, count: u64) -> Result<(), AccountError> {
        self.record.counts.note(incident, count);
        self.write()
    }

    /// Replaces the counts and the numbers of the next messages by those that something else keeps.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn balance(account: &Account) -> [u64; 4] {
        let counts = account.counts();
        [counts.taken, counts.passed, counts.all_dropped(), counts.in_work().unwrap()]
    }

    #[test]
    fn what_is_missing_in_the_channel_is_an_overrun() {
        let folder = tempfile::tempdir().unwrap();
        let mut account = Account::open(folder.path(), Stage::Phase).unwrap();
        assert!(account.arrive(0, 0).unwrap());
        assert_eq!(account.pass().unwrap(), 0);
        assert!(account.arrive(0, 4).unwrap());
        assert_eq!(balance(&account), [5, 1, 3, 1]);
        assert_eq!(account.counts().dropped(DropReason::Overrun), 3);
        assert_eq!(Account::read(folder.path(), Stage::Phase).unwrap(), *account.counts());
    }

    #[test]
    fn a_restart_continues_the_account_and_drops_what_was_in_work() {
        let folder = tempfile::tempdir().unwrap();
        let mut account = Account::open(folder.path(), Stage::Cloud).unwrap();
        account.arrive(0, 0).unwrap();
        account.pass().unwrap();
        account.arrive(0, 1).unwrap();
        drop(account);
        let mut account = Account::open(folder.path(), Stage::Cloud).unwrap();
        assert_eq!(balance(&account), [2, 1, 1, 0]);
        assert_eq!(account.counts().dropped(DropReason::Restart), 1);
        // Messages 2 to 4 were sent while nobody listened; 4 is still in the channel, but counted.
        account.catch_up_to(0, 5, DropReason::Restart).unwrap();
        assert!(!account.arrive(0, 4).unwrap());
        assert!(account.arrive(0, 5).unwrap());
        assert_eq!(account.counts().dropped(DropReason::Restart), 4);
        assert_eq!(account.pass().unwrap(), 1);
        assert_eq!(balance(&account), [6, 2, 4, 0]);
    }

    #[test]
    fn a_publisher_that_begins_anew_is_followed() {
        let folder = tempfile::tempdir().unwrap();
        let mut account = Account::open(folder.path(), Stage::Cloud).unwrap();
        account.arrive(0, 0).unwrap();
        account.arrive(0, 1).unwrap();
        assert!(account.arrive(0, 0).unwrap());
        assert_eq!(balance(&account), [3, 0, 0, 3]);
        assert_eq!(account.arrivals(0).next, 1);
    }

    #[test]
    fn a_cut_account_begins_anew() {
        let folder = tempfile::tempdir().unwrap();
        Account::open(folder.path(), Stage::Cloud).unwrap().take(3).unwrap();
        let file = path(folder.path(), Stage::Cloud);
        OpenOptions::new().write(true).open(&file).unwrap().set_len(20).unwrap();
        assert_eq!(balance(&Account::open(folder.path(), Stage::Cloud).unwrap()), [0; 4]);
    }
}
