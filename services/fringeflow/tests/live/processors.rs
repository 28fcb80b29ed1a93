//! CPUs, threads, priority and locked memory per service: services have them, also after a restart, and `status` shows
//! them.

use std::fs;

use rustix::process::Signal;
use rustix::thread::sched_getaffinity;

use crate::support::{Bench, Live, NAME};

/// Returns a field of `/proc/PID/status`.
fn status_field(pid: u32, field: &str) -> String {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
    status.lines().find_map(|line| line.strip_prefix(field)?.strip_prefix(':')).unwrap().trim().to_owned()
}

/// Returns the scheduling policy of a process: 1 for a real-time task (proc_pid_stat(5), field 41).
fn scheduling_policy(pid: u32) -> String {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    stat.rsplit_once(')').unwrap().1.split_ascii_whitespace().nth(38).unwrap().to_owned()
}

fn threads_of(pid: u32) -> Vec<String> {
    let tasks = fs::read_dir(format!("/proc/{pid}/task")).unwrap().flatten();
    tasks.map(|task| task.file_name().to_string_lossy().into_owned()).collect()
}

#[test]
fn services_have_the_configured_cpus_threads_priority_and_memory_also_after_a_restart() {
    let usable = sched_getaffinity(None).unwrap();
    let cpu = (0..1024).rfind(|&cpu| usable.is_set(cpu)).unwrap().to_string();
    let settings = format!(
        "[processors.phase]\ncpus = [{cpu}]\nthreads = 3\n[processors.correspondence]\nthreads = 9\n[processors.cloud]\nrealtime_priority = 5\nlock_memory = \"used\"\n[window]"
    );
    let bench = Bench::with_changes(&[("[window]", &settings)]);
    let live = bench.start(&[]);
    live.wait_for_clouds(3);
    let check = |live: &Live<'_>| {
        let phase = bench.pid_of("phase").unwrap();
        for thread in threads_of(phase) {
            let status = fs::read_to_string(format!("/proc/{phase}/task/{thread}/status")).unwrap();
            assert!(status.contains(&format!("Cpus_allowed_list:\t{cpu}\n")), "{status}");
        }
        // It may search two windows at once, each with all of its threads.
        let correspondence = bench.pid_of("correspondence").unwrap();
        let name = |thread: &String| fs::read_to_string(format!("/proc/{correspondence}/task/{thread}/comm"));
        let is_search = |thread: &String| name(thread).is_ok_and(|name| name == "search\n");
        assert_eq!(threads_of(correspondence).iter().filter(|thread| is_search(thread)).count(), 2 * 9);
        // The CPUs of other services are not limited.
        assert_eq!(
            status_field(bench.pid_of("correspondence").unwrap(), "Cpus_allowed_list"),
            status_field(live.pid(), "Cpus_allowed_list")
        );
        let status = bench.json(&[0], &[&"status", &NAME, &"--json"]);
        let processors = &status["processors"];
        assert_eq!(processors["phase"]["granted"], serde_json::json!([format!("CPUs {cpu}"), "3 threads"]));
        assert_eq!(processors["correspondence"]["granted"], serde_json::json!(["9 threads"]));
        assert!(processors["tracking"].is_null(), "{processors}");
        // The system may refuse priority and memory. Then the status says what to change.
        let cloud_status = |kind: &str| processors["cloud"][kind].to_string();
        let cloud = bench.pid_of("cloud").unwrap();
        match scheduling_policy(cloud).as_str() {
            "1" => assert!(cloud_status("granted").contains("real-time priority 5"), "{processors}"),
            _ => assert!(cloud_status("refused").contains("rtprio 5"), "{processors}"),
        }
        match status_field(cloud, "VmLck").as_str() {
            "0 kB" => assert!(cloud_status("refused").contains("memlock unlimited"), "{processors}"),
            _ => assert!(cloud_status("granted").contains("used memory locked"), "{processors}"),
        }
    };
    check(&live);
    let killed = live.signal("phase", Signal::KILL);
    live.wait_until("the service is restarted", || bench.pid_of("phase").is_some_and(|pid| pid != killed));
    live.wait_for_clouds(3);
    check(&live);
    live.quit();
    bench.assert_nothing_left();
}
