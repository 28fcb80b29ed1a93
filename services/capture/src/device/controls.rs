//! Controls of a device: their types, bounds and current values.

use std::fmt;

use rustix::io::Errno;
use v4l::v4l_sys as sys;

use fringeflow_config::ControlValue;

use crate::ioctl::{CallError, Device, QUERY_EXT_CTRL, QUERYMENU, menu_item, zeroed};

use super::capability::text;

/// Maximum number of controls that are read from a device.
const MAX_CONTROLS: usize = 1024;
/// Maximum number of items that are read from a menu.
const MAX_ITEMS: u32 = 256;

/// A control.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Control {
    /// V4L2 control ID.
    #[serde(skip)]
    pub id: u32,
    /// Name as `v4l2-ctl` and the configuration write it.
    pub name: String,
    /// Name as the driver writes it.
    pub title: String,
    /// Type of its value.
    pub kind: ControlKind,
    /// Least value; for a text, its least length in bytes.
    pub least: i64,
    /// Greatest value; for a text, its greatest length in bytes; for a bit mask, all bits that can be set.
    pub greatest: i64,
    /// Step between values; 0 if steps do not apply.
    pub step: u64,
    /// Initial value of the driver.
    pub default: i64,
    /// `V4L2_CTRL_FLAG_…`.
    #[serde(serialize_with = "serialize_flags")]
    pub flags: u32,
    /// Items of a menu.
    pub items: Vec<MenuItem>,
}

/// A menu item.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct MenuItem {
    /// Its number.
    pub number: i64,
    /// Its name.
    pub name: String,
}

/// Type of the value of a control.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ControlKind {
    /// Integer of 32 bits.
    Integer,
    /// Integer of 64 bits.
    Integer64,
    /// On or off.
    Boolean,
    /// One of several named items.
    Menu,
    /// One of several numbers.
    IntegerMenu,
    /// Bit mask of 32 bits.
    Bitmask,
    /// No value: setting it triggers an action.
    Button,
    /// Text.
    Text,
    /// An array or struct, which a configuration cannot express.
    Compound,
}

/// Flags and their names.
const FLAGS: [(u32, &str); 8] = [
    (sys::V4L2_CTRL_FLAG_GRABBED, "grabbed"),
    (sys::V4L2_CTRL_FLAG_READ_ONLY, "read_only"),
    (sys::V4L2_CTRL_FLAG_INACTIVE, "inactive"),
    (sys::V4L2_CTRL_FLAG_WRITE_ONLY, "write_only"),
    (sys::V4L2_CTRL_FLAG_VOLATILE, "volatile"),
    (sys::V4L2_CTRL_FLAG_EXECUTE_ON_WRITE, "execute_on_write"),
    (sys::V4L2_CTRL_FLAG_MODIFY_LAYOUT, "modify_layout"),
    (sys::V4L2_CTRL_FLAG_UPDATE, "update"),
];

/// Lists the controls of a device that a configuration can express.
///
/// # Errors
/// The device is gone.
pub(crate) fn list_controls(device: &Device) -> Result<Vec<Control>, CallError> {
    let next = sys::V4L2_CTRL_FLAG_NEXT_CTRL;
    let mut found: Vec<Control> = Vec::new();
    let mut id = 0;
    while found.len() < MAX_CONTROLS {
        let control = match query_control(device, id | next) {
            Ok(control) => control,
            // The list has ended, or the device has no controls.
            Err(error) if matches!(error.errno(), Some(Errno::INVAL | Errno::NOTTY)) => break,
            Err(error) => return Err(error),
        };
        // IDs must increase; otherwise a faulty driver could keep this loop running.
        if control.id <= id {
            break;
        }
        id = control.id;
        found.push(control);
    }
    let is_disabled = |control: &Control| control.has_flag(sys::V4L2_CTRL_FLAG_DISABLED);
    found.retain(|control| control.kind != ControlKind::Compound && !is_disabled(control));
    Ok(found)
}

/// Reads the current state of a control.
///
/// # Errors
/// There is no control with this ID, or the device is gone.
pub(crate) fn query_control(device: &Device, id: u32) -> Result<Control, CallError> {
    let mut answer = sys::v4l2_query_ext_ctrl { id, ..zeroed() };
    device.call(&QUERY_EXT_CTRL, &mut answer)?;
    let title = text(&answer.name.map(|byte| byte as u8));
    let kind = ControlKind::from_query(&answer);
    Ok(Control {
        id: answer.id,
        name: control_name(&title),
        title,
        kind,
        least: answer.minimum,
        greatest: answer.maximum,
        step: answer.step,
        default: answer.default_value,
        flags: answer.flags,
        items: if kind.is_menu() { menu_items(device, &answer) } else { Vec::new() },
    })
}

fn menu_items(device: &Device, menu: &sys::v4l2_query_ext_ctrl) -> Vec<MenuItem> {
    let first = u32::try_from(menu.minimum).unwrap_or(0);
    let last = u32::try_from(menu.maximum).unwrap_or(0).min(first.saturating_add(MAX_ITEMS - 1));
    let item = |index| {
        let mut item = sys::v4l2_querymenu { id: menu.id, index, ..zeroed() };
        // A menu may have gaps, where the driver refuses the call.
        device.call(&QUERYMENU, &mut item).ok()?;
        let (name, value) = menu_item(&item);
        let is_number = menu.type_ == sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER_MENU;
        let name = if is_number { value.to_string() } else { text(&name) };
        Some(MenuItem { number: index.into(), name })
    };
    (first..=last).filter_map(item).collect()
}

