//! The virtual machine. In: the name of the guest's tests. Out: success, or a panic with their output.
//!
//! QEMU ends with 0 even if the kernel panics. So the guest writes a result file last, and a missing one is a failure.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Time for boot and tests, seconds. They need about two minutes, on a busy host four.
const LIMIT_S: u64 = 600;
/// Exit code of `timeout` after the limit.
const TIMED_OUT: i32 = 124;
/// Folder of the share in the guest.
pub(crate) const SHARE: &str = "/tmp/share";

/// Boots the machine and runs these tests in it. `prepare` fills the folder that host and guest share.
///
/// # Panics
/// The tests fail or do not end. The message has their output and the path of the console log.
pub(crate) fn run(tests: &str, prepare: impl FnOnce(&Path)) {
    run_longer(tests, 0, prepare);
}

/// [`run`], for tests that need `extra_s` seconds more.
pub(crate) fn run_longer(tests: &str, extra_s: u64, prepare: impl FnOnce(&Path)) {
    let folder = scratch().join(format!("v4l2-{}", tests.replace("::", "-")));
    // Other runs of the same tests wait.
    let lock = File::create(folder.with_extension("lock")).unwrap();
    lock.lock().unwrap();
    // An earlier failure may have left it.
    let _ = fs::remove_dir_all(&folder);
    let share = folder.join("share");
    fs::create_dir_all(&share).unwrap();
    copy_program(&std::env::current_exe().unwrap(), &share.join("tests"));
    copy_program(program(), &share.join("fringeflow"));
    fs::write(share.join("program"), program().as_os_str().as_encoded_bytes()).unwrap();
    prepare(&share);
    let limit_s = LIMIT_S + extra_s;
    let code = boot(&assets(), &folder, tests, limit_s);
    let log = fs::read(share.join("tests.log")).unwrap_or_default();
    let log = String::from_utf8_lossy(&log);
    let result = fs::read_to_string(share.join("result")).ok();
    if let Err(problem) = check_result(code, limit_s, result.as_deref(), &log) {
        let console = folder.join("console.log");
        panic!("{tests}: {problem}; the console log is {}; output of the tests:\n{log}", console.display());
    }
    eprintln!("{log}");
    fs::remove_dir_all(&folder).unwrap();
}

/// Checks the result of the guest's tests.
fn check_result(code: Option<i32>, limit_s: u64, result: Option<&str>, log: &str) -> Result<(), String> {
    match result.map(str::trim) {
        _ if code == Some(TIMED_OUT) => Err(format!("the machine did not end within {limit_s} s")),
        None => Err(format!("the machine ended ({code:?}) without a result")),
        // With the name of a removed module, no test would run, successfully.
        Some("0") if log.contains("\nrunning 0 tests\n") => Err("no tests have this name".to_owned()),
        Some("0") => Ok(()),
        Some(result) => Err(format!("the tests ended with {result}")),
    }
}

fn boot(assets: &Path, folder: &Path, tests: &str, limit_s: u64) -> Option<i32> {
    let file = |name: &str| format!("file:{}", folder.join(name).display());
    let mount = |path: &Path, tag: &str, more: &str| {
        // QEMU expects a doubled comma in a value.
        let path = path.display().to_string().replace(',', ",,");
        format!("local,path={path},mount_tag={tag},security_model=none{more}")
    };
    // Emulate: hardware virtualization is not always available, and does not always boot this kernel.
    let mut qemu = Command::new("timeout");
    qemu.args(["--kill-after=5", &limit_s.to_string()]);
    qemu.args(["qemu-system-x86_64", "-machine", "q35", "-accel", "tcg,thread=multi"]);
    qemu.args(["-cpu", "max", "-smp", "2", "-m", "2048", "-nodefaults", "-no-reboot", "-display", "none"]);
    qemu.arg("-serial").arg(file("console.log"));
    qemu.arg("-kernel").arg(assets.join("kernel")).arg("-initrd").arg(assets.join("initramfs"));
    // Use the TSC clock, as on a real machine. The kernel distrusts an emulated one, and other clocks are far slower to
    // read.
    qemu.arg("-append").arg(format!("console=ttyS0 quiet tsc=reliable panic=-1 oops=panic GUEST_TESTS={tests}"));
    qemu.arg("-virtfs").arg(mount(Path::new("/"), "host", ",readonly=on,multidevs=remap"));
    qemu.arg("-virtfs").arg(mount(&folder.join("share"), "share", ""));
    qemu.stdin(Stdio::null()).status().unwrap_or_else(|e| panic!("no qemu-system-x86_64: {e}")).code()
}

/// Makes kernel and initramfs if they are missing. Returns their folder.
fn assets() -> PathBuf {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/v4l2/assets.sh");
    let output = Command::new(script).arg(scratch().join("../v4l2")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    PathBuf::from(String::from_utf8(output.stdout).unwrap().trim())
}

/// Copies a program without debug information, because the guest holds it in memory.
fn copy_program(from: &Path, to: &Path) {
    let status = Command::new("strip").arg("-o").arg(to).arg(from).status();
    assert!(status.is_ok_and(|status| status.success()), "strip {}", from.display());
}

/// The command under test.
pub(crate) fn program() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_fringeflow"))
}

/// Folder for files of tests, in the target folder.
fn scratch() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}
