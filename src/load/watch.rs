//! How far loading has come.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Counts what loading has read, for those who wait for it; shared between the threads that read.
#[derive(Debug, Default)]
pub struct Watch {
    expected: AtomicU64,
    read: AtomicU64,
}

impl Watch {
    /// Bytes of mesh files read so far, and bytes of all those that will be.
    pub fn bytes(&self) -> (u64, u64) {
        (self.read.load(Relaxed), self.expected.load(Relaxed))
    }

    /// Announces bytes that will be read.
    pub(super) fn expect(&self, bytes: u64) {
        self.expected.fetch_add(bytes, Relaxed);
    }
}

/// A file whose reading is counted, buffered.
pub(super) type Source<'w> = BufReader<Watched<'w>>;

/// Bytes read at once: enough to make system calls rare, little enough to stay in the cache.
const BUFFER: usize = 1 << 18;

/// Opens a file.
pub(super) fn open<'w>(path: &Path, watch: &'w Watch) -> io::Result<Source<'w>> {
    Ok(BufReader::with_capacity(BUFFER, Watched { file: File::open(path)?, watch }))
}

/// A file whose reading is counted.
pub(super) struct Watched<'w> {
    file: File,
    watch: &'w Watch,
}

impl Watched<'_> {
    /// Size of the file in bytes.
    pub fn size(&self) -> io::Result<u64> {
        Ok(self.file.metadata()?.len())
    }
}

impl Read for Watched<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.watch.read.fetch_add(count as u64, Relaxed);
        Ok(count)
    }
}

impl Seek for Watched<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
