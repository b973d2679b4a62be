//! Files that would end the program, or keep it busy or hungry without end, in `tests/corpora`: those that were found by
//! reading the source, and a place for what `fuzz/run.sh` finds. A folder a target of `fuzz/targets`, which read alike.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use relt::convert::{Job, convert};
use relt::load::{self, Reach};
use relt::render::{Settings, checkpoint};
use relt::study;

use crate::files::Folder;

/// What is done with a file's content, as one of that name in a folder where it may write.
type Reading = fn(&[u8], &Folder);

const READINGS: &[(&str, Reading)] = &[
    ("scene", |content, folder| {
        if let Ok(text) = String::from_utf8(content.to_vec()) {
            drop(load::text(&folder.path("scene.xml"), text));
        }
    }),
    ("obj", |content, _| drop(load::mesh("obj", content))),
    ("ply", |content, _| drop(load::mesh("ply", content))),
    ("serialized", |content, _| drop(load::mesh("serialized", content))),
    ("picture", |content, _| drop(load::picture(content))),
    ("convert_mitsuba", |content, folder| convert_in(folder, "in.xml", content)),
    ("convert_pbrt", |content, folder| convert_in(folder, "in.pbrt", content)),
    ("checkpoint", |content, folder| {
        let path = folder.path("checkpoint");
        std::fs::write(&path, [content, &crc32fast::hash(content).to_le_bytes()].concat()).unwrap();
        if let Ok(mut resumed) = checkpoint::open_one(&path) {
            drop(resumed.engine());
        }
    }),
    ("study", |content, folder| {
        let path = folder.path("study.toml");
        std::fs::write(&path, content).unwrap();
        drop(study::file::read(&path, &|_| Ok(Settings::default())));
    }),
];

fn convert_in(folder: &Folder, name: &str, content: &[u8]) {
    let (input, output) = (folder.path(name), folder.path("out.xml"));
    std::fs::write(&input, content).unwrap();
    drop(convert(&Job { input, output, defines: Vec::new(), reach: Reach::Confined, strict: false }));
}

/// Each takes a few milliseconds; on a machine that is busy with all tests at once this is far off.
const LONGEST: Duration = Duration::from_secs(30);

#[test]
fn corpora_are_read_or_refused_in_little_time() {
    let corpora = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpora");
    let mut folders: Vec<_> = std::fs::read_dir(&corpora).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    folders.retain(|name| !READINGS.iter().any(|(known, _)| name == known));
    assert!(folders.is_empty(), "nothing reads {folders:?}");
    let mut count = 0;
    for (kind, reading) in READINGS {
        let Ok(entries) = std::fs::read_dir(corpora.join(kind)) else { continue };
        for entry in entries {
            let path = entry.unwrap().path();
            let (content, folder, begin) = (std::fs::read(&path).unwrap(), Folder::new(&[]), Instant::now());
            let read = catch_unwind(AssertUnwindSafe(|| reading(&content, &folder)));
            let took = begin.elapsed();
            assert!(read.is_ok(), "{} is a panic", path.display());
            assert!(took < LONGEST, "{} took {took:?}", path.display());
            count += 1;
        }
    }
    assert!(count > 0, "{} holds nothing", corpora.display());
}
