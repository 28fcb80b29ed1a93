//! Settings of extension units: controls of a UVC device that its driver maps to no V4L2 control.
//!
//! In: unit, selector and bytes of each. Out: the device has the bytes, or the reason why not. The driver passes the
//! requests of the UVC standard on: the control states its length and what can be done with it, takes the bytes, and
//! gives them back.

use rustix::io::Errno;

use fringeflow_config::ExtensionUnitSetting;

use crate::ioctl::{CallError, Device};

use super::capability::Capability;
use super::find::is_lasting;

/// Requests of the UVC standard.
const SET_CUR: u8 = 0x01;
const GET_CUR: u8 = 0x81;
const GET_LEN: u8 = 0x85;
const GET_INFO: u8 = 0x86;
/// Bits of the answer to [`GET_INFO`].
const CAN_GET: u8 = 1;
const CAN_SET: u8 = 2;

/// A setting of an extension unit that cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("extension unit {unit}, selector {selector}: {problem}")]
pub struct ExtensionUnitError {
    /// Number of the unit.
    pub unit: u8,
    /// Number of the control in the unit.
    pub selector: u8,
    /// The problem.
    #[source]
    pub problem: ExtensionUnitProblem,
}

/// Why a setting of an extension unit cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ExtensionUnitProblem {
    /// The device has no extension units.
    #[error(
        "the driver is {driver}, and only USB cameras of the driver uvcvideo have extension units; remove \
         extension_units, and use controls"
    )]
    NotUvc {
        /// Its driver.
        driver: String,
    },
    /// The device has no such unit, or the unit has no such control.
    #[error("the device has no such unit or selector; `lsusb -v` lists its extension units")]
    Unknown,
    /// The value has the wrong length.
    #[error("{given} bytes are configured, and the device takes {taken}")]
    Length {
        /// The configured number of bytes.
        given: usize,
        /// The number that the device takes.
        taken: usize,
    },
    /// The control cannot be set.
    #[error("it is read-only")]
    ReadOnly,
    /// The device kept another value.
    #[error("the device has {found} instead of {wanted}")]
    Changed {
        /// The configured bytes.
        wanted: String,
        /// The bytes that were read back.
        found: String,
    },
    /// The device or its driver refuses a request.
    #[error("{0}")]
    Call(#[source] CallError),
}

impl ExtensionUnitError {
    /// Whether the configuration must change.
    pub(crate) fn is_lasting(&self) -> bool {
        match &self.problem {
            ExtensionUnitProblem::Call(error) => is_lasting(&error.source),
            _ => true,
        }
    }
}

/// Makes the settings in their order, and reads each back. Returns them as text.
///
/// # Errors
/// The first setting that cannot be made.
pub(crate) fn set(
    device: &Device,
    capability: &Capability,
    settings: &[ExtensionUnitSetting],
) -> Result<Vec<String>, ExtensionUnitError> {
    let query = |address, request, data: &mut [u8]| device.query_extension_unit(address, request, data);
    let set = |setting: &ExtensionUnitSetting| {
        let made = check_driver(&capability.driver).and_then(|()| set_one(setting, query));
        let ExtensionUnitSetting { unit, selector, .. } = *setting;
        made.map_err(|problem| ExtensionUnitError { unit, selector, problem })
    };
    settings.iter().map(set).collect()
}

fn check_driver(driver: &str) -> Result<(), ExtensionUnitProblem> {
    if driver == "uvcvideo" { Ok(()) } else { Err(ExtensionUnitProblem::NotUvc { driver: driver.to_owned() }) }
}

/// Makes one setting by `query`, which sends a request to unit and selector.
fn set_one(
    ExtensionUnitSetting { unit, selector, bytes }: &ExtensionUnitSetting,
    query: impl Fn([u8; 2], u8, &mut [u8]) -> Result<(), CallError>,
) -> Result<String, ExtensionUnitProblem> {
    let request = |request, data: &mut [u8]| query([*unit, *selector], request, data).map_err(problem_of);
    let mut length = [0; 2];
    request(GET_LEN, &mut length)?;
    let taken = usize::from(u16::from_le_bytes(length));
    if bytes.len() != taken {
        return Err(ExtensionUnitProblem::Length { given: bytes.len(), taken });
    }
    let mut info = [0; 1];
    request(GET_INFO, &mut info)?;
    if info[0] & CAN_SET == 0 {
        return Err(ExtensionUnitProblem::ReadOnly);
    }
    let mut data = bytes.clone();
    request(SET_CUR, &mut data)?;
    let text = format!("extension unit {unit}:{selector} = {}", bytes_text(bytes));
    if info[0] & CAN_GET == 0 {
        return Ok(text + " (cannot be read back)");
    }
    data.fill(0);
    request(GET_CUR, &mut data)?;
    if data != *bytes {
        return Err(ExtensionUnitProblem::Changed { wanted: bytes_text(bytes), found: bytes_text(&data) });
    }
    Ok(text)
}

