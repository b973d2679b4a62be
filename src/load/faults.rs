//! What is wrong with a file, and where.

use std::cell::RefCell;
use std::fmt;
use std::ops::Range;
use std::path::Path;

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};

/// A range of bytes of the file's text.
pub(crate) type Span = Range<usize>;

/// One thing that is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What is wrong and what would be accepted.
    pub message: String,
    /// Line and column, both from 1, columns in characters; `None` where the fault has no place in the file.
    pub position: Option<(usize, usize)>,
    span: Option<Span>,
}

/// All that is wrong with a file.
///
/// Its text has one line a fault, `path:line:column: message`. As a [`miette::Diagnostic`] it also shows the places.
#[derive(Clone, Debug)]
pub struct LoadError(Box<Contents>);

/// What a [`LoadError`] holds, boxed to keep `Result`s small.
#[derive(Clone, Debug)]
struct Contents {
    path: String,
    text: NamedSource<String>,
    faults: Vec<Fault>,
}

/// Collects faults while a file is read.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    found: RefCell<Vec<(Option<Span>, String)>>,
    /// Places whose value is not known, so that what else is wrong there only follows from that.
    unknown: RefCell<Vec<Span>>,
}

impl Faults {
    /// A fault at a place of the file.
    pub fn at(&self, span: &Span, message: impl Into<String>) {
        if !self.unknown.borrow().contains(span) {
            self.found.borrow_mut().push((Some(span.clone()), message.into()));
        }
    }

    /// A fault that leaves a place without a value.
    pub fn without_value(&self, span: &Span, message: impl Into<String>) {
        self.at(span, message);
        self.unknown.borrow_mut().push(span.clone());
    }

    /// A fault of the file as a whole.
    pub fn general(&self, message: impl Into<String>) {
        self.found.borrow_mut().push((None, message.into()));
    }

    /// A name that is not among those known, as in `unknown bsdf "glas"; known: diffuse`.
    pub fn unknown(&self, span: &Span, what: &str, name: &str, known: &[&str]) {
        self.at(span, format!("unknown {what} {name:?}{}; {}", did_you_mean(name, known), list(known)));
    }

    /// `Ok` with the value that was read if nothing was wrong.
    pub fn settle<T>(self, path: &Path, text: String, value: Option<T>) -> Result<T, LoadError> {
        let mut found = self.found.into_inner();
        if let (Some(value), true) = (value, found.is_empty()) {
            return Ok(value);
        }
        assert!(!found.is_empty(), "reading {} gave neither a scene nor a fault", path.display());
        found.sort_by_key(|(span, _)| span.as_ref().map(|s| s.start));
        found.dedup();
        Err(LoadError::of_places(path, text, found))
    }
}

impl LoadError {
    /// Faults at these places of the text, or of the file as a whole.
    pub(crate) fn of_places(path: &Path, text: String, found: Vec<(Option<Span>, String)>) -> LoadError {
        let faults = found
            .into_iter()
            .map(|(span, message)| {
                let position = span.as_ref().map(|s| position(&text, s.start));
                Fault { message, position, span }
            })
            .collect();
        LoadError::new(path, text, faults)
    }

    /// A fault of a file that was not read.
    pub(crate) fn of_file(path: &Path, message: String) -> LoadError {
        LoadError::new(path, String::new(), vec![Fault { message, position: None, span: None }])
    }

    fn new(path: &Path, text: String, faults: Vec<Fault>) -> LoadError {
        let path = path.display().to_string();
        LoadError(Box::new(Contents { text: NamedSource::new(&path, text), path, faults }))
    }

    /// What is wrong, in the order of the file.
    pub fn faults(&self) -> &[Fault] {
        &self.0.faults
    }
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, fault) in self.0.faults.iter().enumerate() {
            let newline = if i == 0 { "" } else { "\n" };
            write!(f, "{newline}{}:", self.0.path)?;
            if let Some((line, column)) = fault.position {
                write!(f, "{line}:{column}:")?;
            }
            write!(f, " {}", fault.message)?;
        }
        Ok(())
    }
}

impl std::error::Error for LoadError {}

impl Diagnostic for LoadError {
    fn source_code(&self) -> Option<&dyn SourceCode> {
        // Without a place there is nothing to show, and miette would complain of a missing one.
        self.0.faults.iter().any(|f| f.span.is_some()).then_some(&self.0.text as &dyn SourceCode)
    }

    /// Underlines only: the messages are in the text above them already.
    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let spans = self.0.faults.iter().filter_map(|fault| fault.span.clone());
        Some(Box::new(spans.map(|span| LabeledSpan::new(None, span.start, span.len()))))
    }
}

/// Line and column, from 1, of a byte of the text.
pub(crate) fn position(text: &str, byte: usize) -> (usize, usize) {
    let before = text.get(..byte).expect("spans begin between characters");
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

/// `known: a, b, c`, sorted.
pub(crate) fn list(known: &[&str]) -> String {
    let mut known = known.to_vec();
    known.sort_unstable();
    if known.is_empty() { "none is known here".into() } else { format!("known: {}", known.join(", ")) }
}

/// ` (did you mean "glass"?)` where a known name is near, or nothing.
pub(crate) fn did_you_mean(name: &str, known: &[&str]) -> String {
    let near = known.iter().map(|k| (edits(name, k), k)).min();
    match near {
        // A third of the letters wrong is no longer a slip of the finger.
        Some((edits, near)) if edits > 0 && 3 * edits <= near.len() => format!(" (did you mean {near:?}?)"),
        _ => String::new(),
    }
}

/// Number of letters to insert, delete, replace or swap with their neighbour to get from one name to the other.
///
/// Source: Damerau 1964 (optimal string alignment), on ASCII case folded letters.
fn edits(a: &str, b: &str) -> usize {
    let fold = |s: &str| s.chars().take(64).map(|c| c.to_ascii_lowercase()).collect::<Vec<_>>();
    let (a, b) = (fold(a), fold(b));
    let mut d = vec![vec![0; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            d[i][j] = match (i, j) {
                (0, _) | (_, 0) => i + j,
                _ => {
                    let replace = d[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                    let plain = replace.min(d[i - 1][j] + 1).min(d[i][j - 1] + 1);
                    let swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
                    if swapped { plain.min(d[i - 2][j - 2] + 1) } else { plain }
                }
            };
        }
    }
    d[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_count_slips_of_the_finger() {
        for (a, b, expected) in [("", "", 0), ("fov", "fov", 0), ("fvo", "fov", 1), ("difuse", "diffuse", 1)] {
            assert_eq!(edits(a, b), expected, "{a} {b}");
        }
    }

    #[test]
    fn only_near_names_are_suggested() {
        assert_eq!(did_you_mean("difuse", &["conductor", "diffuse"]), " (did you mean \"diffuse\"?)");
        assert_eq!(did_you_mean("glas", &["conductor", "diffuse"]), "");
    }

    #[test]
    fn columns_count_characters_and_lines_start_at_one() {
        assert_eq!(position("ab\nçd", 0), (1, 1));
        assert_eq!(position("ab\nçd", 5), (2, 2));
    }
}
