//! Controls as configured: brought into an order that works, set, and read back.
//!
//! One control may hold another: automatic exposure holds the exposure, blanking bounds it. So menus and switches go first,
//! and what is refused is tried again as long as anything else goes through.

use std::collections::BTreeMap;
use std::ffi::CString;
use std::fmt;

use v4l::v4l_sys::{V4L2_CTRL_FLAG_GRABBED, V4L2_CTRL_FLAG_INACTIVE, V4L2_CTRL_FLAG_READ_ONLY};

use fringeflow_config::ControlValue;

use crate::ioctl::{CallError, Device};

use super::controls::{Control, ControlKind, query};
use super::find::is_lasting;

/// Likeness of two names, of 1, from which one is told in place of the other.
const LIKE: f64 = 0.75;
/// Most names that are told.
const TOLD_NAMES: usize = 4;

/// A control that cannot be set as configured.
#[derive(Debug, thiserror::Error)]
#[error("control {name} = {value}: {problem}{}", takes(control.as_deref()))]
pub struct ControlError {
    /// Its name.
    pub name: String,
    /// The configured value.
    pub value: ControlValue,
    /// What is wrong.
    #[source]
    pub problem: ControlProblem,
    /// The control, if there is one.
    pub control: Option<Box<Control>>,
}

/// What is wrong with a control.
#[derive(Debug, thiserror::Error)]
pub enum ControlProblem {
    /// There is none of this name.
    #[error("the device has no such control ({})", names_text(near))]
    Unknown {
        /// Names that are like it.
        near: Vec<String>,
    },
    /// A value of another type.
    #[error("the control does not take this value")]
    Type,
    /// Outside its bounds, or no item of a menu.
    #[error("the control cannot be set")]
    Range,
    /// Between two steps.
    #[error("the control has steps; the nearest value is {nearest}")]
    Step {
        /// The nearest value.
        nearest: i64,
    },
    /// It can only be read.
    #[error("the control is read-only")]
    ReadOnly,
    /// Another control holds it.
    #[error("another control holds it, such as an automatic one; set that one too")]
    Inactive,
    /// Somebody else uses the device.
    #[error("the device is in use and holds it")]
    Grabbed,
    /// The device has another value after it was set.
    #[error("the device set {found} instead")]
    Changed {
        /// That value.
        found: String,
    },
    /// The device refuses it.
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

fn takes(control: Option<&Control>) -> String {
    control.map_or_else(String::new, |control| format!(" (it takes {control})"))
}

fn names_text(near: &[String]) -> String {
    match near {
        [] => "`fringeflow cameras` lists those that it has".to_owned(),
        near => format!("it has {}", near.join(", ")),
    }
}

/// Sets controls, and reads back what they are then.
///
/// # Errors
/// All those that cannot be set.
pub(crate) fn set(
    device: &Device,
    controls: &[Control],
    settings: &BTreeMap<String, ControlValue>,
) -> Result<(), Vec<ControlError>> {
    let (mut settings, unknown) = named(controls, settings);
    let mut failed = Vec::new();
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

/// Compares what controls are with what was set: a later one may have changed an earlier one. What they are, in words.
///
/// # Errors
/// Those that are something else.
pub(crate) fn read_back(
    device: &Device,
    controls: &[Control],
    settings: &BTreeMap<String, ControlValue>,
) -> Result<Vec<String>, Vec<ControlError>> {
    let (settings, _) = named(controls, settings);
    let (mut read, mut failed) = (Vec::new(), Vec::new());
    for setting in &settings {
        match compare(device, setting) {
            Ok(found) => read.push(format!("{} = {found}", setting.control.name)),
            Err(problem) => failed.push(setting.error(problem)),
        }
    }
    if failed.is_empty() { Ok(read) } else { Err(failed) }
}

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

/// The controls that are to be set, those first that others depend on, and errors of those that are not there.
fn named<'a>(
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
                problem: ControlProblem::Unknown { near: near(controls, name) },
                control: None,
            }),
        }
    }
    found.sort_by_key(|setting| !setting.control.kind.is_choice());
    (found, unknown)
}

/// Names that are like a name, the most like first.
fn near(controls: &[Control], name: &str) -> Vec<String> {
    let likeness = |control: &Control| strsim::jaro_winkler(&control.name, name);
    let mut like: Vec<&Control> = controls.iter().filter(|control| likeness(control) >= LIKE).collect();
    like.sort_by(|a, b| likeness(b).total_cmp(&likeness(a)));
    like.into_iter().take(TOLD_NAMES).map(|control| control.name.clone()).collect()
}

