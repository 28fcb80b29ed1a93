//! Sets the configured controls in an order that works, and reads them back.
//!
//! A control may depend on another: automatic exposure makes the exposure time inactive, and blanking limits it. So
//! menus and switches are set first, and refused controls are tried again as long as another one succeeds.

use std::collections::BTreeMap;
use std::ffi::CString;
use std::fmt;

use v4l::v4l_sys::{V4L2_CTRL_FLAG_GRABBED, V4L2_CTRL_FLAG_INACTIVE, V4L2_CTRL_FLAG_READ_ONLY};

use fringeflow_config::ControlValue;

use crate::ioctl::{CallError, Device};

use super::controls::{Control, ControlKind, query_control};
use super::find::is_lasting;

/// Least similarity of a name that is suggested in place of an unknown one, 0 to 1.
const MIN_SIMILARITY: f64 = 0.75;
/// Maximum number of suggested names.
const MAX_SUGGESTIONS: usize = 4;

/// A control that cannot be set as configured.
#[derive(Debug, thiserror::Error)]
#[error("control {name} = {value}: {problem}{}", accepted_text(control.as_deref()))]
pub struct ControlError {
    /// Its name in the configuration.
    pub name: String,
    /// The configured value.
    pub value: ControlValue,
    /// The problem.
    #[source]
    pub problem: ControlProblem,
    /// The control, if the device has it.
    pub control: Option<Box<Control>>,
}

/// Why a control cannot be set as configured.
#[derive(Debug, thiserror::Error)]
pub enum ControlProblem {
    /// The device has no control of this name.
    #[error("the device has no such control ({})", suggestions_text(similar))]
    Unknown {
        /// Similar names.
        similar: Vec<String>,
    },
    /// The value has the wrong type.
    #[error("the value has the wrong type")]
    Type,
    /// The value is out of bounds, or not an item of the menu.
    #[error("the value is out of range")]
    Range,
    /// The value is between two steps.
    #[error("the value is between two steps; the nearest value is {nearest}")]
    Step {
        /// The nearest value.
        nearest: i64,
    },
    /// The control is read-only.
    #[error("the control is read-only")]
    ReadOnly,
    /// Another control makes it inactive.
    #[error("another control, such as an automatic mode, makes it inactive; set that control too")]
    Inactive,
    /// The control is locked, because the device is in use.
    #[error("the control is locked, because the device is in use")]
    Grabbed,
    /// The control reads back another value.
    #[error("the device set {found} instead")]
    Changed {
        /// The value that was read back.
        found: String,
    },
    /// The device refuses the call.
    #[error("{0}")]
    Call(#[source] CallError),
}

impl ControlError {
    /// Whether the configuration must change.
    pub(crate) fn is_lasting(&self) -> bool {
        match &self.problem {
            ControlProblem::Call(error) => is_lasting(&error.source),
            ControlProblem::Grabbed => false,
            _ => true,
        }
    }
}

fn accepted_text(control: Option<&Control>) -> String {
    control.map_or_else(String::new, |control| format!(" (it takes {control})"))
}

fn suggestions_text(similar: &[String]) -> String {
    match similar {
        [] => "`fringeflow cameras` lists its controls".to_owned(),
        similar => format!("similar: {}", similar.join(", ")),
    }
}

/// Sets the controls of `settings`.
///
/// # Errors
/// All controls that cannot be set.
pub(crate) fn set(
    device: &Device,
    controls: &[Control],
    settings: &BTreeMap<String, ControlValue>,
) -> Result<(), Vec<ControlError>> {
    let (mut settings, unknown) = match_controls(controls, settings);
    let mut failed = Vec::new();
    // Each round may make further controls active or widen their bounds. A round without success ends the loop.
    while !settings.is_empty() {
        let before = settings.len();
        failed.clear();
        settings.retain(|setting| match set_one(device, setting) {
            Ok(()) => false,
            Err(error) => {
                failed.push(error);
                true
            }
        });
        if settings.len() == before {
            break;
        }
    }
    if !settings.is_empty() || !unknown.is_empty() {
        return Err(unknown.into_iter().chain(failed).collect());
    }
    Ok(())
}

/// Compares the controls with `settings`, because setting one control may have changed another. Returns their values as
/// text.
///
/// # Errors
/// All controls with other values.
pub(crate) fn read_back(
    device: &Device,
    controls: &[Control],
    settings: &BTreeMap<String, ControlValue>,
) -> Result<Vec<String>, Vec<ControlError>> {
    let (settings, _) = match_controls(controls, settings);
    let (mut read, mut failed) = (Vec::new(), Vec::new());
    for setting in &settings {
        match compare(device, setting) {
            Ok(found) => read.push(format!("{} = {found}", setting.control.name)),
            Err(problem) => failed.push(setting.error(problem)),
        }
    }
    if failed.is_empty() { Ok(read) } else { Err(failed) }
}

/// A control and its configured value.
struct Setting<'a> {
    control: &'a Control,
    value: &'a ControlValue,
}

