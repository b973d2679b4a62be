//! Directives to a [`World`]: what each does to the state that the ones after it see.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::directives::{self, Action};
use super::parameters::{Parameter, Parameters, TYPES, Values};
use super::state::State;
use super::tokenizer::{Kind, Token, Tokenizer, unescaped};
use super::world::World;
use crate::convert::notes::{Notes, Place};
use crate::convert::values::number;
use crate::load::faults::{did_you_mean, list};

/// Most files that include one another.
const MAX_INCLUDES: usize = 16;

/// A file that is being read.
struct Input {
    source: usize,
    path: PathBuf,
    tokens: Tokenizer,
}

/// Reads directives one after the other.
pub struct Reader<'a> {
    inputs: Vec<Input>,
    /// A token that was read and put back, with its file's place in the stack.
    waiting: Option<(Token, usize)>,
    /// For what cannot be read.
    pub notes: &'a Notes,
}

/// Reads a file and all that it includes.
pub fn read(path: &Path, (source, text): (usize, Rc<str>), notes: &Notes) -> World {
    let input = Input { source, path: path.to_owned(), tokens: Tokenizer::new(text) };
    let mut reader = Reader { inputs: vec![input], waiting: None, notes };
    let mut state = State::new(Place::new(source, 0..0));
    while let Some((token, source)) = reader.next() {
        reader.directive(&token, source, &mut state);
    }
    state.finish(notes)
}

