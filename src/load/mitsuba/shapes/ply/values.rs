//! The numbers in a PLY file behind its header, one after the other.

use std::io::BufRead;

use ply_rs_bw::ply::{Encoding, ScalarType};

/// Reads numbers of any type; all of them fit into an f64.
pub struct Values<R> {
    source: R,
    form: Form,
}

enum Form {
    /// Little endian or big endian.
    Binary { is_big: bool },
    /// A line for each element.
    Text { line: Vec<u8>, at: usize, number: usize },
}

const ENDS: &str = "the file ends here";

impl<R: BufRead> Values<R> {
    /// Of a source behind a header of that many lines.
    pub fn new(source: R, encoding: &Encoding, lines: usize) -> Self {
        let form = match encoding {
            Encoding::Ascii => Form::Text { line: Vec::new(), at: 0, number: lines },
            Encoding::BinaryBigEndian => Form::Binary { is_big: true },
            Encoding::BinaryLittleEndian => Form::Binary { is_big: false },
        };
        Values { source, form }
    }

    /// Begins an element.
    #[inline]
    pub fn begin(&mut self) -> Result<(), String> {
        let Form::Text { line, at, number } = &mut self.form else { return Ok(()) };
        *at = 0;
        loop {
            line.clear();
            *number += 1;
            match self.source.read_until(b'\n', line) {
                Ok(0) => return Err(ENDS.into()),
                Ok(_) if line.iter().all(u8::is_ascii_whitespace) => {}
                Ok(_) => return Ok(()),
                Err(error) => return Err(error.to_string()),
            }
        }
    }

    /// The next number of the element.
    #[inline]
    pub fn next(&mut self, kind: &ScalarType) -> Result<f64, String> {
        match self.form {
            Form::Text { .. } => self.word(kind),
            Form::Binary { is_big } => self.bytes(kind, is_big),
        }
    }

    /// The length of a list.
    #[inline]
    pub fn length(&mut self, kind: &ScalarType) -> Result<usize, String> {
        let length = self.next(kind)?;
        let whole = length as u32;
        if f64::from(whole) == length { Ok(whole as usize) } else { Err(format!("a list of length {length}")) }
    }

    /// Ends an element.
    #[inline]
    pub fn end(&mut self) -> Result<(), String> {
        let Form::Text { line, at, number } = &self.form else { return Ok(()) };
        if line[*at..].iter().all(u8::is_ascii_whitespace) {
            return Ok(());
        }
        Err(format!("line {number} holds more than the header says"))
    }

    fn word(&mut self, kind: &ScalarType) -> Result<f64, String> {
        let Form::Text { line, at, number } = &mut self.form else { unreachable!("words are in text only") };
        let rest = &line[*at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace());
        let start = start.ok_or_else(|| format!("line {number} holds less than the header says"))?;
        let end = rest[start..].iter().position(u8::is_ascii_whitespace).map_or(rest.len(), |length| start + length);
        *at += end;
        let word = std::str::from_utf8(&rest[start..end]).unwrap_or("\u{fffd}");
        let is_in_range = |least: i64, most: i64| word.parse().ok().filter(|i| (least..=most).contains(i));
        let whole = |least: i64, most: i64| is_in_range(least, most).map(|i| i as f64);
        let value = match kind {
            ScalarType::Char => whole(i8::MIN.into(), i8::MAX.into()),
            ScalarType::UChar => whole(0, u8::MAX.into()),
            ScalarType::Short => whole(i16::MIN.into(), i16::MAX.into()),
            ScalarType::UShort => whole(0, u16::MAX.into()),
            ScalarType::Int => whole(i32::MIN.into(), i32::MAX.into()),
            ScalarType::UInt => whole(0, u32::MAX.into()),
            ScalarType::Float => word.parse::<f32>().ok().map(f64::from),
            ScalarType::Double => word.parse().ok(),
        };
        let word: String = word.chars().filter(|c| !c.is_control()).take(40).collect();
        value.ok_or_else(|| format!("line {number}: {word:?} is no number of the type in the header"))
    }

    #[inline]
    fn bytes(&mut self, kind: &ScalarType, is_big: bool) -> Result<f64, String> {
        macro_rules! number {
            ($type:ty) => {{
                let bytes = self.take::<{ size_of::<$type>() }>()?;
                (if is_big { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) }) as f64
            }};
        }
        Ok(match kind {
            ScalarType::Char => number!(i8),
            ScalarType::UChar => number!(u8),
            ScalarType::Short => number!(i16),
            ScalarType::UShort => number!(u16),
            ScalarType::Int => number!(i32),
            ScalarType::UInt => number!(u32),
            ScalarType::Float => number!(f32),
            ScalarType::Double => number!(f64),
        })
    }

    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut bytes = [0; N];
        match self.source.read_exact(&mut bytes) {
            Ok(()) => Ok(bytes),
            Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => Err(ENDS.into()),
            Err(error) => Err(error.to_string()),
        }
    }
}
