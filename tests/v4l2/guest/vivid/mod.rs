//! Cameras of the driver vivid.
use crate::support::Bench;
#[test]
#[ignore = "runs in the virtual machine"]
fn smoke() {
    let _vivid = super::driver::Driver::load("vivid", &["n_devs=2"]);
    for _ in 0..5 {
    let start = std::time::Instant::now();
    super::driver::set_control("/dev/video0", "brightness", 30);
    eprintln!("v4l2-ctl {:?}", start.elapsed());
    }
    let start = std::time::Instant::now();
    let bench = Bench::new();
    let ended = bench.run(&[&"--seconds", &"5"]);
    eprintln!("{:?} {ended:?}", start.elapsed());
}
