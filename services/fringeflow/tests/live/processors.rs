//! What services are given of the machine: they have it, those that are started again too, and `status` tells it.

use std::fs;

use rustix::process::Signal;
use rustix::thread::sched_getaffinity;

use crate::support::{Bench, Live, NAME};

/// What the system tells of a process in its `status`, by the name of the field.
fn told(pid: u32, field: &str) -> String {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
    status.lines().find_map(|line| line.strip_prefix(field)?.strip_prefix(':')).unwrap().trim().to_owned()
}

/// Scheduling policy of a process, 1 if it is a real-time task (proc_pid_stat(5), field 41).
fn policy(pid: u32) -> String {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
    stat.rsplit_once(')').unwrap().1.split_ascii_whitespace().nth(38).unwrap().to_owned()
}

fn threads_of(pid: u32) -> Vec<String> {
    let tasks = fs::read_dir(format!("/proc/{pid}/task")).unwrap().flatten();
    tasks.map(|task| task.file_name().to_string_lossy().into_owned()).collect()
}

#[test]
fn services_have_what_they_are_given() {
    let usable = sched_getaffinity(None).unwrap();
    let cpu = (0..1024).rfind(|&cpu| usable.is_set(cpu)).unwrap().to_string();
    let given = format!(
        "[processors.phase]\ncpus = [{cpu}]\nthreads = 3\n[processors.cloud]\nrealtime_priority = 5\nlock_memory = \"used\"\n[window]"
    );
    let bench = Bench::with(&[("[window]", &given)]);
    let live = bench.start(&[]);
    live.wait_for_clouds(3);
    let check = |live: &Live<'_>| {
        let phase = bench.pid_of("phase").unwrap();
        for thread in threads_of(phase) {
            let status = fs::read_to_string(format!("/proc/{phase}/task/{thread}/status")).unwrap();
            assert!(status.contains(&format!("Cpus_allowed_list:\t{cpu}\n")), "{status}");
        }
        // Those of nobody else are limited.
        assert_eq!(
            told(bench.pid_of("correspondence").unwrap(), "Cpus_allowed_list"),
            told(live.pid(), "Cpus_allowed_list")
        );
        let status = bench.json(&[0], &[&"status", &NAME, &"--json"]);
        let standing = &status["processors"];
        assert_eq!(standing["phase"]["granted"], serde_json::json!([format!("CPUs {cpu}"), "3 threads"]));
        assert!(standing["correspondence"].is_null(), "{standing}");
        // The system grants the others what it likes; either they have it, or the remedy is told.
        let of_cloud = |kind: &str| standing["cloud"][kind].to_string();
        let cloud = bench.pid_of("cloud").unwrap();
        match policy(cloud).as_str() {
            "1" => assert!(of_cloud("granted").contains("real-time priority 5"), "{standing}"),
            _ => assert!(of_cloud("refused").contains("rtprio 5"), "{standing}"),
        }
        match told(cloud, "VmLck").as_str() {
            "0 kB" => assert!(of_cloud("refused").contains("memlock unlimited"), "{standing}"),
            _ => assert!(of_cloud("granted").contains("used memory locked"), "{standing}"),
        }
    };
    check(&live);
    let killed = live.signal("phase", Signal::KILL);
    live.wait_until("it is started again", || bench.pid_of("phase").is_some_and(|pid| pid != killed));
    live.wait_for_clouds(3);
    check(&live);
    live.quit();
    bench.assert_nothing_left();
}
