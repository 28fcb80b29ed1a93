//! The configuration of a scanner with the virtual scanner in the place of its cameras and its projector.
//!
//! In: the text of any configuration. Out: a text whose images the virtual scanner takes. Rig, pattern, volume, rate, and
//! size, region, binning and depth of the images stay. A recording holds this text, so that it tells that its images are
//! virtual.

use toml::{Table, Value};

use super::{CameraSource, ConfigurationProblem, ScannerConfiguration};

/// First lines of the text.
const REMARK: &str = "# The virtual scanner takes the images of this rig (--virtual).\n\n";
/// Keys of `[cameras]` that hold for virtual cameras too.
const KEPT: [&str; 4] = ["rate_hz", "max_skew_us", "region_px", "binning"];
/// Services of devices, which do not run.
const DEVICE_SERVICES: [&str; 3] = ["camera1", "camera2", "stereo-camera"];

/// Returns the text of a configuration with virtual cameras and a virtual projector. A configuration with virtual
/// cameras stays as it is.
///
/// # Errors
/// The text is not a valid table.
pub(super) fn virtual_text(configuration: &ScannerConfiguration) -> Result<String, ConfigurationProblem> {
    if configuration.cameras == CameraSource::Virtual {
        return Ok(configuration.text.clone());
    }
    let mut table: Table = configuration.text.parse()?;
    if let Some(Value::Table(cameras)) = table.get_mut("cameras") {
        cameras.retain(|key, _| KEPT.contains(&key));
        cameras.insert("source".to_owned(), "virtual".into());
        // The virtual cameras send what the channels carry, at the depth of the devices.
        let format = configuration.device_images.pixel_format(1);
        cameras.insert("format".to_owned(), format.name().into());
    }
    table.insert("projector".to_owned(), Table::from_iter([("driver".to_owned(), Value::from("virtual"))]).into());
    if let Some(Value::Table(processors)) = table.get_mut("processors") {
        processors.retain(|service, _| !DEVICE_SERVICES.contains(&service));
    }
    if let Some(steps) = table.get("pattern").and_then(|pattern| pattern.get("steps")).cloned()
        && let Value::Table(scanner) = table.entry("virtual_scanner").or_insert_with(|| Table::new().into())
    {
        scanner.entry("sweep").or_insert_with(|| resting(steps).into());
    }
    Ok(format!("{REMARK}{table}"))
}

/// The sweep of a scanner that rests: one image for each step. The images of a longer sweep take minutes to render.
fn resting(steps: Value) -> Table {
    let still = || Value::from(vec![Value::from(0.0); 3]);
    let keys = [("poses", steps), ("travel_mm", still()), ("turn_deg", still())];
    let keys = keys.into_iter().chain(["tremor_mm", "tremor_deg"].map(|key| (key, Value::from(0.0))));
    keys.map(|(key, value)| (key.to_owned(), value)).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use fringeflow_base::grey::PixelFormat;

    use super::*;
    use crate::{ProjectorDriver, RigSource};

    const REST: &str = "[pattern]\nsteps = 4\nperiod_px = 16.0\n[projector]\ndriver = \"external\"\n[rig]\n\
        calibration = \"rig.yml\"\nunit = \"mm\"\n[measurement_volume]\nunit = \"mm\"\n[measurement_volume.box]\n\
        R_v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nT_v = [0, 0, 300]\nmin = [-9, -9, -9]\nmax = [9, 9, 9]\n\
        [processors.camera1]\nrealtime_priority = 20\n[processors.phase]\nthreads = 2\n";

    fn parse_virtual(text: &str) -> ScannerConfiguration {
        ScannerConfiguration::parse_virtual(text, Path::new("/configs")).unwrap()
    }

    #[test]
    fn rig_rate_region_and_depth_stay_and_devices_go() {
        let devices = "[cameras]\nsource = \"v4l2\"\nrate_hz = 60.0\nformat = \"Mono12p\"\nmax_skew_us = 300.0\nbinning = 2\n\
            region_px = [8, 8, 64, 48]\n[cameras.cam1]\ndevice = \"/dev/video0\"\n[cameras.cam2]\ndevice = \"serial:7\"\n";
        let read = parse_virtual(&format!("{devices}{REST}"));
        assert_eq!((&read.cameras, read.projector), (&CameraSource::Virtual, ProjectorDriver::Virtual));
        assert_eq!((read.rate_hz, read.max_skew_ns), (60.0, 300_000));
        assert_eq!((read.readout.region_px, read.readout.binning), (Some([8, 8, 64, 48]), 2));
        assert_eq!(read.device_images.pixel_format(1), PixelFormat::Y12);
        let services: Vec<_> = read.processors.keys().copied().collect();
        assert_eq!(services, ["phase"]);
        let Some(RigSource::Virtual(scanner)) = &read.rig else { panic!("{:?}", read.rig) };
        assert_eq!(scanner.rig.as_ref().unwrap().calibration, Path::new("/configs/rig.yml"));
        assert_eq!((scanner.steps, scanner.table.sweep.poses), (4, Some(4)));
        // The text that a recording holds says it again.
        assert_eq!(ScannerConfiguration::parse(&read.text, Path::new("/configs")).unwrap(), read);
        assert!(read.recorded_text().starts_with(REMARK));
    }

    #[test]
    fn one_device_with_both_views_and_other_programs_are_replaced_too() {
        let both = "[cameras]\nsource = \"v4l2\"\nrate_hz = 30.0\nformat = \"YUYV\"\nstereo_layout = \"top-bottom\"\n\
                    [cameras.both]\ndevice = \"/dev/video0\"\n";
        let external = "[cameras]\nsource = \"external\"\nrate_hz = 30.0\n";
        let mosaic = "[cameras]\nsource = \"v4l2\"\nrate_hz = 30.0\nformat = \"RGGB\"\nbayer = \"weighted\"\n\
                      [cameras.cam1]\ndevice = \"/dev/video0\"\n[cameras.cam2]\ndevice = \"/dev/video2\"\n";
        for cameras in [both, external, mosaic] {
            let read = parse_virtual(&format!("{cameras}{REST}"));
            assert_eq!(read.cameras, CameraSource::Virtual, "{cameras}");
        }
    }

    #[test]
    fn the_scene_is_that_of_the_table() {
        let scene = "[cameras]\nsource = \"external\"\nrate_hz = 30.0\n[virtual_scanner]\nobject = \"nose\"\n\
                     [virtual_scanner.sweep]\nposes = 40\n";
        let read = parse_virtual(&format!("{scene}{REST}"));
        let Some(RigSource::Virtual(scanner)) = &read.rig else { panic!("{:?}", read.rig) };
        assert_eq!((scanner.table.object.as_deref(), scanner.table.sweep.poses), (Some("nose"), Some(40)));
        assert_eq!(parse_virtual(&read.text), read);
    }

    #[test]
    fn a_configuration_that_is_wrong_itself_is_refused() {
        let wrong = format!("[cameras]\nsource = \"v4l2\"\nrate_hz = 30.0\n{REST}");
        let problem = ScannerConfiguration::parse_virtual(&wrong, Path::new("/")).unwrap_err().to_string();
        assert!(problem.contains("key cameras.cam1 is missing"), "{problem}");
    }
}
