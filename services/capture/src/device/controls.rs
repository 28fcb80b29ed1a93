//! Controls of a device: what can be set, within which bounds, and how it is set at this moment.

use std::fmt;

use rustix::io::Errno;
use v4l::v4l_sys as sys;

use fringeflow_config::ControlValue;

use crate::ioctl::{CallError, Device, QUERY_EXT_CTRL, QUERYMENU, menu_item, zeroed};

use super::capability::text;

/// Most controls of a device that are read.
const MOST_CONTROLS: usize = 1024;
/// Most items of a menu that are read.
const MOST_ITEMS: u32 = 256;

/// A control.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Control {
    /// V4L2's number of it.
    #[serde(skip)]
    pub id: u32,
    /// Its name as `v4l2-ctl` and the configuration write it.
    pub name: String,
    /// Its name as the driver writes it.
    pub title: String,
    /// What its value is.
    pub kind: ControlKind,
    /// Least value; of a text, its least length in bytes.
    pub least: i64,
    /// Greatest value; of a text, its greatest length in bytes; of bits, all that can be set.
    pub greatest: i64,
    /// From one value to the next; 0 where it does not matter.
    pub step: u64,
    /// Value that the driver begins with.
    pub default: i64,
    /// `V4L2_CTRL_FLAG_…`.
    #[serde(serialize_with = "flag_names")]
    pub flags: u32,
    /// Items of a menu.
    pub items: Vec<MenuItem>,
}

/// An item of a menu.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct MenuItem {
    /// Its number.
    pub number: i64,
    /// Its name.
    pub name: String,
}

/// What the value of a control is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ControlKind {
    /// A number of 32 bits.
    Integer,
    /// A number of 64 bits.
    Integer64,
    /// On or off.
    Boolean,
    /// One of several items with names.
    Menu,
    /// One of several numbers.
    IntegerMenu,
    /// Bits.
    Bitmask,
    /// Nothing: it does something when it is pressed.
    Button,
    /// A text.
    Text,
    /// Something that cannot be written in a configuration.
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

/// All controls of a device that can be written in a configuration.
///
/// # Errors
/// The device is gone.
pub(crate) fn all(device: &Device) -> Result<Vec<Control>, CallError> {
    let next = sys::V4L2_CTRL_FLAG_NEXT_CTRL;
    let mut found: Vec<Control> = Vec::new();
    let mut id = 0;
    while found.len() < MOST_CONTROLS {
        let control = match query(device, id | next) {
            Ok(control) => control,
            // After the last one; or a device without controls.
            Err(error) if matches!(error.errno(), Some(Errno::INVAL | Errno::NOTTY)) => break,
            Err(error) => return Err(error),
        };
        // The next one has a greater number; a driver that says otherwise would never end.
        if control.id <= id {
            break;
        }
        id = control.id;
        found.push(control);
    }
    let is_disabled = |control: &Control| control.has(sys::V4L2_CTRL_FLAG_DISABLED);
    found.retain(|control| control.kind != ControlKind::Compound && !is_disabled(control));
    Ok(found)
}

/// A control as it is at this moment, by its number.
///
/// # Errors
/// There is none of this number, or the device is gone.
pub(crate) fn query(device: &Device, id: u32) -> Result<Control, CallError> {
    let mut answer = sys::v4l2_query_ext_ctrl { id, ..zeroed() };
    device.call(&QUERY_EXT_CTRL, &mut answer)?;
    let title = text(&answer.name.map(|byte| byte as u8));
    let kind = ControlKind::of(&answer);
    Ok(Control {
        id: answer.id,
        name: name_of(&title),
        title,
        kind,
        least: answer.minimum,
        greatest: answer.maximum,
        step: answer.step,
        default: answer.default_value,
        flags: answer.flags,
        items: if kind.is_menu() { items(device, &answer) } else { Vec::new() },
    })
}

fn items(device: &Device, menu: &sys::v4l2_query_ext_ctrl) -> Vec<MenuItem> {
    let first = u32::try_from(menu.minimum).unwrap_or(0);
    let last = u32::try_from(menu.maximum).unwrap_or(0).min(first.saturating_add(MOST_ITEMS));
    let item = |index| {
        let mut item = sys::v4l2_querymenu { id: menu.id, index, ..zeroed() };
        // Menus have gaps.
        device.call(&QUERYMENU, &mut item).ok()?;
        let (name, value) = menu_item(&item);
        let is_number = menu.type_ == sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER_MENU;
        let name = if is_number { value.to_string() } else { text(&name) };
        Some(MenuItem { number: index.into(), name })
    };
    (first..=last).filter_map(item).collect()
}

