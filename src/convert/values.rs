//! Text to numbers, for both formats.

/// A number that is finite in single precision, which is what renderers keep.
pub(super) fn number(text: &str) -> Result<f64, String> {
    let text = text.trim();
    match text.parse::<f64>() {
        Ok(value) if (value as f32).is_finite() => Ok(value),
        Ok(_) => Err(format!("{text:?} is not finite (in single precision)")),
        Err(_) => Err(format!("{text:?} is not a number")),
    }
}

/// Numbers separated by blanks or commas.
pub(super) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty()).map(number).collect()
}

/// As many numbers as are asked for.
pub(super) fn exactly<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers = numbers(text)?;
    let count = numbers.len();
    numbers.try_into().map_err(|_| format!("{text:?} holds {count} numbers; expected {N}"))
}
