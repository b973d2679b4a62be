//! Numbers that are others when something has changed: against accidents, not against malice.

use std::{fmt, io};

use crate::scene::SceneDescription;

/// CRC-32 of texts and bytes as they come.
#[derive(Default)]
pub struct Checksum(crc32fast::Hasher);

impl Checksum {
    /// Of a scene as it was read: another one when anything in its files changes that could change the image, however
    /// they are called. It is over the description in words, which has every number with all its digits.
    pub fn of_scene(scene: &SceneDescription) -> Checksum {
        let mut checksum = Checksum::default();
        fmt::Write::write_fmt(&mut checksum, format_args!("{scene:?}")).expect("checksums take all");
        checksum
    }

    /// Of some bytes.
    pub fn of(bytes: &[u8]) -> u32 {
        crc32fast::hash(bytes)
    }

    /// Adds bytes.
    pub fn add(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The number.
    pub fn finish(self) -> u32 {
        self.0.finalize()
    }
}

/// Writes on, and takes the checksum of all that comes by.
pub struct Summed<W> {
    to: W,
    sum: Checksum,
}

impl<W: io::Write> Summed<W> {
    /// Nothing came by yet.
    pub fn new(to: W) -> Summed<W> {
        Summed { to, sum: Checksum::default() }
    }

    /// Writes the checksum of everything before as four bytes, little-endian.
    pub fn seal(mut self) -> io::Result<()> {
        let sum = self.sum.finish();
        self.to.write_all(&sum.to_le_bytes())
    }

    /// The checksum of everything that came by.
    pub fn finish(self) -> u32 {
        self.sum.finish()
    }
}

impl<W: io::Write> io::Write for Summed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.to.write(bytes)?;
        self.sum.add(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

impl fmt::Write for Checksum {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.add(text.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;

    #[test]
    fn pieces_make_the_whole() {
        let mut pieces = Checksum::default();
        pieces.add(b"123");
        write!(pieces, "{}", 456).unwrap();
        pieces.add(b"789");
        assert_eq!(pieces.finish(), Checksum::of(b"123456789"));
        assert_eq!(Checksum::of(b"123456789"), 0xcbf4_3926, "the check value of CRC-32/ISO-HDLC");
    }
}
