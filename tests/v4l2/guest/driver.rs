//! Drivers of the virtual machine: their modules are loaded and unloaded here, their devices plugged in and out, and their
//! knobs turned.

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
        assert!(file.exists(), "only the virtual machine that tests/v4l2 boots has {}", file.display());
        done(Command::new("insmod").arg(file).args(parameters));
        Self { module }
    }

    /// Takes the devices away, as if they were unplugged.
    pub(crate) fn unplug(&self) {
        self.write("unbind");
    }

    /// Brings them back, under the lowest numbers that are free.
    pub(crate) fn plug_in(&self) {
        self.write("bind");
    }

    fn write(&self, what: &str) {
        let Self { module } = self;
        std::fs::write(format!("/sys/bus/platform/drivers/{module}/{what}"), format!("{module}.0")).unwrap();
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // Services that a failed test leaves behind take their time to end.
        let unloaded =
            wait(|| Command::new("rmmod").arg(self.module).output().is_ok_and(|ended| ended.status.success()));
        if !unloaded {
            eprintln!("{} cannot be unloaded", self.module);
        }
    }
}

/// Presses buttons of a device, by the names that `v4l2-ctl` has for them.
pub(crate) fn press(device: &str, buttons: &[&str]) {
    let pressed: Vec<String> = buttons.iter().map(|button| format!("{button}=1")).collect();
    v4l2_ctl(device, &["--set-ctrl", &pressed.join(",")]);
}

/// What `v4l2-ctl` prints for a device.
pub(crate) fn v4l2_ctl(device: &str, arguments: &[&str]) -> String {
    done(Command::new("v4l2-ctl").args(["--device", device]).args(arguments))
}

fn done(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}
