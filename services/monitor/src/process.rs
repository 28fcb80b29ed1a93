//! What a process uses, from `/proc`.

use std::fs;

/// A process of this machine.
#[derive(Debug)]
pub(crate) struct Process {
    pid: u32,
}

/// What it has used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Usage {
    /// CPU time of all its threads, seconds.
    pub(crate) cpu_s: f64,
    /// Memory that is in RAM; what it shares with others counts too.
    pub(crate) memory_bytes: u64,
    /// Times that it touched memory which was not mapped yet.
    pub(crate) minor_faults: u64,
    /// Times that it waited for memory from a disk.
    pub(crate) major_faults: u64,
}

impl Process {
    pub(crate) fn new(pid: u32) -> Self {
        Self { pid }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.pid
    }

    /// What it has used until now; `None` where it is gone.
    pub(crate) fn usage(&mut self) -> Option<Usage> {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.pid)).ok()?;
        let Stat { state, minor_faults, major_faults, ticks } = Stat::parse(&stat)?;
        // A zombie waits to be noticed.
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

/// What is needed of `stat` (proc_pid_stat(5)): fields 3, 10, 12, and 14 and 15 together.
#[derive(Debug, PartialEq, Eq)]
struct Stat {
    state: char,
    minor_faults: u64,
    major_faults: u64,
    /// CPU time.
    ticks: u64,
}

impl Stat {
    /// The name before the fields, in parentheses, may hold anything.
    fn parse(stat: &str) -> Option<Self> {
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_ascii_whitespace().collect();
        let number = |place: usize| fields.get(place)?.parse::<u64>().ok();
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
    fn this_process_uses_memory_and_time() {
        let usage = Process::new(std::process::id()).usage().unwrap();
        assert!(usage.memory_bytes > 100_000 && usage.cpu_s >= 0.0 && usage.minor_faults > 0);
        assert_eq!(Process::new(1 << 23).usage(), None);
    }

    #[test]
    fn names_with_parentheses_and_spaces_do_not_shift_the_fields() {
        let stat = "12 (a) S 1 (b) R 1 2 3 4 5 6 7 8 9 10 100 23 14 15 16";
        assert_eq!(Stat::parse(stat), Some(Stat { state: 'R', minor_faults: 7, major_faults: 9, ticks: 123 }));
        assert_eq!(Stat::parse("12 (cut"), None);
    }
}
