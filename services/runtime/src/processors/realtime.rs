//! Real-time priority: a thread that has it runs before all ordinary ones, whenever it has something to do.

// The call has no safe form.
#![allow(unsafe_code)]

use std::io;

/// Gives this thread, and those that it starts from now on, a real-time priority (`SCHED_FIFO`).
///
/// # Errors
/// The system does not grant it; why, and what to do.
pub(super) fn enter(priority: u8) -> Result<(), String> {
    let parameters = libc::sched_param { sched_priority: i32::from(priority) };
    // SAFETY: the call reads the parameters, which live until it returns, and touches nothing else; 0 is this thread.
    if unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) } == 0 {
        return Ok(());
    }
    let why = io::Error::last_os_error();
    Err(format!(
        "realtime_priority = {priority}: {why}; grant it by a line `USER - rtprio {priority}` in /etc/security/limits.conf \
         (`LimitRTPRIO={priority}` in a systemd unit), then log in again"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The policy of this thread: field 41 of its `stat` (proc_pid_stat(5)); 1 is `SCHED_FIFO`. Priority: field 40.
    fn policy_and_priority() -> (u32, u32) {
        let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_ascii_whitespace().collect();
        (fields[38].parse().unwrap(), fields[37].parse().unwrap())
    }

    #[test]
    fn a_thread_has_the_priority_or_is_told_how_to_get_it() {
        let (entered, found) = std::thread::spawn(|| (enter(7), policy_and_priority())).join().unwrap();
        match entered {
            Ok(()) => assert_eq!(found, (1, 7)),
            Err(why) => {
                assert!(why.contains("realtime_priority = 7") && why.contains("rtprio"), "{why}");
                assert_eq!(found.0, 0);
            }
        }
        assert_eq!(policy_and_priority().0, 0);
    }
}
