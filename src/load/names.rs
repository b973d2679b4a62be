//! `$names` in attributes of scene files, and their values.

use std::collections::{BTreeMap, BTreeSet};

use super::faults::{did_you_mean, list};

/// Most bytes that values of `$names` add to a scene: they can hold one another, and so grow without bounds.
pub(crate) const MOST_BYTES: usize = 1 << 24;

/// Values of `$names`, by `-D` and by default.
pub(crate) struct Names<'a> {
    defines: &'a [(String, String)],
    values: BTreeMap<String, String>,
    used: BTreeSet<String>,
    /// Bytes that values may still add.
    left: usize,
}

/// Text with its `$names` replaced.
pub(crate) struct Replaced {
    /// The text.
    pub text: String,
    /// Whether one of them has the value of a `<default>`.
    pub by_default: bool,
}

impl<'a> Names<'a> {
    /// Those that `-D` gives.
    pub fn new(defines: &'a [(String, String)]) -> Names<'a> {
        Names { defines, values: defines.iter().cloned().collect(), used: BTreeSet::new(), left: MOST_BYTES }
    }

    /// A `<default>`: gives the value unless there is one.
    pub fn default(&mut self, name: &str, value: &str) {
        self.values.entry(name.into()).or_insert_with(|| value.into());
    }

    /// The text with every `$name` in it replaced by its value; `fault` is told why one is not.
    pub fn replaced(&mut self, text: &str, mut fault: impl FnMut(String)) -> Replaced {
        let mut parts = text.split('$');
        let mut replaced = Replaced { text: parts.next().unwrap_or_default().to_owned(), by_default: false };
        for part in parts {
            let end = part.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(part.len());
            let (name, rest) = part.split_at(end);
            match self.values.get(name) {
                Some(value) if value.len() <= self.left => {
                    self.left -= value.len();
                    replaced.text.push_str(value);
                    replaced.by_default |= self.defines.iter().all(|(defined, _)| defined != name);
                }
                Some(_) => {
                    fault(format!("${name} is too long: all values together may add {MOST_BYTES} bytes to a scene"));
                }
                None => {
                    let known: Vec<_> = self.values.keys().map(String::as_str).collect();
                    let (near, known) = (did_you_mean(name, &known), list(&known));
                    fault(format!("${name} has no value: no <default> before this, no -D {name}=…{near}; {known}"));
                }
            }
            if !self.used.contains(name) {
                self.used.insert(name.into());
            }
            replaced.text.push_str(rest);
        }
        replaced
    }

    /// What is wrong with each `-D` that nothing refers to: it is a slip.
    pub fn unused(&self) -> Vec<String> {
        let known: Vec<_> = self.used.iter().map(String::as_str).collect();
        let unused = self.defines.iter().filter(|(name, _)| !self.used.contains(name));
        unused
            .map(|(name, value)| {
                format!("-D {name}={value} has no effect: the scene uses no ${name}; {}", list(&known))
            })
            .collect()
    }
}