impl Setting<'_> {
    fn error(&self, problem: ControlProblem) -> ControlError {
        ControlError {
            name: self.control.name.clone(),
            value: self.value.clone(),
            problem,
            control: Some(Box::new(self.control.clone())),
        }
    }
}

/// Returns the controls to set, menus and switches first, and errors for names that the device does not have.
fn match_controls<'a>(
    controls: &'a [Control],
    settings: &'a BTreeMap<String, ControlValue>,
) -> (Vec<Setting<'a>>, Vec<ControlError>) {
    let (mut found, mut unknown) = (Vec::new(), Vec::new());
    for (name, value) in settings {
        match controls.iter().find(|control| control.name == *name) {
            Some(control) => found.push(Setting { control, value }),
            None => unknown.push(ControlError {
                name: name.clone(),
                value: value.clone(),
                problem: ControlProblem::Unknown { similar: similar_names(controls, name) },
                control: None,
            }),
        }
    }
    found.sort_by_key(|setting| !setting.control.kind.is_choice());
    (found, unknown)
}

/// Returns the names of controls that are similar to a name, the most similar first.
fn similar_names(controls: &[Control], name: &str) -> Vec<String> {
    let similarity = |control: &Control| strsim::jaro_winkler(&control.name, name);
    let mut similar: Vec<&Control> = controls.iter().filter(|control| similarity(control) >= MIN_SIMILARITY).collect();
    similar.sort_by(|a, b| similarity(b).total_cmp(&similarity(a)));
    similar.into_iter().take(MAX_SUGGESTIONS).map(|control| control.name.clone()).collect()
}

fn set_one(device: &Device, setting: &Setting<'_>) -> Result<(), ControlError> {
    // Bounds and flags may have changed since the controls were listed.
    let now = query_control(device, setting.control.id).map_err(|error| setting.error(ControlProblem::Call(error)))?;
    let setting = Setting { control: &now, value: setting.value };
    let problem = match encode(&now, setting.value) {
        Ok(encoded) => write(device, &now, &encoded).map_err(ControlProblem::Call),
        Err(problem) => Err(problem),
    };
    problem.map_err(|problem| setting.error(problem))
}

/// A value in the form that a call takes.
#[derive(Debug, PartialEq, Eq)]
enum Encoded {
    Number(i64),
    Text(CString),
    /// A button that is not pressed.
    Nothing,
}

fn write(device: &Device, control: &Control, value: &Encoded) -> Result<(), CallError> {
    match value {
        Encoded::Number(number) => {
            device.set_integer_control(control.id, control.kind == ControlKind::Integer64, *number)
        }
        Encoded::Text(text) => device.set_string_control(control.id, text),
        Encoded::Nothing => Ok(()),
    }
}

/// Checks and encodes a value for a control.
fn encode(control: &Control, value: &ControlValue) -> Result<Encoded, ControlProblem> {
    if control.has_flag(V4L2_CTRL_FLAG_READ_ONLY) {
        return Err(ControlProblem::ReadOnly);
    }
    if control.has_flag(V4L2_CTRL_FLAG_INACTIVE) {
        return Err(ControlProblem::Inactive);
    }
    if control.has_flag(V4L2_CTRL_FLAG_GRABBED) {
        return Err(ControlProblem::Grabbed);
    }
    match (control.kind, value) {
        (ControlKind::Integer | ControlKind::Integer64, ControlValue::Number(number)) => check_number(control, *number),
        (ControlKind::Boolean, ControlValue::Switch(is_on)) => Ok(Encoded::Number((*is_on).into())),
        (ControlKind::Boolean, ControlValue::Number(number @ 0..=1)) => Ok(Encoded::Number(*number)),
        (ControlKind::Menu | ControlKind::IntegerMenu, value) => item_number(control, value).map(Encoded::Number),
        (ControlKind::Bitmask, ControlValue::Number(bits)) => {
            let bits = u32::try_from(*bits).map_err(|_| ControlProblem::Range)?;
            let is_within = i64::from(bits) & !control.greatest == 0;
            // The call carries the bits as a signed number.
            if is_within { Ok(Encoded::Number(bits.cast_signed().into())) } else { Err(ControlProblem::Range) }
        }
        (ControlKind::Button, ControlValue::Switch(is_pressed)) => {
            Ok(if *is_pressed { Encoded::Number(1) } else { Encoded::Nothing })
        }
        (ControlKind::Text, ControlValue::Text(text)) => {
            check_number(control, i64::try_from(text.len()).unwrap_or(i64::MAX))?;
            CString::new(text.as_str()).map(Encoded::Text).map_err(|_| ControlProblem::Type)
        }
        _ => Err(ControlProblem::Type),
    }
}