fn set_one(device: &Device, setting: &Setting<'_>) -> Result<(), ControlError> {
    // Bounds and flags change with what was set before.
    let now = query(device, setting.control.id).map_err(|error| setting.error(ControlProblem::Call(error)))?;
    let setting = Setting { control: &now, value: setting.value };
    let problem = match encode(&now, setting.value) {
        Ok(encoded) => write(device, &now, &encoded).map_err(ControlProblem::Call),
        Err(problem) => Err(problem),
    };
    problem.map_err(|problem| setting.error(problem))
}

/// A value as a control takes it.
#[derive(Debug, PartialEq, Eq)]
enum Encoded {
    Number(i64),
    Text(CString),
    Nothing,
}

fn write(device: &Device, control: &Control, value: &Encoded) -> Result<(), CallError> {
    match value {
        Encoded::Number(number) => device.set_number(control.id, control.kind == ControlKind::Integer64, *number),
        Encoded::Text(text) => device.set_text(control.id, text),
        Encoded::Nothing => Ok(()),
    }
}

/// Checks a value against what a control takes.
fn encode(control: &Control, value: &ControlValue) -> Result<Encoded, ControlProblem> {
    if control.has(V4L2_CTRL_FLAG_READ_ONLY) {
        return Err(ControlProblem::ReadOnly);
    }
    if control.has(V4L2_CTRL_FLAG_INACTIVE) {
        return Err(ControlProblem::Inactive);
    }
    if control.has(V4L2_CTRL_FLAG_GRABBED) {
        return Err(ControlProblem::Grabbed);
    }
    match (control.kind, value) {
        (ControlKind::Integer | ControlKind::Integer64, ControlValue::Number(number)) => stepped(control, *number),
        (ControlKind::Boolean, ControlValue::Switch(is_on)) => Ok(Encoded::Number((*is_on).into())),
        (ControlKind::Boolean, ControlValue::Number(number @ 0..=1)) => Ok(Encoded::Number(*number)),
        (ControlKind::Menu | ControlKind::IntegerMenu, value) => item(control, value).map(Encoded::Number),
        (ControlKind::Bitmask, ControlValue::Number(bits)) => {
            let bits = u32::try_from(*bits).map_err(|_| ControlProblem::Range)?;
            let is_within = i64::from(bits) & !control.greatest == 0;
            // The call carries the same bits as a signed number.
            if is_within { Ok(Encoded::Number(bits.cast_signed().into())) } else { Err(ControlProblem::Range) }
        }
        (ControlKind::Button, ControlValue::Switch(is_pressed)) => {
            Ok(if *is_pressed { Encoded::Number(1) } else { Encoded::Nothing })
        }
        (ControlKind::Text, ControlValue::Text(text)) => {
            stepped(control, i64::try_from(text.len()).unwrap_or(i64::MAX))?;
            CString::new(text.as_str()).map(Encoded::Text).map_err(|_| ControlProblem::Type)
        }
        _ => Err(ControlProblem::Type),
    }
}

