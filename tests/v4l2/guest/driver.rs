//! Drivers in the virtual machine: loads and unloads modules, plugs and unplugs devices, and sets controls.

use std::path::Path;
use std::process::Command;

use v4l::Device;
use v4l::control::{Control, Value};

use crate::support::wait_until;

/// Controls of vivid that inject faults, by their V4L2 ids.
#[derive(Clone, Copy, Debug)]
#[repr(u32)]
pub(crate) enum FaultControl {
    /// Percentage of images to drop.
    DroppedPercentage = 0x00f0_f040,
    /// Unplugs the device until all programs have closed it.
    Disconnect = 0x00f0_f041,
    /// Marks the next image as damaged.
    Damaged = 0x00f0_f042,
    /// Refuses the next request for buffers.
    Reqbufs = 0x00f0_f043,
    /// Refuses the next buffer.
    Qbuf = 0x00f0_f044,
    /// Refuses the next start of a stream.
    Streamon = 0x00f0_f045,
    /// Ends the stream with an error.
    Fatal = 0x00f0_f046,
}

/// Folder of the modules from the initramfs.
const MODULES: &str = "/tmp/modules";

/// A loaded driver. It is unloaded on drop, with its devices.
#[derive(Debug)]
pub(crate) struct Driver {
    module: &'static str,
}

impl Driver {
    /// Loads a module with parameters.
    pub(crate) fn load(module: &'static str, parameters: &[&str]) -> Self {
        let file = Path::new(MODULES).join(format!("{module}.ko"));
        assert!(file.exists(), "{} exists only in the virtual machine of tests/v4l2", file.display());
        run_command(Command::new("insmod").arg(file).args(parameters));
        Self { module }
    }

    /// Removes the devices, as if they were unplugged.
    pub(crate) fn unplug(&self) {
        self.write("unbind");
    }

    /// Adds the devices again, under the lowest free numbers.
    pub(crate) fn plug_in(&self) {
        self.write("bind");
    }

    fn write(&self, file: &str) {
        let Self { module } = self;
        std::fs::write(format!("/sys/bus/platform/drivers/{module}/{file}"), format!("{module}.0")).unwrap();
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // Services of a failed test may still be ending.
        let unloaded =
            wait_until(|| Command::new("rmmod").arg(self.module).output().is_ok_and(|ended| ended.status.success()));
        if !unloaded {
            eprintln!("{} cannot be unloaded", self.module);
        }
    }
}

/// Presses buttons of a device.
pub(crate) fn press(device: &str, buttons: &[FaultControl]) {
    buttons.iter().for_each(|&button| set_control(device, button, 1));
}

/// Sets a control of a device.
pub(crate) fn set_control(device: &str, control: FaultControl, value: i64) {
    let control = Control { id: control as u32, value: Value::Integer(value) };
    Device::with_path(device).unwrap().set_control(control).unwrap();
}

/// Runs `v4l2-ctl` on a device. Returns its output.
pub(crate) fn v4l2_ctl(device: &str, arguments: &[&str]) -> String {
    run_command(Command::new("v4l2-ctl").args(["--device", device]).args(arguments))
}

fn run_command(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let [printed, error] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{command:?}: {}: {printed}{error}", output.status);
    printed
}
