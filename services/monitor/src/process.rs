//! CPU time, memory and page faults of a process, from `/proc`.

use std::fs;

/// A process on this machine.
#[derive(Debug)]
pub(crate) struct Process {
    pid: u32,
}

/// Resources that a process has used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Usage {
    /// CPU time of all threads, seconds.
    pub(crate) cpu_s: f64,
    /// Memory in RAM, including shared memory.
    pub(crate) memory_bytes: u64,
    /// Page faults on memory that was not mapped yet.
    pub(crate) minor_faults: u64,
    /// Page faults that waited for a disk.
    pub(crate) major_faults: u64,
}

impl Process {
    pub(crate) fn new(pid: u32) -> Self {
        Self { pid }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.pid
    }

    /// Reads the usage until now; returns `None` if the process has ended.
    pub(crate) fn usage(&mut self) -> Option<Usage> {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.pid)).ok()?;
        let Stat { state, minor_faults, major_faults, ticks } = Stat::parse(&stat)?;
        // A zombie has ended; its parent has not collected it yet.
        if state == 'Z' {
            return None;
        }
        let statm = fs::read_to_string(format!("/proc/{}/statm", self.pid)).ok()?;
        let pages: u64 = statm.split(' ').nth(1)?.parse().ok()?;
        Some(Usage {
            cpu_s: ticks as f64 / rustix::param::clock_ticks_per_second() as f64,
            memory_bytes: pages * rustix::param::page_size() as u64,
            minor_faults,
            major_faults,
        })
    }
}

/// Fields 3, 10 and 12 of `/proc/PID/stat` (proc_pid_stat(5)), and the sum of fields 14 and 15.
#[derive(Debug, PartialEq, Eq)]
struct Stat {
    state: char,
    minor_faults: u64,
    major_faults: u64,
    /// CPU time in user and kernel mode, clock ticks.
    ticks: u64,
}

impl Stat {
    /// Parses the text of the file. The name in parentheses may contain any character, so the fields are counted from
    /// the last parenthesis.
    fn parse(stat: &str) -> Option<Self> {
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_ascii_whitespace().collect();
        let number = |index: usize| fields.get(index)?.parse::<u64>().ok();
        Some(Self {
            state: fields.first()?.chars().next()?,
            minor_faults: number(7)?,
            major_faults: number(9)?,
            ticks: number(11)? + number(12)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usage_of_this_process_and_of_a_missing_one() {
        let usage = Process::new(std::process::id()).usage().unwrap();
        assert!(usage.memory_bytes > 100_000 && usage.cpu_s >= 0.0 && usage.minor_faults > 0);
        assert_eq!(Process::new(1 << 23).usage(), None);
    }

    #[test]
    fn process_names_with_parentheses_and_spaces_do_not_shift_the_fields() {
        let stat = "12 (a) S 1 (b) R 1 2 3 4 5 6 7 8 9 10 100 23 14 15 16";
        assert_eq!(Stat::parse(stat), Some(Stat { state: 'R', minor_faults: 7, major_faults: 9, ticks: 123 }));
        assert_eq!(Stat::parse("12 (cut"), None);
    }
}