impl ControlKind {
    fn from_query(control: &sys::v4l2_query_ext_ctrl) -> Self {
        if control.elems > 1 || control.nr_of_dims > 0 {
            return Self::Compound;
        }
        match control.type_ {
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER => Self::Integer,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER64 => Self::Integer64,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BOOLEAN => Self::Boolean,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_MENU => Self::Menu,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER_MENU => Self::IntegerMenu,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BITMASK => Self::Bitmask,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BUTTON => Self::Button,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_STRING => Self::Text,
            _ => Self::Compound,
        }
    }

    fn is_menu(self) -> bool {
        matches!(self, Self::Menu | Self::IntegerMenu)
    }

    /// Whether setting the control may change the bounds and flags of others.
    pub(crate) fn is_choice(self) -> bool {
        self.is_menu() || self == Self::Boolean
    }
}

impl Control {
    pub(crate) fn has_flag(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }

    /// Whether the control reads back the value that was written.
    pub(crate) fn reads_back(&self) -> bool {
        let not_kept = sys::V4L2_CTRL_FLAG_WRITE_ONLY | sys::V4L2_CTRL_FLAG_VOLATILE;
        self.kind != ControlKind::Button && !self.has_flag(not_kept)
    }

    /// Reads the value. Returns `None` if the control has no readable value.
    ///
    /// # Errors
    /// The device refuses the call.
    pub(crate) fn read(&self, device: &Device) -> Result<Option<ControlValue>, CallError> {
        if self.kind == ControlKind::Button || self.has_flag(sys::V4L2_CTRL_FLAG_WRITE_ONLY) {
            return Ok(None);
        }
        if self.kind == ControlKind::Text {
            let max_bytes = u32::try_from(self.greatest).unwrap_or(0);
            return Ok(Some(ControlValue::Text(device.string_control(self.id, max_bytes)?)));
        }
        let number = device.integer_control(self.id, self.kind == ControlKind::Integer64)?;
        Ok(Some(match self.kind {
            ControlKind::Boolean => ControlValue::Switch(number != 0),
            // The call carries the unsigned bits as a signed number.
            ControlKind::Bitmask => ControlValue::Number(number & i64::from(u32::MAX)),
            _ => ControlValue::Number(number),
        }))
    }

    /// Formats a value for people: menu items with their names, bit masks in hexadecimal.
    #[must_use]
    pub fn value_text(&self, value: &ControlValue) -> String {
        if let (ControlKind::Bitmask, ControlValue::Number(bits)) = (self.kind, value) {
            return format!("0x{bits:x}");
        }
        let item = self.items.iter().find(|item| *value == ControlValue::Number(item.number));
        item.map_or_else(|| value.to_string(), |item| format!("{value} ({})", item.name))
    }
}

impl fmt::Display for Control {
    /// Describes the values that the control takes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { least, greatest, step, default, .. } = self;
        match self.kind {
            ControlKind::Integer | ControlKind::Integer64 => {
                write!(f, "a number from {least} to {greatest}{}, default {default}", steps_text(*step))
            }
            ControlKind::Boolean => write!(f, "true or false, default {}", *default != 0),
            ControlKind::Bitmask => write!(f, "a bit mask within 0x{greatest:x}, default 0x{default:x}"),
            ControlKind::Button => write!(f, "true presses the button"),
            ControlKind::Text => write!(f, "a text of {least} to {greatest} bytes{}", steps_text(*step)),
            ControlKind::Compound => write!(f, "cannot be set here"),
            ControlKind::Menu | ControlKind::IntegerMenu => {
                let items = self.items.iter().map(|item| format!("{} \"{}\"", item.number, item.name));
                write!(f, "one of {}, default {default}", items.collect::<Vec<_>>().join(", "))
            }
        }
    }
}

fn steps_text(step: u64) -> String {
    if step > 1 { format!(" in steps of {step}") } else { String::new() }
}

/// Returns the names of the set flags.
pub(crate) fn flag_names(flags: u32) -> Vec<&'static str> {
    FLAGS.into_iter().filter(|(flag, _)| flags & flag != 0).map(|(_, name)| name).collect()
}

fn serialize_flags<S: serde::Serializer>(value: &u32, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(flag_names(*value))
}

/// Converts a name of the driver as `v4l2-ctl` does: `Exposure Time, Absolute` → `exposure_time_absolute`.
fn control_name(title: &str) -> String {
    let words = title.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("_").to_ascii_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_v4l2_ctl() {
        let names = ["Exposure Time, Absolute", "Brightness", " White Balance, Auto & Preset", "Gain (dB)", "ü"];
        let expected = ["exposure_time_absolute", "brightness", "white_balance_auto_preset", "gain_db", ""];
        assert_eq!(names.map(control_name), expected);
    }

    #[test]
    fn arrays_and_unknown_types_are_compound() {
        let kind = |type_, elems, nr_of_dims| {
            ControlKind::from_query(&sys::v4l2_query_ext_ctrl { type_, elems, nr_of_dims, ..zeroed() })
        };
        assert_eq!((kind(1, 1, 0), kind(9, 1, 0)), (ControlKind::Integer, ControlKind::IntegerMenu));
        assert_eq!([kind(1, 4, 1), kind(6, 1, 0), kind(0x101, 1, 1), kind(u32::MAX, 0, 0)], [ControlKind::Compound; 4]);
    }
}
