//! Drivers of the virtual machine: their modules are loaded and unloaded here, and their knobs turned.

use std::path::Path;
use std::process::Command;

use crate::support::wait;

/// Where the initramfs has left its modules.
const MODULES: &str = "/tmp/modules";

/// A driver that is unloaded when this is dropped, and its devices with it.
#[derive(Debug)]
pub(crate) struct Driver {
    module: &'static str,
}

impl Driver {
    /// Loads a module with these parameters.
    pub(crate) fn load(module: &'static str, parameters: &[&str]) -> Self {
        let file = Path::new(MODULES).join(format!("{module}.ko"));
        assert!(file.exists(), "this test runs in the virtual machine that tests/v4l2 boots: {} is missing", file.display());
        succeed(Command::new("insmod").arg(file).args(parameters));
        Self { module }
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // Services that a failed test leaves behind take their time to end.
        let unloaded = wait(|| Command::new("rmmod").arg(self.module).output().is_ok_and(|ended| ended.status.success()));
        if !unloaded {
            eprintln!("{} cannot be unloaded", self.module);
        }
    }
}

/// Sets a control of a device, by the name that `v4l2-ctl` knows; a button is pressed by any value.
pub(crate) fn set_control(device: &str, name: &str, value: i64) {
    v4l2_ctl(device, &["--set-ctrl", &format!("{name}={value}")]);
}

/// What `v4l2-ctl` prints for a device.
pub(crate) fn v4l2_ctl(device: &str, arguments: &[&str]) -> String {
    succeed(Command::new("v4l2-ctl").args(["--device", device]).args(arguments))
}

fn succeed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}
