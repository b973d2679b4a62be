//! What a conversion has to say: faults of the input, what was left out, and what will look different.

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use crate::load::access::Access;
use crate::load::faults::{MOST_FAULTS, Places, Span};
use crate::load::{self, LoadError, Reach};

/// What a note is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Something that the scene has is not in what was written.
    LeftOut,
    /// Something is there in another form, which may look different.
    Changed,
}

/// A sentence about a place of the input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// What it is about.
    pub kind: Kind,
    /// The file.
    pub path: PathBuf,
    /// Line and column, from 1.
    pub position: (usize, usize),
    /// What, and why.
    pub message: String,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (line, column) = self.position;
        let kind = match self.kind {
            Kind::LeftOut => "left out",
            Kind::Changed => "changed",
        };
        write!(f, "{}:{line}:{column}: {kind}: {}", self.path.display(), self.message)
    }
}

/// A place in one of the files read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place {
    source: usize,
    span: Span,
}

impl Place {
    /// A range of bytes of the file of that number.
    pub fn new(source: usize, span: Span) -> Place {
        Place { source, span }
    }
}

/// A file read.
struct Source {
    path: PathBuf,
    text: Rc<str>,
}

/// Collects what there is to say while files are read.
pub(super) struct Notes {
    /// Which files the scene may have read.
    access: Access,
    /// Bytes of all text so far.
    read: Cell<u64>,
    sources: RefCell<Vec<Source>>,
    faults: RefCell<Vec<(Place, String)>>,
    /// Each thing once, in the order of the files.
    notes: RefCell<BTreeSet<(usize, usize, Kind, String)>>,
}

/// Most files of a scene that are text, counted as often as they are included: files that include others several times
/// over grow without bounds.
const MOST_SOURCES: usize = 1 << 14;

impl Notes {
    /// Of a scene file whose names may lead so far.
    pub fn new(path: &Path, reach: Reach) -> Notes {
        Notes {
            access: Access::new(path.parent().unwrap_or(Path::new("")), reach),
            read: Cell::default(),
            sources: RefCell::default(),
            faults: RefCell::default(),
            notes: RefCell::default(),
        }
    }

    /// The path of a file that is named in a folder, or in a sentence why it is not read; `is_plain` tells whether the name
    /// stands in the scene as it is.
    pub fn file(&self, folder: &Path, name: &str, is_plain: bool) -> Result<PathBuf, String> {
        self.access.file(folder, name, is_plain)
    }

    /// Reads a file; gives its number and its text.
    pub fn read(&self, path: &Path) -> Result<(usize, Rc<str>), String> {
        let in_file = |reason: String| format!("{}: {reason}", path.display());
        if self.sources.borrow().len() >= MOST_SOURCES {
            return Err(in_file(format!(
                "the scene includes more than {MOST_SOURCES} files, each counted as often as it is"
            )));
        }
        let text = load::text_of(path).map_err(in_file)?;
        if self.read.get() + text.len() as u64 > load::MOST_TEXT {
            return Err(in_file(format!("with it, the scene's text is longer than {} bytes", load::MOST_TEXT)));
        }
        Ok(self.add(path, text.into()))
    }

    /// Adds a file that has been read.
    pub fn add(&self, path: &Path, text: Rc<str>) -> (usize, Rc<str>) {
        let mut sources = self.sources.borrow_mut();
        self.read.set(self.read.get() + text.len() as u64);
        sources.push(Source { path: path.to_owned(), text: text.clone() });
        (sources.len() - 1, text)
    }

    /// The folder of the file that a place is in.
    pub fn folder(&self, place: &Place) -> PathBuf {
        self.sources.borrow()[place.source].path.parent().unwrap_or(Path::new("")).to_owned()
    }

    /// The folder of the file that was read first.
    pub fn home(&self) -> PathBuf {
        self.sources.borrow().first().and_then(|first| first.path.parent()).unwrap_or(Path::new("")).to_owned()
    }

    /// Whether as many faults are found as are told.
    fn is_full(&self) -> bool {
        self.faults.borrow().len() >= MOST_FAULTS
    }

    /// Something is wrong with the input.
    pub fn fault(&self, place: &Place, message: impl Into<String>) {
        if !self.is_full() {
            self.faults.borrow_mut().push((place.clone(), message.into()));
        }
    }

    /// Something of the scene is not written.
    pub fn left_out(&self, place: &Place, message: impl Into<String>) {
        self.note(Kind::LeftOut, place, message.into());
    }

    /// Something is written in another form.
    pub fn changed(&self, place: &Place, message: impl Into<String>) {
        self.note(Kind::Changed, place, message.into());
    }

    fn note(&self, kind: Kind, place: &Place, message: String) {
        self.notes.borrow_mut().insert((place.source, place.span.start, kind, message));
    }

    /// All notes in the order of the files, or the faults, a [`LoadError`] for each faulty file.
    pub fn settle(self) -> Result<Vec<Note>, Vec<LoadError>> {
        let sources = self.sources.into_inner();
        let mut faults = self.faults.into_inner();
        if faults.is_empty() {
            let mut places: Vec<_> = sources.iter().map(|source| Places::of(&source.text)).collect();
            let note = |(source, byte, kind, message): (usize, usize, Kind, String)| Note {
                kind,
                path: sources[source].path.clone(),
                position: places[source].position(byte),
                message,
            };
            return Ok(self.notes.into_inner().into_iter().map(note).collect());
        }
        faults.sort_by_key(|(place, _)| (place.source, place.span.start));
        faults.dedup();
        let errors = sources.iter().enumerate().filter_map(|(number, source)| {
            let of_file = faults.iter().filter(|(place, _)| place.source == number);
            let found: Vec<_> = of_file.map(|(place, m)| (Some(place.span.clone()), m.clone())).collect();
            (!found.is_empty()).then(|| LoadError::of_places(&source.path, source.text.to_string(), found))
        });
        Err(errors.collect())
    }
}
