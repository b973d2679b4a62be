//! From values in a TOML file to words of a command line: what files of studies and of batches have in common.

use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::Value;

/// Options whose value is itself a list: a list of lists varies them.
const LISTS: [&str; 1] = ["betas"];

/// An option with one of its values.
#[derive(Clone, Debug)]
pub(crate) struct Choice {
    /// Of the option.
    pub name: String,
    /// One of its values.
    pub value: Value,
    /// It is one of several.
    pub varied: bool,
}

impl Choice {
    /// As on a command line.
    pub fn words(&self) -> Vec<String> {
        match &self.value {
            Value::Boolean(true) => vec![format!("--{}", self.name)],
            Value::Boolean(false) => Vec::new(),
            value => vec![format!("--{}", self.name), word(value).unwrap_or_default()],
        }
    }
}

/// The values that an option is to take; `None` where they are of no use on a command line.
pub(crate) fn values(name: &str, value: &Value) -> Option<Vec<Value>> {
    let is_value = |value: &Value| match value {
        Value::Array(list) => LISTS.contains(&name) && list.iter().all(|item| !item.is_array() && word(item).is_some()),
        value => word(value).is_some(),
    };
    match value {
        value if is_value(value) => Some(vec![value.clone()]),
        Value::Array(list) if !list.is_empty() && list.iter().all(is_value) => Some(list.clone()),
        _ => None,
    }
}

/// All combinations, the last option varying fastest.
pub(crate) fn grid(axes: &[(String, Vec<Value>)]) -> Vec<Vec<Choice>> {
    axes.iter().fold(vec![Vec::new()], |combinations, (name, values)| {
        let with = |combination: &Vec<Choice>, value: &Value| {
            let choice = Choice { name: name.clone(), value: value.clone(), varied: values.len() > 1 };
            combination.iter().cloned().chain([choice]).collect()
        };
        combinations.iter().flat_map(|combination| values.iter().map(move |value| with(combination, value))).collect()
    })
}

/// A value as it stands on a command line; lists have commas between.
pub(crate) fn word(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(number) => Some(number.to_string()),
        Value::Float(number) => Some(number.to_string()),
        Value::Boolean(flag) => Some(flag.to_string()),
        Value::Array(list) => list.iter().map(word).collect::<Option<Vec<_>>>().map(|words| words.join(",")),
        _ => None,
    }
}

/// `file:line:column` of the start of a span.
pub(crate) fn place(path: &Path, text: &str, span: Range<usize>) -> String {
    let before = &text[..span.start.min(text.len())];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    format!("{}:{line}:{column}", path.display())
}

/// The path without `name/..`, to be read by people.
pub(crate) fn tidy(path: &Path) -> PathBuf {
    use std::path::Component;
    let mut tidied = PathBuf::new();
    for component in path.components() {
        match (component, tidied.components().next_back()) {
            (Component::ParentDir, Some(Component::Normal(name))) if !tidied.join(name).is_symlink() => {
                tidied.pop();
            }
            (Component::CurDir, _) => {}
            _ => tidied.push(component),
        }
    }
    tidied
}
