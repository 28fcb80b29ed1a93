//! Drivers of the virtual machine: their modules are loaded and unloaded here, their devices plugged in and out, and their
//! knobs turned.

use std::path::Path;
use std::process::Command;

use v4l::Device;
use v4l::control::{Control, Value};

use crate::support::wait;

/// Controls of vivid that make things go wrong, by their numbers in V4L2.
#[derive(Clone, Copy, Debug)]
#[repr(u32)]
pub(crate) enum Knob {
    /// Percentage of images that are dropped.
    DroppedPercentage = 0x00f0_f040,
    /// Unplugs the device until all have closed it.
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

/// Presses buttons of a device.
pub(crate) fn press(device: &str, buttons: &[Knob]) {
    buttons.iter().for_each(|&button| turn(device, button, 1));
}

/// Sets a control of a device.
pub(crate) fn turn(device: &str, knob: Knob, value: i64) {
    let control = Control { id: knob as u32, value: Value::Integer(value) };
    Device::with_path(device).unwrap().set_control(control).unwrap();
}

/// What `v4l2-ctl` prints for a device.
pub(crate) fn v4l2_ctl(device: &str, arguments: &[&str]) -> String {
    done(Command::new("v4l2-ctl").args(["--device", device]).args(arguments))
}

fn done(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let [said, error] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{command:?}: {}: {said}{error}", output.status);
    said
}
