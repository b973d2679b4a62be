//! Attribute text to numbers.

use glam::DVec3;

use super::document::Element;
use crate::load::faults::Faults;
use crate::scene::Rgb;

/// A finite number.
pub fn number(text: &str) -> Result<f64, String> {
    let text = text.trim();
    match text.parse::<f64>() {
        Ok(value) if (value as f32).is_finite() => Ok(value),
        Ok(_) => Err(format!("{text:?} is not finite (in single precision)")),
        Err(_) => Err(format!("{text:?} is not a number")),
    }
}

/// Finite numbers, separated by blanks or commas.
pub fn numbers(text: &str) -> Result<Vec<f64>, String> {
    text.split([',', ' ', '\t', '\r', '\n']).filter(|part| !part.is_empty()).map(number).collect()
}

/// Three numbers.
pub fn vector(text: &str) -> Result<DVec3, String> {
    match numbers(text)?[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        ref given => Err(format!("{text:?} holds {} numbers; expected 3", given.len())),
    }
}

/// A single-precision number.
pub fn float(text: &str) -> Result<f32, String> {
    number(text).map(|value| value as f32)
}

/// A whole number.
pub fn integer(text: &str) -> Result<i64, String> {
    text.trim().parse().map_err(|_| format!("{text:?} is not a whole number"))
}

/// `true` or `false`, in any case, as Mitsuba reads it.
pub fn boolean(text: &str) -> Result<bool, String> {
    match text.trim().to_lowercase().as_str() {
        "true" => Ok(true),
        "false" => Ok(false),
        _ => Err(format!("{text:?} is not a truth value; accepted: true, false")),
    }
}

/// One number for a grey or three for red, green and blue, all linear.
pub fn rgb(text: &str) -> Result<Rgb, String> {
    if text.trim_start().starts_with('#') {
        return Err(format!("{text:?} is not a colour that Mitsuba 3 reads; expected 1 or 3 linear numbers"));
    }
    match numbers(text)?[..] {
        [grey] => Ok(Rgb::splat(grey as f32)),
        [r, g, b] => Ok(Rgb::new(r as f32, g as f32, b as f32)),
        ref given => Err(format!("{text:?} holds {} numbers; expected 1 or 3", given.len())),
    }
}

/// The vector in an element's attributes: `value` with three numbers, or `x`, `y` and `z`.
///
/// With `absent`, axes may be left out and have that value, and `value` may be one number for all of them.
pub fn xyz(element: &Element, absent: Option<f64>, faults: &Faults) -> Option<DVec3> {
    let is_by_axis = ["x", "y", "z"].iter().any(|axis| element.attribute(axis).is_some());
    let Some(value) = element.attribute("value") else {
        let [x, y, z] = ["x", "y", "z"].map(|axis| axis_value(element, axis, absent, faults));
        return Some(DVec3::new(x?, y?, z?));
    };
    if is_by_axis {
        faults.at(&element.span, format!("<{}> has both value and x, y, z; one of them is accepted", element.tag));
        return None;
    }
    let single = if absent.is_some() { number(&value.value).ok() } else { None };
    match single.map(|s| Ok(DVec3::splat(s))).unwrap_or_else(|| vector(&value.value)) {
        Ok(vector) => Some(vector),
        Err(message) => {
            faults.at(&value.span, message);
            None
        }
    }
}

/// One axis of [`xyz`].
fn axis_value(element: &Element, axis: &str, absent: Option<f64>, faults: &Faults) -> Option<f64> {
    let Some(attribute) = element.attribute(axis) else {
        if absent.is_none() {
            faults.at(&element.span, format!("<{}> needs the attribute {axis}", element.tag));
        }
        return absent;
    };
    number(&attribute.value).map_err(|message| faults.at(&attribute.span, message)).ok()
}