impl ControlKind {
    fn of(control: &sys::v4l2_query_ext_ctrl) -> Self {
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

    /// Whether setting it may change what others can be.
    pub(crate) fn is_choice(self) -> bool {
        self.is_menu() || self == Self::Boolean
    }
}

impl Control {
    pub(crate) fn has(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }

    /// Whether what is read is what was written.
    pub(crate) fn keeps_its_value(&self) -> bool {
        let forgets = sys::V4L2_CTRL_FLAG_WRITE_ONLY | sys::V4L2_CTRL_FLAG_VOLATILE;
        self.kind != ControlKind::Button && !self.has(forgets)
    }

    /// Its value; `None` where it has none that can be read.
    ///
    /// # Errors
    /// The device refuses to tell.
    pub(crate) fn read(&self, device: &Device) -> Result<Option<ControlValue>, CallError> {
        if self.kind == ControlKind::Button || self.has(sys::V4L2_CTRL_FLAG_WRITE_ONLY) {
            return Ok(None);
        }
        if self.kind == ControlKind::Text {
            let longest = u32::try_from(self.greatest).unwrap_or(0);
            return Ok(Some(ControlValue::Text(device.text(self.id, longest)?)));
        }
        let number = device.number(self.id, self.kind == ControlKind::Integer64)?;
        Ok(Some(match self.kind {
            ControlKind::Boolean => ControlValue::Switch(number != 0),
            // Bits of an unsigned number.
            ControlKind::Bitmask => ControlValue::Number(number & i64::from(u32::MAX)),
            _ => ControlValue::Number(number),
        }))
    }

    /// A value as people read it: that of a menu with the name of its item, bits as such.
    #[must_use]
    pub fn shown(&self, value: &ControlValue) -> String {
        if let (ControlKind::Bitmask, ControlValue::Number(bits)) = (self.kind, value) {
            return format!("0x{bits:x}");
        }
        let item = self.items.iter().find(|item| *value == ControlValue::Number(item.number));
        item.map_or_else(|| value.to_string(), |item| format!("{value} ({})", item.name))
    }
}

impl fmt::Display for Control {
    /// Which values it takes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { least, greatest, step, default, .. } = self;
        match self.kind {
            ControlKind::Integer | ControlKind::Integer64 => {
                write!(f, "a number from {least} to {greatest}{}, default {default}", steps(*step))
            }
            ControlKind::Boolean => write!(f, "true or false, default {}", *default != 0),
            ControlKind::Bitmask => write!(f, "bits out of 0x{greatest:x}, default 0x{default:x}"),
            ControlKind::Button => write!(f, "true presses it"),
            ControlKind::Text => write!(f, "a text of {least} to {greatest} bytes{}", steps(*step)),
            ControlKind::Compound => write!(f, "cannot be set here"),
            ControlKind::Menu | ControlKind::IntegerMenu => {
                let items = self.items.iter().map(|item| format!("{} \"{}\"", item.number, item.name));
                write!(f, "one of {}, default {default}", items.collect::<Vec<_>>().join(", "))
            }
        }
    }
}

fn steps(step: u64) -> String {
    if step > 1 { format!(" in steps of {step}") } else { String::new() }
}

/// Names of the flags that are set.
pub(crate) fn flags(flags: u32) -> Vec<&'static str> {
    FLAGS.into_iter().filter(|(flag, _)| flags & flag != 0).map(|(_, name)| name).collect()
}

fn flag_names<S: serde::Serializer>(value: &u32, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(flags(*value))
}

/// `Exposure Time, Absolute` → `exposure_time_absolute`, as `v4l2-ctl` writes it.
fn name_of(title: &str) -> String {
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
        assert_eq!(names.map(name_of), expected);
    }

    #[test]
    fn arrays_and_unknown_types_are_no_controls_of_a_configuration() {
        let kind = |type_, elems, nr_of_dims| {
            ControlKind::of(&sys::v4l2_query_ext_ctrl { type_, elems, nr_of_dims, ..zeroed() })
        };
        assert_eq!((kind(1, 1, 0), kind(9, 1, 0)), (ControlKind::Integer, ControlKind::IntegerMenu));
        assert_eq!([kind(1, 4, 1), kind(6, 1, 0), kind(0x101, 1, 1), kind(u32::MAX, 0, 0)], [ControlKind::Compound; 4]);
    }
}