fn problem_of(error: CallError) -> ExtensionUnitProblem {
    match error.errno() {
        Some(Errno::NOENT) => ExtensionUnitProblem::Unknown,
        _ => ExtensionUnitProblem::Call(error),
    }
}

fn bytes_text(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    /// A unit 3 with the control 2.
    struct Unit {
        info: u8,
        /// Bits that the control keeps of a value.
        kept: u8,
        value: RefCell<Vec<u8>>,
        requests: RefCell<Vec<u8>>,
    }

    impl Unit {
        fn new(info: u8, kept: u8) -> Self {
            Self { info, kept, value: RefCell::new(vec![9, 9]), requests: RefCell::default() }
        }

        fn answer(&self, address: [u8; 2], request: u8, data: &mut [u8]) -> Result<(), CallError> {
            let refuse = |errno: Errno| Err(CallError { call: "UVCIOC_CTRL_QUERY", source: errno.into() });
            if address != [3, 2] {
                return refuse(Errno::NOENT);
            }
            self.requests.borrow_mut().push(request);
            let mut value = self.value.borrow_mut();
            match request {
                GET_LEN => data.copy_from_slice(&[2, 0]),
                GET_INFO => data.copy_from_slice(&[self.info]),
                SET_CUR => *value = data.iter().map(|byte| byte & self.kept).collect(),
                GET_CUR => data.copy_from_slice(&value),
                _ => return refuse(Errno::INVAL),
            }
            Ok(())
        }

        fn set(&self, selector: u8, bytes: &[u8]) -> Result<String, String> {
            let setting = ExtensionUnitSetting { unit: 3, selector, bytes: bytes.to_vec() };
            let query = |address, request, data: &mut [u8]| self.answer(address, request, data);
            set_one(&setting, query).map_err(|problem| problem.to_string())
        }
    }

    #[test]
    fn a_value_is_sent_and_read_back() {
        let unit = Unit::new(CAN_GET | CAN_SET, 0xff);
        assert_eq!(unit.set(2, &[1, 0xa0]).unwrap(), "extension unit 3:2 = 01 a0");
        assert_eq!(*unit.value.borrow(), [1, 0xa0]);
        assert_eq!(*unit.requests.borrow(), [GET_LEN, GET_INFO, SET_CUR, GET_CUR]);
    }

    #[test]
    fn a_value_that_the_device_does_not_take_is_refused() {
        let unit = Unit::new(CAN_GET | CAN_SET, 0x0f);
        assert_eq!(unit.set(2, &[1, 0xa0]).unwrap_err(), "the device has 01 00 instead of 01 a0");
        assert_eq!(unit.set(2, &[1]).unwrap_err(), "1 bytes are configured, and the device takes 2");
        assert!(unit.set(7, &[1, 1]).unwrap_err().contains("no such unit or selector"));
        let read_only = Unit::new(CAN_GET, 0xff);
        assert_eq!(read_only.set(2, &[1, 1]).unwrap_err(), "it is read-only");
        assert!(!read_only.requests.borrow().contains(&SET_CUR));
    }

    #[test]
    fn a_value_that_cannot_be_read_says_so() {
        assert_eq!(Unit::new(CAN_SET, 0).set(2, &[0, 1]).unwrap(), "extension unit 3:2 = 00 01 (cannot be read back)");
    }

    #[test]
    fn only_the_uvc_driver_has_extension_units() {
        assert!(check_driver("uvcvideo").is_ok());
        assert!(
            check_driver("vivid").unwrap_err().to_string().starts_with("the driver is vivid, and only USB cameras")
        );
    }
}
