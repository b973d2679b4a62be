//! Whether the patches with known bugs still fit the source. `tests/sabotage/run.sh` shows what tests make of them, which
//! takes too long for every day: about a minute a bug.

use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A patch of one file.
struct Patch {
    name: String,
    /// What the bug is.
    what: String,
    /// Arguments of `cargo test`.
    test: String,
    file: PathBuf,
    /// What each hunk finds and what it puts there, line by line.
    hunks: Vec<[String; 2]>,
}

impl Patch {
    fn read(path: &Path) -> Patch {
        let text = std::fs::read_to_string(path).unwrap();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let field = |field: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(field));
            line.unwrap_or_else(|| panic!("{name}: no line {field:?}")).to_owned()
        };
        let files: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("+++ b/")).collect();
        let [file] = files[..] else { panic!("{name}: one file a patch, not {files:?}") };
        let mut hunks: Vec<[String; 2]> = Vec::new();
        for line in text.lines().skip_while(|line| !line.starts_with("@@")) {
            let [old, new] = match line.split_at_checked(1) {
                Some(("@", _)) => {
                    hunks.push(Default::default());
                    continue;
                }
                Some((" ", rest)) => [Some(rest), Some(rest)],
                Some(("-", rest)) => [Some(rest), None],
                Some(("+", rest)) => [None, Some(rest)],
                _ => [Some(""), Some("")], // an editor may have taken the space of an empty line
            };
            let hunk = hunks.last_mut().expect("lines follow the first @@");
            for (side, line) in hunk.iter_mut().zip([old, new]) {
                side.extend(line.map(|line| format!("{line}\n")));
            }
        }
        Patch { what: field("what: "), test: field("test: "), file: root().join(file), hunks, name }
    }

    /// The names that the arguments select tests by, and the text of all sources that these may be in.
    fn tests(&self) -> (Vec<&str>, String) {
        let (target, names) =
            self.test.split_once(" -- ").unwrap_or_else(|| panic!("{}: no names of tests", self.name));
        let folder = match target.split_once(' ') {
            Some(("--test", name)) => root().join("tests").join(name),
            None if target == "--lib" => root().join("src"),
            _ => panic!("{}: --lib or --test NAME, not {target:?}", self.name),
        };
        (names.split(' ').collect(), sources(&folder))
    }
}

/// All Rust below a folder, paths of files included.
fn sources(folder: &Path) -> String {
    let mut text = String::new();
    for entry in std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text += &sources(&path);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            text += &format!("{}\n{}", path.display(), std::fs::read_to_string(&path).unwrap());
        }
    }
    text
}

#[test]
fn every_bug_still_fits_the_source_and_names_tests_that_there_are() {
    let folder = root().join("tests/sabotage");
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let patches: Vec<Patch> =
        paths.filter(|path| path.extension().is_some_and(|e| e == "patch")).map(|path| Patch::read(&path)).collect();
    assert!(patches.len() >= 8, "only {}", patches.len());
    for patch in &patches {
        let Patch { name, what, file, hunks, .. } = patch;
        assert!(!what.is_empty() && !hunks.is_empty(), "{name}");
        let source = std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{name}: {}: {e}", file.display()));
        for [old, new] in hunks {
            assert_ne!(old, new, "{name} changes nothing");
            assert_eq!(
                source.matches(old.as_str()).count(),
                1,
                "{name} fits {} no more: looked for\n{old}",
                file.display()
            );
        }
        let (names, tests) = patch.tests();
        for name_of_test in names {
            for part in name_of_test.split("::") {
                assert!(tests.contains(part), "{name}: no test is called {name_of_test}");
            }
        }
    }
}
