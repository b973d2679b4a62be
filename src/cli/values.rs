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

/// Which part of a job is meant, and what says so where that is not the command line itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Part {
    pub parts: Parts,
    /// `SLURM_ARRAY_TASK_ID 3`.
    pub by: Option<String>,
}

/// `3/8`, or the task of an engine's array that this process is: `slurm`, `slurm/8`, `hq/8`, or `auto/8` for whichever.
pub(super) fn part(text: &str) -> Result<Part, String> {
    part_of(text, &|name| std::env::var(name).ok())
}

/// As [`part`], in that environment.
fn part_of(text: &str, variable: &dyn Fn(&str) -> Option<String>) -> Result<Part, String> {
    const HOW: &str = "write it as 3/8, for part 3 of 8, or slurm, slurm/8, hq/8 or auto/8 for the task of an array";
    let (which, of) = text.split_once('/').map_or((text, None), |(which, of)| (which, Some(of)));
    let of: Option<u32> = of.map(|of| of.parse().map_err(|_| HOW)).transpose()?;
    let is_set = |name: &str| variable(name).is_some();
    let engine = match which {
        "auto" => match [SLURM_TASK, HYPERQUEUE_TASK].map(is_set) {
            [true, false] => "slurm",
            [false, true] => "hq",
            [true, true] => {
                return Err(format!(
                    "both {SLURM_TASK} and {HYPERQUEUE_TASK} are set: say slurm or hq instead of auto"
                ));
            }
            [false, false] => {
                return Err(format!("neither {SLURM_TASK} nor {HYPERQUEUE_TASK} is set: this is no task of an array"));
            }
        },
        other => other,
    };
    let (name, only, of) = match (engine, of) {
        ("slurm", None) => {
            let (only, of) = slurm_task(variable)?;
            (SLURM_TASK, only, of)
        }
        ("slurm", Some(of)) => (SLURM_TASK, number(variable, SLURM_TASK)?, of),
        ("hq", Some(of)) => (HYPERQUEUE_TASK, number(variable, HYPERQUEUE_TASK)?, of),
        ("hq", None) => return Err("tasks of HyperQueue are not told how many there are: write hq/8".into()),
        (only, Some(of)) => {
            let only = only.parse().map_err(|_| HOW)?;
            return Ok(Part { parts: Parts { of, only: Some(only) }, by: None });
        }
        (_, None) => return Err(HOW.into()),
    };
    let task = variable(name).unwrap_or_default();
    Ok(Part { parts: Parts { of, only: Some(only) }, by: Some(format!("{name} {task}")) })
}

/// Number of the task of a SLURM job array (sbatch(1)).
const SLURM_TASK: &str = "SLURM_ARRAY_TASK_ID";
/// Number of the task of a HyperQueue job.
const HYPERQUEUE_TASK: &str = "HQ_TASK_ID";

/// The number that an engine gives this process by that name.
fn number(variable: &dyn Fn(&str) -> Option<String>, name: &str) -> Result<u32, String> {
    let text = variable(name).ok_or_else(|| format!("{name} is not set: this is no task of an array"))?;
    text.parse().map_err(|_| format!("{name} is {text:?}, not a number"))
}

/// Which task of how many this process is: arrays may begin at any number and count in any step.
fn slurm_task(variable: &dyn Fn(&str) -> Option<String>) -> Result<(u32, u32), String> {
    let or = |name: &str, default: u32| variable(name).map_or(Ok(default), |_| number(variable, name));
    let (task, count) = (number(variable, SLURM_TASK)?, number(variable, "SLURM_ARRAY_TASK_COUNT")?);
    let (first, step) = (or("SLURM_ARRAY_TASK_MIN", 1)?, or("SLURM_ARRAY_TASK_STEP", 1)?.max(1));
    let place = task.checked_sub(first).filter(|offset| offset.is_multiple_of(step)).map(|offset| offset / step + 1);
    place.filter(|part| *part <= count).map(|part| (part, count)).ok_or_else(|| {
        format!(
            "task {task} of {count} from {first} in steps of {step}: the array has gaps, so say how many parts there are \
             in all, as slurm/8 (then task 3 is part 3)"
        )
    })
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

    /// What `--part TEXT` comes to in that environment: part, of how many, by what.
    fn told(text: &str, environment: &[(&str, &str)]) -> Result<(u32, u32, Option<String>), String> {
        let variable = |name: &str| environment.iter().find(|(known, _)| *known == name).map(|(_, v)| (*v).to_owned());
        part_of(text, &variable).map(|Part { parts, by }| (parts.only.unwrap(), parts.of, by))
    }

    #[test]
    fn tasks_of_arrays_are_parts_wherever_arrays_begin() {
        let of = |ends: &[(&str, &str)]| {
            let all: Vec<(String, &str)> =
                ends.iter().map(|(end, value)| (format!("SLURM_ARRAY_TASK_{end}"), *value)).collect();
            let all: Vec<(&str, &str)> = all.iter().map(|(name, value)| (name.as_str(), *value)).collect();
            told("slurm", &all)
        };
        let by = |task: u32| Some(format!("SLURM_ARRAY_TASK_ID {task}"));
        assert_eq!(of(&[("ID", "3"), ("COUNT", "8")]), Ok((3, 8, by(3))));
        assert_eq!(of(&[("ID", "0"), ("COUNT", "8"), ("MIN", "0")]), Ok((1, 8, by(0))));
        assert_eq!(of(&[("ID", "14"), ("COUNT", "3"), ("MIN", "10"), ("STEP", "2")]), Ok((3, 3, by(14))));
        assert!(of(&[("ID", "3")]).unwrap_err().contains("SLURM_ARRAY_TASK_COUNT"));
        assert!(of(&[("ID", "x"), ("COUNT", "8")]).unwrap_err().contains("not a number"));
        assert!(of(&[("ID", "3"), ("COUNT", "8"), ("MIN", "2"), ("STEP", "2")]).is_err());
        // tasks 3 and 7 alone: of how many, nothing tells
        assert!(of(&[("ID", "7"), ("COUNT", "2"), ("MIN", "3")]).unwrap_err().contains("slurm/8"));
    }

    #[test]
    fn the_engine_whose_task_it_is_says_the_part() {
        let (slurm, hq) = ((SLURM_TASK, "7"), (HYPERQUEUE_TASK, "5"));
        let both = [slurm, hq];
        assert_eq!(told("slurm/8", &both), Ok((7, 8, Some("SLURM_ARRAY_TASK_ID 7".into()))));
        assert_eq!(told("hq/8", &both), Ok((5, 8, Some("HQ_TASK_ID 5".into()))));
        assert_eq!(told("auto/8", &[slurm]), told("slurm/8", &[slurm]));
        assert_eq!(told("auto/8", &[hq]), told("hq/8", &[hq]));
        assert!(told("auto/8", &both).unwrap_err().contains("say slurm or hq"));
        assert!(told("auto/8", &[]).unwrap_err().contains("no task of an array"));
        assert!(told("hq", &[hq]).unwrap_err().contains("hq/8"));
        assert!(told("hq/8", &[]).unwrap_err().contains("HQ_TASK_ID is not set"));
        assert_eq!(told("3/8", &both), Ok((3, 8, None)), "what is written wins");
        for wrong in ["3", "a/b", "-1/3", "slurm/x", "", "/"] {
            assert!(told(wrong, &both).is_err(), "{wrong:?}");
        }
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
