//! Values of options: from words to types.

use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::path::MappingKind;
use crate::render::{Combine, LadderChoice, MappingChoice, Measure, Method, Normalisation, PacketChoice, Parts};

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

/// `3/8`, or `slurm` for the task of a job array that this process is.
pub(super) fn part(text: &str) -> Result<Parts, String> {
    let (only, of) = match text {
        "slurm" => slurm_task(|name| std::env::var(name).ok())?,
        _ => {
            let numbers = text.split_once('/').and_then(|(part, of)| Some((part.parse().ok()?, of.parse().ok()?)));
            numbers.ok_or("write it as 3/8, for part 3 of 8, or slurm for the task of a job array")?
        }
    };
    Ok(Parts { of, only: Some(only) })
}

/// Which task of how many this process is: arrays may begin at any number and count in any step.
fn slurm_task(variable: impl Fn(&str) -> Option<String>) -> Result<(u32, u32), String> {
    let number = |name: &str| -> Result<u32, String> {
        let text = variable(name).ok_or_else(|| format!("{name} is not set: this is no task of a job array"))?;
        text.parse().map_err(|_| format!("{name} is {text:?}, not a number"))
    };
    let or = |name: &str, default: u32| if variable(name).is_some() { number(name) } else { Ok(default) };
    let (task, count) = (number("SLURM_ARRAY_TASK_ID")?, number("SLURM_ARRAY_TASK_COUNT")?);
    let (first, step) = (or("SLURM_ARRAY_TASK_MIN", 1)?, or("SLURM_ARRAY_TASK_STEP", 1)?.max(1));
    let place = task.checked_sub(first).filter(|offset| offset.is_multiple_of(step)).map(|offset| offset / step + 1);
    place.map(|part| (part, count)).ok_or_else(|| format!("task {task} of an array from {first} in steps of {step}"))
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
    fn tasks_of_arrays_are_parts_wherever_arrays_begin() {
        let of = |variables: &[(&str, &str)]| {
            slurm_task(|name| variables.iter().find(|(known, _)| known[12..] == name[12..]).map(|(_, v)| v.to_string()))
        };
        let [id, count, min, step] = ["ID", "COUNT", "MIN", "STEP"].map(|end| format!("SLURM_ARRAY_TASK_{end}"));
        assert_eq!(of(&[(&id, "3"), (&count, "8")]), Ok((3, 8)));
        assert_eq!(of(&[(&id, "0"), (&count, "8"), (&min, "0")]), Ok((1, 8)));
        assert_eq!(of(&[(&id, "14"), (&count, "3"), (&min, "10"), (&step, "2")]), Ok((3, 3)));
        assert!(of(&[(&id, "3")]).unwrap_err().contains(&count));
        assert!(of(&[(&id, "x"), (&count, "8")]).unwrap_err().contains("not a number"));
        assert!(of(&[(&id, "3"), (&count, "8"), (&min, "2"), (&step, "2")]).is_err());
        assert_eq!(part("3/8"), Ok(Parts { of: 8, only: Some(3) }));
        assert!(part("3").is_err() && part("a/b").is_err() && part("-1/3").is_err());
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
