//! Values of options: from words to types.

use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::path::MappingKind;
use crate::render::{Combine, LadderChoice, MappingChoice, Measure, Method, Normalisation, PacketChoice};

/// `name=value`.
pub(super) fn define(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err("write it as name=value".into()),
    }
}

/// A time with its unit.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    if text.parse::<f64>().is_ok() {
        return Err(format!("the unit is missing; {text}s for seconds, {text}m for minutes"));
    }
    humantime::parse_duration(text).map_err(|error| format!("{error}; times look like 500ms, 60s, 5m or 1h 30m"))
}

/// A time with its unit, above 0.
pub(super) fn interval(text: &str) -> Result<Duration, String> {
    match duration(text)? {
        Duration::ZERO => Err("it must be above 0".into()),
        time => Ok(time),
    }
}

pub(super) fn method() -> impl TypedValueParser<Value = Method> {
    one_of(&Method::ALL, |method| method.name())
}

pub(super) fn mapping() -> impl TypedValueParser<Value = MappingChoice> {
    one_of(&MappingChoice::ALL, |mapping| mapping.name())
}

/// A mapping that is not left to a trial.
pub(super) fn one_mapping() -> impl TypedValueParser<Value = MappingKind> {
    one_of(&MappingKind::ALL, |mapping| mapping.name())
}

pub(super) fn replicas(text: &str) -> Result<LadderChoice, String> {
    match text {
        "auto" => Ok(LadderChoice::Auto),
        _ => {
            text.parse().map(LadderChoice::Replicas).map_err(|_| "accepted are auto and numbers from 1 to 1024".into())
        }
    }
}

pub(super) fn measure() -> impl TypedValueParser<Value = Measure> {
    one_of(&Measure::ALL, |measure| measure.name())
}

pub(super) fn combine() -> impl TypedValueParser<Value = Combine> {
    one_of(&Combine::ALL, |combine| combine.name())
}

pub(super) fn normalisation() -> impl TypedValueParser<Value = Normalisation> {
    one_of(&Normalisation::ALL, |normalisation| normalisation.name())
}

/// Off or on.
pub(super) fn switch() -> impl TypedValueParser<Value = bool> {
    one_of(&[false, true], |on| if *on { "on" } else { "off" })
}

pub(super) fn packet() -> impl TypedValueParser<Value = PacketChoice> {
    one_of(&PacketChoice::ALL, |packet| packet.name())
}

/// Exactly the names of `all`, which help and messages list.
fn one_of<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(&T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.iter().map(name))
        .map(move |text| *all.iter().find(|value| name(value) == text).expect("the parser lets only names pass"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definitions_have_a_name_and_may_hold_equals_signs() {
        assert_eq!(define("res=64"), Ok(("res".into(), "64".into())));
        assert_eq!(define("a=b=c"), Ok(("a".into(), "b=c".into())));
        assert_eq!(define("a="), Ok(("a".into(), String::new())));
        assert!(define("res").is_err() && define("=64").is_err());
    }

    #[test]
    fn times_have_units() {
        assert_eq!(duration("60s"), Ok(Duration::from_secs(60)));
        assert_eq!(duration("1h 30m"), Ok(Duration::from_secs(5400)));
        assert_eq!(duration("250ms"), Ok(Duration::from_millis(250)));
        assert!(duration("60").unwrap_err().contains("60s"));
        for wrong in ["", "soon", "-5s", "5 parsecs", "NaN", "99999999999999999999h"] {
            assert!(duration(wrong).is_err(), "{wrong:?}");
        }
        assert!(interval("0s").is_err());
    }
}
