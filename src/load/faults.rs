//! What is wrong with a file, and where.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::HashSet;
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
    unknown: RefCell<HashSet<Span>>,
}

/// Most faults of a file that are told: whoever sees more has another kind of file, and telling takes time and memory.
pub(crate) const MOST_FAULTS: usize = 1000;
/// Most names that a message lists.
const MOST_NAMES: usize = 100;

impl Faults {
    /// A fault at a place of the file.
    pub fn at(&self, span: &Span, message: impl Into<String>) {
        if !self.is_full() && !self.unknown.borrow().contains(span) {
            self.found.borrow_mut().push((Some(span.clone()), message.into()));
        }
    }

    /// A fault that leaves a place without a value.
    pub fn without_value(&self, span: &Span, message: impl Into<String>) {
        self.at(span, message);
        self.unknown.borrow_mut().insert(span.clone());
    }

    /// Whether as many faults are found as are told, so that messages of more need not be made.
    pub fn is_full(&self) -> bool {
        self.found.borrow().len() >= MOST_FAULTS
    }

    /// A fault of the file as a whole.
    pub fn general(&self, message: impl Into<String>) {
        self.found.borrow_mut().push((None, message.into()));
    }

    /// A name that is not among those known, as in `unknown bsdf "glas"; known: diffuse`.
    pub fn unknown(&self, span: &Span, what: &str, name: &str, known: &[&str]) {
        if !self.is_full() {
            let name = shortened(name);
            self.at(span, format!("unknown {what} {name:?}{}; {}", did_you_mean(&name, known), list(known)));
        }
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
    /// Faults at these places of the text, best in its order, or of the file as a whole.
    pub(crate) fn of_places(path: &Path, text: String, found: Vec<(Option<Span>, String)>) -> LoadError {
        let is_full = found.len() >= MOST_FAULTS;
        let mut places = Places::of(&text);
        let fault = |(span, message): (Option<Span>, String)| {
            let position = span.as_ref().map(|s| places.position(s.start));
            Fault { message, position, span }
        };
        let mut faults: Vec<_> = found.into_iter().take(MOST_FAULTS).map(fault).collect();
        if is_full {
            let message = format!("has at least these {MOST_FAULTS} faults; there may be more");
            faults.push(Fault { message, position: None, span: None });
        }
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

/// Lines and columns of a text, quickly where they are asked for in its order.
pub(crate) struct Places<'a> {
    text: &'a str,
    /// A byte whose line and column are known.
    byte: usize,
    known: (usize, usize),
}

impl<'a> Places<'a> {
    /// Of a text.
    pub fn of(text: &'a str) -> Places<'a> {
        Places { text, byte: 0, known: (1, 1) }
    }

    /// Line and column, from 1, of a byte.
    pub fn position(&mut self, byte: usize) -> (usize, usize) {
        if byte < self.byte {
            (self.byte, self.known) = (0, (1, 1));
        }
        let between = self.text.get(self.byte..byte).expect("spans begin between characters");
        let (line, column) = self.known;
        self.byte = byte;
        self.known = match between.rfind('\n') {
            None => (line, column + between.chars().count()),
            Some(newline) => (line + between.matches('\n').count(), between[newline + 1..].chars().count() + 1),
        };
        self.known
    }
}

/// `known: a, b, c`, sorted.
pub(crate) fn list(known: &[&str]) -> String {
    if known.is_empty() {
        return "none is known here".into();
    }
    let mut known = known.to_vec();
    let more = known.len().saturating_sub(MOST_NAMES);
    if more > 0 {
        known.select_nth_unstable(MOST_NAMES); // the first are all that need be in order
        known.truncate(MOST_NAMES);
    }
    known.sort_unstable();
    let names: Vec<_> = known.into_iter().map(shortened).collect();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("known: {}{more}", names.join(", "))
}

/// A name as it stands in messages: cut where it is longer than a line.
pub(crate) fn shortened(name: &str) -> Cow<'_, str> {
    match name.char_indices().nth(80) {
        None => name.into(),
        Some((end, _)) => format!("{}…", &name[..end]).into(),
    }
}

/// ` (did you mean "glass"?)` where a known name is near, or nothing.
pub(crate) fn did_you_mean(name: &str, known: &[&str]) -> String {
    let length = name.chars().take(MOST_LETTERS).count();
    // as many letters as lengths differ by are wrong at least, and a third of them is no slip of the finger any more
    let may_be_near = |k: &&&str| 3 * k.chars().take(MOST_LETTERS).count().abs_diff(length) <= k.len();
    let near = known.iter().filter(may_be_near).take(MOST_COMPARED).map(|k| (edits(name, k), k)).min();
    match near {
        Some((edits, near)) if edits > 0 && 3 * edits <= near.len() => format!(" (did you mean {near:?}?)"),
        _ => String::new(),
    }
}

/// Names of about the same length that are compared.
const MOST_COMPARED: usize = 1000;
/// Letters of a name that are looked at.
const MOST_LETTERS: usize = 64;

/// Number of letters to insert, delete, replace or swap with their neighbour to get from one name to the other.
///
/// Source: Damerau 1964 (optimal string alignment), on ASCII case folded letters.
fn edits(a: &str, b: &str) -> usize {
    let fold = |s: &str| s.chars().take(MOST_LETTERS).map(|c| c.to_ascii_lowercase()).collect::<Vec<_>>();
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
        let text = "ab\nçd\n\ne";
        let expected = [(0, (1, 1)), (1, (1, 2)), (3, (2, 1)), (5, (2, 2)), (7, (3, 1)), (8, (4, 1))];
        let mut places = Places::of(text);
        for (byte, position) in expected.into_iter().chain(expected) {
            assert_eq!(places.position(byte), position, "{byte}, in order and back again");
        }
    }
}
