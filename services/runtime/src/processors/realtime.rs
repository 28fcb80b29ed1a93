//! Real-time priority: a thread that has it runs before all ordinary threads, whenever it has work.

// The system call has no safe wrapper.
#![allow(unsafe_code)]

use std::io;

/// Gives this thread, and the threads that it starts later, a real-time priority (`SCHED_FIFO`).
///
/// # Errors
/// The system refuses; the text states the reason and the remedy.
pub(super) fn set_priority(priority: u8) -> Result<(), String> {
    let parameters = libc::sched_param { sched_priority: i32::from(priority) };
    // SAFETY: the call reads the parameters, which live until it returns, and touches nothing else; 0 is this thread.
    if unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) } == 0 {
        return Ok(());
    }
    let error = io::Error::last_os_error();
    Err(format!(
        "realtime_priority = {priority}: {error}; grant it with the line `USER - rtprio {priority}` in \
         /etc/security/limits.conf (`LimitRTPRIO={priority}` in a systemd unit), then log in again"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads policy and priority of this thread from its `stat`, see proc_pid_stat(5): fields 41 (1 is `SCHED_FIFO`)
    /// and 40.
    fn policy_and_priority() -> (u32, u32) {
        let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_ascii_whitespace().collect();
        (fields[38].parse().unwrap(), fields[37].parse().unwrap())
    }

    #[test]
    fn the_priority_is_set_or_the_error_names_the_remedy() {
        let (result, found) = std::thread::spawn(|| (set_priority(7), policy_and_priority())).join().unwrap();
        match result {
            Ok(()) => assert_eq!(found, (1, 7)),
            Err(why) => {
                assert!(why.contains("realtime_priority = 7") && why.contains("rtprio"), "{why}");
                assert_eq!(found.0, 0);
            }
        }
        assert_eq!(policy_and_priority().0, 0);
    }
}