impl Reader<'_> {
    /// The next token with the number of its file; at the end of an included file, from the one that includes it.
    fn next(&mut self) -> Option<(Token, usize)> {
        if let Some(waiting) = self.waiting.take() {
            return Some(waiting);
        }
        loop {
            let input = self.inputs.last_mut()?;
            match input.tokens.next() {
                Some(Ok(token)) => return Some((token, input.source)),
                Some(Err(span)) => {
                    self.notes.fault(&Place::new(input.source, span), "the string has no end on its line")
                }
                None if self.inputs.len() == 1 => return None,
                None => drop(self.inputs.pop()),
            }
        }
    }

    /// The next token if it is in the file that is being read and of this kind.
    fn next_if(&mut self, kind: Kind) -> Option<(Token, Place)> {
        let depth = self.inputs.len();
        let (token, source) = self.next()?;
        if token.kind == kind && self.inputs.len() == depth {
            let place = Place::new(source, token.span.clone());
            return Some((token, place));
        }
        self.waiting = Some((token, source));
        None
    }

    /// A token's text in the file that is being read.
    fn text(&self, token: &Token) -> &str {
        self.inputs.last().expect("the first file stays").tokens.text(token)
    }

    /// Runs one directive.
    fn directive(&mut self, token: &Token, source: usize, state: &mut State) {
        let place = Place::new(source, token.span.clone());
        if token.kind != Kind::Word {
            self.notes.fault(&place, "expected a directive, such as Shape");
            return self.skip_to_directive();
        }
        let name = self.text(token).to_owned();
        let Some((name, action)) = directives::DIRECTIVES.iter().find(|(known, _)| *known == name) else {
            let known: Vec<&str> = directives::DIRECTIVES.iter().map(|(known, _)| *known).collect();
            let shown: String = name.chars().take(40).collect();
            let message = format!("unknown directive {shown:?}{}; {}", did_you_mean(&name, &known), list(&known));
            self.notes.fault(&place, message);
            return self.skip_to_directive();
        };
        let done = match action {
            Action::Include => self.include(&place),
            Action::Plain(run) => {
                run(state, &place, self.notes);
                Ok(())
            }
            Action::Numbers(count, run) => {
                self.numbers(*count, &place).map(|numbers| run(state, &numbers, &place, self.notes))
            }
            Action::Name(run) => self.quoted(&place).map(|(name, at)| run(state, name, at, self.notes)),
            Action::Word(run) => match self.next_if(Kind::Word) {
                Some((token, at)) => {
                    let word = self.text(&token).to_owned();
                    run(state, &word, &at, self.notes);
                    Ok(())
                }
                None => Err((place.clone(), "expected a word after it".into())),
            },
            Action::Names(run) => self.quoted(&place).map(|_| {
                self.next_if(Kind::Quoted);
                run(state, &place, self.notes);
            }),
            Action::List(run) => self.list(name, &place).map(|list| run(state, list, self.notes)),
            Action::Texture => self.texture(state, &place),
            Action::Option => self.parameters().map(|list| {
                for parameter in list {
                    self.notes
                        .left_out(&parameter.place, format!("Option {}: it says how pbrt renders", parameter.name));
                }
            }),
        };
        if let Err((place, message)) = done {
            self.notes.fault(&place, format!("{name}: {message}"));
            self.skip_to_directive();
        }
    }

    /// Goes on after a fault.
    fn skip_to_directive(&mut self) {
        while let Some((token, source)) = self.next() {
            let is_directive =
                token.kind == Kind::Word && directives::DIRECTIVES.iter().any(|(known, _)| *known == self.text(&token));
            if is_directive {
                self.waiting = Some((token, source));
                return;
            }
        }
    }

    /// Begins to read another file.
    fn include(&mut self, place: &Place) -> Result<(), (Place, String)> {
        let (name, at) = self.quoted(place)?;
        // pbrt looks beside the file that was given first
        let path = self.notes.file(&self.notes.home(), &name, true).map_err(|message| (at.clone(), message))?;
        if self.inputs.len() > MAX_INCLUDES || self.inputs.iter().any(|input| input.path == path) {
            return Err((at, format!("{} includes itself, by way of others or directly", path.display())));
        }
        if path.extension().is_some_and(|extension| extension == "gz") {
            return Err((at, format!("{} is packed; unpack it with gunzip and name what that gives", path.display())));
        }
        let (source, text) = self.notes.read(&path).map_err(|message| (at, message))?;
        self.inputs.push(Input { source, path, tokens: Tokenizer::new(text) });
        Ok(())
    }

    /// A string.
    fn quoted(&mut self, place: &Place) -> Result<(String, Place), (Place, String)> {
        match self.next_if(Kind::Quoted) {
            Some((token, at)) => Ok((unescaped(self.text(&token)), at)),
            None => Err((place.clone(), "expected a string after it".into())),
        }
    }

    /// As many numbers, in brackets or not.
    fn numbers(&mut self, count: usize, place: &Place) -> Result<Vec<f64>, (Place, String)> {
        let is_bracketed = self.next_if(Kind::Open).is_some();
        let mut numbers = Vec::with_capacity(count);
        while numbers.len() < count {
            let Some((token, at)) = self.next_if(Kind::Word) else {
                return Err((place.clone(), format!("{} numbers after it; expected {count}", numbers.len())));
            };
            numbers.push(number(self.text(&token)).map_err(|message| (at, message))?);
        }
        if is_bracketed && self.next_if(Kind::Close).is_none() {
            return Err((place.clone(), format!("more than {count} numbers in the brackets")));
        }
        Ok(numbers)
    }

    /// A name and parameters.
    fn list(&mut self, directive: &'static str, at: &Place) -> Result<Parameters, (Place, String)> {
        let (kind, place) = self.quoted(at)?;
        Ok(Parameters::new(directive, kind, place, self.parameters()?))
    }

    /// `Texture "name" "type" "class"` and parameters.
    fn texture(&mut self, state: &mut State, at: &Place) -> Result<(), (Place, String)> {
        let (name, _) = self.quoted(at)?;
        let (of, of_place) = self.quoted(at)?;
        let list = self.list("Texture", at)?;
        directives::texture(state, name, (&of, of_place), list)
    }

    /// Parameters up to what is none.
    fn parameters(&mut self) -> Result<Vec<Rc<Parameter>>, (Place, String)> {
        let mut read = Vec::new();
        while let Some((token, place)) = self.next_if(Kind::Quoted) {
            let declared = unescaped(self.text(&token));
            let mut words = declared.split_whitespace();
            let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
                return Err((
                    place,
                    format!("{declared:?} is no parameter; expected its type and name, as in \"float radius\""),
                ));
            };
            let Some((_, size)) = TYPES.iter().find(|(known, _)| *known == kind) else {
                let known: Vec<&str> = TYPES.iter().map(|(known, _)| *known).collect();
                return Err((place, format!("unknown type {kind:?}{}; {}", did_you_mean(kind, &known), list(&known))));
            };
            let values = self.values(&place)?;
            check(kind, *size, &values).map_err(|message| (place.clone(), format!("{name}: {message}")))?;
            read.push(Rc::new(Parameter::new(kind.to_owned(), name.to_owned(), values, place)));
        }
        Ok(read)
    }

    /// One value, or several in brackets.
    fn values(&mut self, place: &Place) -> Result<Values, (Place, String)> {
        let is_bracketed = self.next_if(Kind::Open).is_some();
        let (mut numbers, mut strings, mut booleans) = (Vec::new(), Vec::new(), Vec::new());
        loop {
            if let Some((token, _)) = self.next_if(Kind::Quoted) {
                strings.push(unescaped(self.text(&token)));
            } else if let Some((token, at)) = self.next_if(Kind::Word) {
                match self.text(&token) {
                    "true" => booleans.push(true),
                    "false" => booleans.push(false),
                    text => numbers.push(number(text).map_err(|message| (at, message))?),
                }
            } else if is_bracketed && self.next_if(Kind::Close).is_some() {
                break;
            } else {
                return Err((place.clone(), "the parameter has no value, or its bracket no end".into()));
            }
            if !is_bracketed {
                break;
            }
        }
        match (numbers.is_empty(), strings.is_empty(), booleans.is_empty()) {
            (_, true, true) => Ok(Values::Numbers(numbers)),
            (true, false, true) => Ok(Values::Strings(strings)),
            (true, true, false) => Ok(Values::Booleans(booleans)),
            _ => Err((place.clone(), "the parameter's values are of different kinds".into())),
        }
    }
}

/// Whether values are what the type says.
fn check(kind: &str, size: usize, values: &Values) -> Result<(), String> {
    match (kind, values) {
        ("bool", Values::Booleans(_) | Values::Strings(_)) => Ok(()),
        ("string" | "texture" | "spectrum", Values::Strings(_)) => Ok(()),
        ("spectrum", Values::Numbers(numbers)) if numbers.len() % 2 == 0 => Ok(()),
        ("integer", Values::Numbers(numbers)) => match numbers.iter().find(|value| value.trunc() != **value) {
            Some(value) => Err(format!("{value} is not a whole number")),
            None => Ok(()),
        },
        (_, Values::Numbers(numbers)) if size > 0 && numbers.len() % size == 0 => Ok(()),
        (_, Values::Numbers(numbers)) if size > 0 => {
            Err(format!("{} numbers; expected {size} for each {kind}", numbers.len()))
        }
        _ => Err(format!("these are no values of type {kind}")),
    }
}