/// Checks that a number is in bounds and on a step: drivers round other numbers silently.
fn check_number(control: &Control, number: i64) -> Result<Encoded, ControlProblem> {
    if !(control.least..=control.greatest).contains(&number) {
        return Err(ControlProblem::Range);
    }
    let step = u128::from(control.step.max(1));
    let above = number.abs_diff(control.least);
    let rest = u128::from(above) % step;
    if rest == 0 {
        return Ok(Encoded::Number(number));
    }
    let lower = i128::from(number) - rest as i128;
    let upper = lower + step as i128;
    let is_upper = rest * 2 > step && upper <= i128::from(control.greatest);
    let nearest = if is_upper { upper } else { lower };
    Err(ControlProblem::Step { nearest: i64::try_from(nearest).unwrap_or(control.least) })
}

/// Returns the number of a menu item that is given by number or name.
fn item_number(control: &Control, value: &ControlValue) -> Result<i64, ControlProblem> {
    let is_meant = |item: &&crate::device::controls::MenuItem| match value {
        ControlValue::Number(number) => item.number == *number,
        ControlValue::Text(name) => item.name == *name,
        ControlValue::Switch(_) => false,
    };
    control.items.iter().find(is_meant).map(|item| item.number).ok_or(ControlProblem::Range)
}

/// Reads a control back and returns its value as text.
///
/// # Errors
/// The value is not the one that was set.
fn compare(device: &Device, setting: &Setting<'_>) -> Result<String, ControlProblem> {
    let control = setting.control;
    let Some(found) = control.read(device).map_err(ControlProblem::Call)? else {
        return Ok(setting.value.to_string());
    };
    let text = control.value_text(&found);
    if !control.reads_back() || is_same(control, setting.value, &found) {
        return Ok(text);
    }
    Err(ControlProblem::Changed { found: text })
}

fn is_same(control: &Control, wanted: &ControlValue, found: &ControlValue) -> bool {
    let number = |value: &ControlValue| match value {
        ControlValue::Switch(is_on) => Some(i64::from(*is_on)),
        value if !control.items.is_empty() => item_number(control, value).ok(),
        ControlValue::Number(number) => Some(*number),
        ControlValue::Text(_) => None,
    };
    wanted == found || number(wanted).is_some_and(|wanted| Some(wanted) == number(found))
}

/// Several errors in one line.
pub(crate) struct Joined<'a>(pub(crate) &'a [ControlError]);

