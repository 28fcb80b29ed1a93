//! Options with a fixed list of values. The help and the error about any other value show the list.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use fringeflow::calibration::Unit;

/// Parses one of `all` by its name.
pub(crate) fn one_of<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.iter().map(|&value| name(value))).try_map(move |text| {
        let named = all.iter().copied().find(|&value| name(value) == text);
        named.ok_or_else(|| format!("{text:?} is not one of them"))
    })
}

/// Parses a unit of length.
pub(crate) fn unit() -> impl TypedValueParser<Value = Unit> {
    one_of(&[Unit::Millimetre, Unit::Metre], Unit::symbol)
}

/// Parses width and height written as `WxH`.
pub(crate) fn parse_size(text: &str) -> Result<[usize; 2], String> {
    let wrong = || format!("{text:?} is not a size; write width and height as in 640x512");
    let (width, height) = text.split_once('x').ok_or_else(wrong)?;
    Ok([width.parse().map_err(|_| wrong())?, height.parse().map_err(|_| wrong())?])
}
