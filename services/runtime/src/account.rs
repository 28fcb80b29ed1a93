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
use fringeflow::message::{Counts, DropReason, Stage};

/// Folder of the accounts in the root of an instance.
const FOLDER: &str = "accounts";
/// Version of the file, so that leftovers of another one are not misread.
const VERSION: u64 = 1;
/// Channels that a stage can take from.
pub const SOURCES: usize = 8;

/// What the file holds.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
struct Record {
    version: u64,
    counts: Counts,
    /// Per channel that the stage takes from: the number of the next message.
    next: [u64; SOURCES],
}

/// Counts of one stage, kept in a file.
#[derive(Debug)]
pub struct Account {
    file: File,
    path: PathBuf,
    record: Record,
    /// Messages below these numbers were counted as lost before this process listened.
    floor: [u64; SOURCES],
}

/// An account that cannot be kept.
#[derive(Debug, thiserror::Error)]
#[error("{}: the account cannot be kept: {source}; make room in this folder, or name another by FRINGEFLOW_RUNTIME_DIR", path.display())]
pub struct AccountError {
    /// Its file.
    pub path: PathBuf,
    /// What the system said.
    #[source]
    pub source: io::Error,
}

impl Account {
    /// Opens the account of a stage in the root of an instance; what was in work when its last keeper died is dropped.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub fn open(root: &Path, stage: Stage) -> Result<Self, AccountError> {
        let path = path(root, stage);
        let fail = |source| AccountError { path: path.clone(), source };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(fail)?;
        }
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false).mode(0o600);
        let file = options.open(&path).map_err(fail)?;
        let record = read_record(&file).unwrap_or(Record { version: VERSION, ..Record::zeroed() });
        let mut account = Self { file, path: path.clone(), record, floor: [0; SOURCES] };
        let in_work = account.counts().in_work().unwrap_or(0);
        account.drop_many(DropReason::Restart, in_work)?;
        Ok(account)
    }

    /// The counts of a stage as they stand; `None` where it keeps no account.
    #[must_use]
    pub fn read(root: &Path, stage: Stage) -> Option<Counts> {
        read_record(&File::open(path(root, stage)).ok()?).map(|record| record.counts)
    }

    /// The counts.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.record.counts
    }

    /// The number of the next message of a channel.
    #[must_use]
    pub fn next(&self, source: usize) -> u64 {
        self.record.next[source]
    }

    /// Counts everything that a channel's publisher had sent before this process listened: `sent` messages in all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn catch_up(&mut self, source: usize, sent: u64, reason: DropReason) -> Result<(), AccountError> {
        let missed = sent.saturating_sub(self.record.next[source]);
        self.floor[source] = sent;
        self.record.next[source] += missed;
        self.record.counts.taken += missed;
        self.drop_many(reason, missed)
    }

    /// Takes message number `published` of a channel; what is missing before it was overwritten in the channel. `false`
    /// for a message that was counted as lost already, which must not be used.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn arrive(&mut self, source: usize, published: u64) -> Result<bool, AccountError> {
        if published < self.floor[source] {
            return Ok(false);
        }
        self.floor[source] = 0;
        // A lower number than expected is that of a publisher that began anew.
        let missing = published.saturating_sub(self.record.next[source]);
        self.record.next[source] = published + 1;
        self.record.counts.taken += missing + 1;
        self.record.counts.drop_many(DropReason::Overrun, missing);
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

    /// Replaces the counts and the numbers of the next messages by those that something else keeps.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn set(&mut self, counts: &Counts, next: &[u64]) -> Result<(), AccountError> {
        self.record.counts = *counts;
        self.record.next[..next.len()].copy_from_slice(next);
        self.write()
    }

    fn write(&mut self) -> Result<(), AccountError> {
        let written = self.file.write_all_at(bytemuck::bytes_of(&self.record), 0);
        written.map_err(|source| AccountError { path: self.path.clone(), source })
    }
}

fn path(root: &Path, stage: Stage) -> PathBuf {
    root.join(FOLDER).join(stage.name())
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
        let root = tempfile::tempdir().unwrap();
        let mut account = Account::open(root.path(), Stage::Phase).unwrap();
        assert!(account.arrive(0, 0).unwrap());
        assert_eq!(account.pass().unwrap(), 0);
        assert!(account.arrive(0, 4).unwrap());
        assert_eq!(balance(&account), [5, 1, 3, 1]);
        assert_eq!(account.counts().dropped(DropReason::Overrun), 3);
        assert_eq!(Account::read(root.path(), Stage::Phase).unwrap(), *account.counts());
    }

    #[test]
    fn a_restart_continues_the_account_and_drops_what_was_in_work() {
        let root = tempfile::tempdir().unwrap();
        let mut account = Account::open(root.path(), Stage::Cloud).unwrap();
        account.arrive(0, 0).unwrap();
        account.pass().unwrap();
        account.arrive(0, 1).unwrap();
        drop(account);
        let mut account = Account::open(root.path(), Stage::Cloud).unwrap();
        assert_eq!(balance(&account), [2, 1, 1, 0]);
        assert_eq!(account.counts().dropped(DropReason::Restart), 1);
        // Messages 2 to 4 were sent while nobody listened; 4 is still in the channel, but counted.
        account.catch_up(0, 5, DropReason::Restart).unwrap();
        assert!(!account.arrive(0, 4).unwrap());
        assert!(account.arrive(0, 5).unwrap());
        assert_eq!(account.counts().dropped(DropReason::Restart), 4);
        assert_eq!(account.pass().unwrap(), 1);
        assert_eq!(balance(&account), [6, 2, 4, 0]);
    }

    #[test]
    fn a_publisher_that_begins_anew_is_followed() {
        let root = tempfile::tempdir().unwrap();
        let mut account = Account::open(root.path(), Stage::Cloud).unwrap();
        account.arrive(0, 0).unwrap();
        account.arrive(0, 1).unwrap();
        assert!(account.arrive(0, 0).unwrap());
        assert_eq!(balance(&account), [3, 0, 0, 3]);
        assert_eq!(account.next(0), 1);
    }

    #[test]
    fn a_cut_account_begins_anew() {
        let root = tempfile::tempdir().unwrap();
        Account::open(root.path(), Stage::Cloud).unwrap().take(3).unwrap();
        let file = path(root.path(), Stage::Cloud);
        OpenOptions::new().write(true).open(&file).unwrap().set_len(20).unwrap();
        assert_eq!(balance(&Account::open(root.path(), Stage::Cloud).unwrap()), [0; 4]);
    }
}
