//! Text to words, quoted strings and brackets.

use std::ops::Range;
use std::rc::Rc;

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A directive, a number, `true` or `false`.
    Word,
    /// A string between double quotes.
    Quoted,
    /// `[`.
    Open,
    /// `]`.
    Close,
}

/// A piece of the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    /// What it is.
    pub kind: Kind,
    /// Where it is; of a quoted string, without the quotes.
    pub span: Range<usize>,
}

/// The tokens of a file, one after the other.
#[derive(Clone, Debug)]
pub struct Tokenizer {
    text: Rc<str>,
    at: usize,
}

impl Tokenizer {
    /// From the beginning of a text.
    pub fn new(text: Rc<str>) -> Tokenizer {
        Tokenizer { text, at: 0 }
    }

    /// The text of a token as it stands in the file.
    pub fn text(&self, token: &Token) -> &str {
        &self.text[token.span.clone()]
    }

    /// The next token; an error, with its place, where a string does not end on its line.
    pub fn next(&mut self) -> Option<Result<Token, Range<usize>>> {
        self.skip_blanks();
        let start = self.at;
        let first = *self.text.as_bytes().get(start)?;
        let token = |kind, span| Some(Ok(Token { kind, span }));
        match first {
            b'[' | b']' => {
                self.at += 1;
                token(if first == b'[' { Kind::Open } else { Kind::Close }, start..start + 1)
            }
            b'"' => self.quoted(start),
            _ => {
                let is_end = |byte: &u8| byte.is_ascii_whitespace() || matches!(byte, b'[' | b']' | b'"' | b'#');
                let rest = &self.text.as_bytes()[start..];
                self.at = start + rest.iter().position(is_end).unwrap_or(rest.len());
                token(Kind::Word, start..self.at)
            }
        }
    }

    fn quoted(&mut self, start: usize) -> Option<Result<Token, Range<usize>>> {
        let bytes = self.text.as_bytes();
        let mut end = start + 1;
        loop {
            match bytes.get(end) {
                Some(b'"') => {
                    self.at = end + 1;
                    return Some(Ok(Token { kind: Kind::Quoted, span: start + 1..end }));
                }
                Some(b'\\') if bytes.get(end + 1).is_some_and(|next| *next != b'\n') => end += 2,
                None | Some(b'\n') => {
                    self.at = end.min(bytes.len());
                    return Some(Err(start..start + 1));
                }
                Some(_) => end += 1,
            }
        }
    }

    /// Blanks, and comments to the end of their line.
    fn skip_blanks(&mut self) {
        let bytes = self.text.as_bytes();
        while let Some(byte) = bytes.get(self.at) {
            if *byte == b'#' {
                let rest = &bytes[self.at..];
                self.at += rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
            } else if byte.is_ascii_whitespace() {
                self.at += 1;
            } else {
                return;
            }
        }
    }
}

/// A quoted string with its escapes replaced.
pub fn unescaped(text: &str) -> String {
    let mut unescaped = String::with_capacity(text.len());
    let mut characters = text.chars();
    while let Some(c) = characters.next() {
        match c {
            '\\' => match characters.next() {
                Some('n') => unescaped.push('\n'),
                Some('t') => unescaped.push('\t'),
                Some(other) => unescaped.push(other),
                None => {}
            },
            c => unescaped.push(c),
        }
    }
    unescaped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<Result<(Kind, String), usize>> {
        let mut tokenizer = Tokenizer::new(text.into());
        let mut tokens = Vec::new();
        while let Some(token) = tokenizer.next() {
            tokens.push(token.map(|t| (t.kind, tokenizer.text(&t).to_owned())).map_err(|span| span.start));
        }
        tokens
    }

    #[test]
    fn words_strings_and_brackets_need_no_blanks_between_them() {
        use Kind::{Close, Open, Quoted, Word};
        let expected = [
            (Word, "Shape"),
            (Quoted, "sphere"),
            (Quoted, "float radius"),
            (Open, "["),
            (Word, "-.5e1"),
            (Close, "]"),
            (Word, "Scale"),
        ];
        let expected: Vec<_> = expected.iter().map(|(kind, text)| Ok((*kind, text.to_string()))).collect();
        assert_eq!(tokens("Shape\"sphere\" \"float radius\"[-.5e1]# a [comment\"\nScale"), expected);
    }

    #[test]
    fn a_string_ends_on_its_line() {
        assert_eq!(
            tokens("Shape \"sphere\nScale"),
            [Ok((Kind::Word, "Shape".into())), Err(6), Ok((Kind::Word, "Scale".into()))]
        );
        assert_eq!(tokens("\"a"), [Err(0)]);
        assert_eq!(tokens("\"a\\"), [Err(0)]);
    }

    #[test]
    fn escapes_are_replaced() {
        assert_eq!(tokens(r#""a\"b""#), [Ok((Kind::Quoted, r#"a\"b"#.into()))]);
        assert_eq!(unescaped(r#"a\"b\\c"#), r#"a"b\c"#);
    }
}