/// A number within its bounds and on a step; drivers move one between two steps without a word.
fn stepped(control: &Control, number: i64) -> Result<Encoded, ControlProblem> {
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

/// Number of an item of a menu, by its number or its name.
fn item(control: &Control, value: &ControlValue) -> Result<i64, ControlProblem> {
    let is_meant = |item: &&crate::device::controls::MenuItem| match value {
        ControlValue::Number(number) => item.number == *number,
        ControlValue::Text(name) => item.name == *name,
        ControlValue::Switch(_) => false,
    };
    control.items.iter().find(is_meant).map(|item| item.number).ok_or(ControlProblem::Range)
}

/// What a control is, if that is what was set.
fn compare(device: &Device, setting: &Setting<'_>) -> Result<String, ControlProblem> {
    let control = setting.control;
    let Some(found) = control.read(device).map_err(ControlProblem::Call)? else {
        return Ok(setting.value.to_string());
    };
    let shown = control.shown(&found);
    if !control.keeps_its_value() || is_same(control, setting.value, &found) {
        return Ok(shown);
    }
    Err(ControlProblem::Changed { found: shown })
}

fn is_same(control: &Control, wanted: &ControlValue, found: &ControlValue) -> bool {
    let number = |value: &ControlValue| match value {
        ControlValue::Switch(is_on) => Some(i64::from(*is_on)),
        value if !control.items.is_empty() => item(control, value).ok(),
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

    fn number(control: &Control, value: i64) -> Result<Encoded, String> {
        encode(control, &ControlValue::Number(value)).map_err(|problem| problem.to_string())
    }

    #[test]
    fn numbers_keep_to_bounds_and_steps() {
        let gain = control(ControlKind::Integer, 4, 100, 10);
        assert_eq!(number(&gain, 14), Ok(Encoded::Number(14)));
        assert_eq!(number(&gain, 94), Ok(Encoded::Number(94)));
        assert!(number(&gain, 3).is_err() && number(&gain, 101).is_err());
        assert_eq!(number(&gain, 18).unwrap_err(), "the control has steps; the nearest value is 14");
        assert_eq!(number(&gain, 20).unwrap_err(), "the control has steps; the nearest value is 24");
        // The step above would be out of bounds.
        assert_eq!(number(&gain, 100).unwrap_err(), "the control has steps; the nearest value is 94");
    }

    #[test]
    fn absurd_bounds_are_no_panic() {
        let full = |step| control(ControlKind::Integer64, i64::MIN, i64::MAX, step);
        assert_eq!(number(&full(0), i64::MAX), Ok(Encoded::Number(i64::MAX)));
        assert!(number(&full(u64::MAX), 5).is_err() && number(&full(1 << 63), i64::MAX).is_err());
        assert!(number(&control(ControlKind::Integer, 5, -5, 1), 0).is_err());
    }

    #[test]
    fn items_of_menus_go_by_number_and_name() {
        let text = |name: &str| encode(&menu(), &ControlValue::Text(name.into()));
        assert_eq!(text("Aperture Priority").unwrap(), Encoded::Number(3));
        assert_eq!(number(&menu(), 1), Ok(Encoded::Number(1)));
        // A gap of the menu, and another spelling.
        assert!(number(&menu(), 2).is_err() && text("manual mode").is_err());
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
        assert_eq!(number(&bits, 0x8000_0000), Ok(Encoded::Number(i64::from(i32::MIN))));
        assert!(number(&bits, 2).is_err() && number(&bits, -1).is_err());
        let text = |value: &str| encode(&control(ControlKind::Text, 2, 4, 2), &ControlValue::Text(value.into()));
        assert_eq!(text("ab").unwrap(), Encoded::Text(c"ab".into()));
        assert!(text("abc").is_err() && text("abcdef").is_err() && text("a\0").is_err());
    }

    #[test]
    fn what_holds_a_control_is_told() {
        let flagged = |flags| number(&Control { flags, ..control(ControlKind::Integer, 0, 9, 1) }, 5).unwrap_err();
        assert!(flagged(V4L2_CTRL_FLAG_READ_ONLY).contains("read-only"));
        assert!(flagged(V4L2_CTRL_FLAG_INACTIVE).contains("another control holds it"));
        assert!(flagged(V4L2_CTRL_FLAG_GRABBED).contains("in use"));
    }

    #[test]
    fn errors_name_bounds_items_and_names_that_are_like_it() {
        let value = ControlValue::Number(300);
        let gain = control(ControlKind::Integer, 0, 255, 1);
        let error = Setting { control: &gain, value: &value }.error(ControlProblem::Range).to_string();
        assert_eq!(error, "control gain = 300: the control cannot be set (it takes a number from 0 to 255, default 0)");
        let menu = menu();
        let error = Setting { control: &menu, value: &value }.error(ControlProblem::Range).to_string();
        assert!(error.ends_with("(it takes one of 1 \"Manual Mode\", 3 \"Aperture Priority\", default 0)"), "{error}");
        let settings = BTreeMap::from([("gane".to_owned(), value)]);
        let controls = [gain];
        let (found, unknown) = named(&controls, &settings);
        assert!(found.is_empty());
        assert_eq!(unknown[0].to_string(), "control gane = 300: the device has no such control (it has gain)");
    }

    #[test]
    fn menus_and_switches_go_first() {
        let named_as = |name: &str, kind| Control { name: name.into(), ..control(kind, 0, 9, 1) };
        let controls = [named_as("a", ControlKind::Integer), named_as("z", ControlKind::Boolean)];
        let settings = ["a", "z"].map(|name| (name.to_owned(), ControlValue::Number(1))).into();
        let (ordered, _) = named(&controls, &settings);
        let names: Vec<&str> = ordered.iter().map(|setting| setting.control.name.as_str()).collect();
        assert_eq!(names, ["z", "a"]);
    }
}