impl fmt::Display for Joined<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let errors: Vec<String> = self.0.iter().map(ControlError::to_string).collect();
        write!(f, "{}", errors.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::controls::MenuItem;

    fn control(kind: ControlKind, least: i64, greatest: i64, step: u64) -> Control {
        let (name, title) = ("gain".to_owned(), "Gain".to_owned());
        Control { id: 1, name, title, kind, least, greatest, step, default: least, flags: 0, items: Vec::new() }
    }

    fn menu() -> Control {
        let item = |number, name: &str| MenuItem { number, name: name.to_owned() };
        Control {
            items: vec![item(1, "Manual Mode"), item(3, "Aperture Priority")],
            ..control(ControlKind::Menu, 0, 3, 1)
        }
    }

    fn encode_number(control: &Control, value: i64) -> Result<Encoded, String> {
        encode(control, &ControlValue::Number(value)).map_err(|problem| problem.to_string())
    }

    #[test]
    fn numbers_must_be_in_bounds_and_on_a_step() {
        let gain = control(ControlKind::Integer, 4, 100, 10);
        assert_eq!(encode_number(&gain, 14), Ok(Encoded::Number(14)));
        assert_eq!(encode_number(&gain, 94), Ok(Encoded::Number(94)));
        assert!(encode_number(&gain, 3).is_err() && encode_number(&gain, 101).is_err());
        assert_eq!(encode_number(&gain, 18).unwrap_err(), "the value is between two steps; the nearest value is 14");
        assert_eq!(encode_number(&gain, 20).unwrap_err(), "the value is between two steps; the nearest value is 24");
        // The step above would be out of bounds.
        assert_eq!(encode_number(&gain, 100).unwrap_err(), "the value is between two steps; the nearest value is 94");
    }

    #[test]
    fn absurd_bounds_do_not_panic() {
        let full = |step| control(ControlKind::Integer64, i64::MIN, i64::MAX, step);
        assert_eq!(encode_number(&full(0), i64::MAX), Ok(Encoded::Number(i64::MAX)));
        assert!(encode_number(&full(u64::MAX), 5).is_err() && encode_number(&full(1 << 63), i64::MAX).is_err());
        assert!(encode_number(&control(ControlKind::Integer, 5, -5, 1), 0).is_err());
    }

    #[test]
    fn menu_items_are_found_by_number_and_name() {
        let text = |name: &str| encode(&menu(), &ControlValue::Text(name.into()));
        assert_eq!(text("Aperture Priority").unwrap(), Encoded::Number(3));
        assert_eq!(encode_number(&menu(), 1), Ok(Encoded::Number(1)));
        // A gap in the menu, and another spelling.
        assert!(encode_number(&menu(), 2).is_err() && text("manual mode").is_err());
        let wanted = ControlValue::Text("Manual Mode".into());
        assert!(is_same(&menu(), &wanted, &ControlValue::Number(1)));
        assert!(!is_same(&menu(), &wanted, &ControlValue::Number(3)));
    }

    #[test]
    fn each_kind_takes_its_own_type() {
        let on = ControlValue::Switch(true);
        assert_eq!(encode(&control(ControlKind::Boolean, 0, 1, 1), &on).unwrap(), Encoded::Number(1));
        assert_eq!(encode(&control(ControlKind::Button, 0, 0, 0), &on).unwrap(), Encoded::Number(1));
        assert!(encode(&control(ControlKind::Integer, 0, 9, 1), &on).is_err());
        let bits = control(ControlKind::Bitmask, 0, 0x8000_0001, 0);
        assert_eq!(encode_number(&bits, 0x8000_0000), Ok(Encoded::Number(i64::from(i32::MIN))));
        assert!(encode_number(&bits, 2).is_err() && encode_number(&bits, -1).is_err());
        let text = |value: &str| encode(&control(ControlKind::Text, 2, 4, 2), &ControlValue::Text(value.into()));
        assert_eq!(text("ab").unwrap(), Encoded::Text(c"ab".into()));
        assert!(text("abc").is_err() && text("abcdef").is_err() && text("a\0").is_err());
    }

    #[test]
    fn errors_name_the_flag_that_blocks_a_control() {
        let flagged =
            |flags| encode_number(&Control { flags, ..control(ControlKind::Integer, 0, 9, 1) }, 5).unwrap_err();
        assert!(flagged(V4L2_CTRL_FLAG_READ_ONLY).contains("read-only"));
        assert!(flagged(V4L2_CTRL_FLAG_INACTIVE).contains("makes it inactive"));
        assert!(flagged(V4L2_CTRL_FLAG_GRABBED).contains("in use"));
    }

    #[test]
    fn errors_name_bounds_items_and_similar_names() {
        let value = ControlValue::Number(300);
        let gain = control(ControlKind::Integer, 0, 255, 1);
        let error = Setting { control: &gain, value: &value }.error(ControlProblem::Range).to_string();
        assert_eq!(error, "control gain = 300: the value is out of range (it takes a number from 0 to 255, default 0)");
        let menu = menu();
        let error = Setting { control: &menu, value: &value }.error(ControlProblem::Range).to_string();
        assert!(error.ends_with("(it takes one of 1 \"Manual Mode\", 3 \"Aperture Priority\", default 0)"), "{error}");
        let settings = BTreeMap::from([("gane".to_owned(), value)]);
        let controls = [gain];
        let (found, unknown) = match_controls(&controls, &settings);
        assert!(found.is_empty());
        assert_eq!(unknown[0].to_string(), "control gane = 300: the device has no such control (similar: gain)");
    }

    #[test]
    fn menus_and_switches_are_set_first() {
        let control_named = |name: &str, kind| Control { name: name.into(), ..control(kind, 0, 9, 1) };
        let controls = [control_named("a", ControlKind::Integer), control_named("z", ControlKind::Boolean)];
        let settings = ["a", "z"].map(|name| (name.to_owned(), ControlValue::Number(1))).into();
        let (ordered, _) = match_controls(&controls, &settings);
        let names: Vec<&str> = ordered.iter().map(|setting| setting.control.name.as_str()).collect();
        assert_eq!(names, ["z", "a"]);
    }
}
