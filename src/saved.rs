//! State that outlives the process: values to bytes and back.
//!
//! Values go by [`postcard`], each with its length before it; sums on films have a form of their own
//! ([`Accumulator::save`](crate::film::Accumulator::save)). What is read is not trusted: lengths are checked against what
//! is left of the input before memory is taken, and whoever restores something checks that it fits the job.

use std::io::{self, Read, Write};

use serde::{Serialize, de::DeserializeOwned};

/// Why saved state cannot be gone on with.
#[derive(Debug, thiserror::Error)]
pub enum Unfit {
    /// The system refused to read.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It ends too early, or its bytes mean nothing.
    #[error("it is damaged: {0}")]
    Damaged(String),
}

impl Unfit {
    /// Unfit because of a part of the state.
    pub fn damaged(what: impl ToString) -> Unfit {
        Unfit::Damaged(what.to_string())
    }
}

/// Nothing if something that must hold of saved state does; `what` names the part of it.
pub fn expect(holds: bool, what: &str) -> Result<(), Unfit> {
    if holds { Ok(()) } else { Err(Unfit::damaged(format_args!("its {what} cannot be"))) }
}

/// Saved state of which it is known how long it is.
pub struct Source<'a> {
    from: Box<dyn Read + 'a>,
    left: u64,
}

impl<'a> Source<'a> {
    /// The next `length` bytes of a reader.
    pub fn new(from: impl Read + 'a, length: u64) -> Source<'a> {
        Source { from: Box::new(from), left: length }
    }

    /// Bytes that are left.
    pub fn left(&self) -> u64 {
        self.left
    }

    /// Fills `bytes`.
    pub fn fill(&mut self, bytes: &mut [u8]) -> Result<(), Unfit> {
        if (bytes.len() as u64) > self.left {
            return Err(Unfit::damaged("it ends too early"));
        }
        self.from.read_exact(bytes)?;
        self.left -= bytes.len() as u64;
        Ok(())
    }

    /// An integer of eight bytes.
    pub fn number(&mut self) -> Result<u64, Unfit> {
        let mut bytes = [0; 8];
        self.fill(&mut bytes)?;
        Ok(u64::from_le_bytes(bytes))
    }

    /// A value that [`write_value`] wrote.
    pub fn value<T: DeserializeOwned>(&mut self) -> Result<T, Unfit> {
        let length = self.number()?;
        if length > self.left {
            return Err(Unfit::damaged("it ends too early"));
        }
        let mut bytes = vec![0; length as usize];
        self.fill(&mut bytes)?;
        postcard::from_bytes(&bytes).map_err(Unfit::damaged)
    }

    /// Nothing, if nothing is left.
    pub fn end(&self) -> Result<(), Unfit> {
        expect(self.left == 0, "end")
    }
}

/// Writes a value, its length before it.
pub fn write_value<T: Serialize>(out: &mut dyn Write, value: &T) -> io::Result<()> {
    let bytes = postcard::to_stdvec(value).map_err(io::Error::other)?;
    out.write_all(&(bytes.len() as u64).to_le_bytes())?;
    out.write_all(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn saved() -> Vec<u8> {
        let mut bytes = Vec::new();
        write_value(&mut bytes, &(1u8, vec![i128::MIN, -1, 0, i128::MAX])).unwrap();
        write_value(&mut bytes, &[f64::NEG_INFINITY, -0.0, f64::MIN_POSITIVE]).unwrap();
        bytes
    }

    #[test]
    fn values_come_back_as_they_were() {
        let bytes = saved();
        let mut source = Source::new(&bytes[..], bytes.len() as u64);
        let (one, numbers): (u8, Vec<i128>) = source.value().unwrap();
        assert_eq!((one, &numbers[..]), (1, &[i128::MIN, -1, 0, i128::MAX][..]));
        let floats: [f64; 3] = source.value().unwrap();
        assert_eq!(
            floats.map(f64::to_bits),
            [f64::NEG_INFINITY, -0.0, f64::MIN_POSITIVE].map(f64::to_bits),
            "bit by bit"
        );
        source.end().unwrap();
    }

    #[test]
    fn what_is_cut_off_or_claims_too_much_is_refused() {
        let bytes = saved();
        for length in 0..bytes.len() {
            let mut source = Source::new(&bytes[..length], length as u64);
            let read = source.value::<(u8, Vec<i128>)>().and_then(|_| source.value::<[f64; 3]>());
            assert!(read.is_err(), "{length} bytes");
        }
        let mut huge = u64::MAX.to_le_bytes().to_vec();
        huge.extend(&bytes);
        assert!(Source::new(&huge[..], huge.len() as u64).value::<Vec<u8>>().is_err());
        // a list that says it had 2⁶⁰ numbers
        let list = [0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x10];
        let mut claims = (list.len() as u64).to_le_bytes().to_vec();
        claims.extend(list);
        assert!(Source::new(&claims[..], claims.len() as u64).value::<Vec<u64>>().is_err());
    }
}
