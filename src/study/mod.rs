//! What runs leave behind, read and drawn.

pub mod collect;
pub mod error_image;
pub mod file;
pub mod flip;
pub mod forecast;
pub mod jobs;
pub mod ladder_page;
pub mod ladder_text;
pub mod metrics;
pub mod record;
pub mod reference;
pub mod reference_progress;
pub mod report;
pub mod results;
pub mod run_log;
pub mod runner;
pub mod statistics;
mod svg;
pub(crate) mod words;

/// A name as a part of a file's name: letters and digits in lower case, all else as one dash.
fn file_name(name: &str) -> String {
    let words: Vec<String> =
        name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_lowercase).collect();
    if words.is_empty() { "unnamed".into() } else { words.join("-") }
}

#[cfg(test)]
mod tests {
    use super::file_name;

    #[test]
    fn names_become_parts_of_file_names() {
        assert_eq!(file_name("Door, K = 4/../x"), "door-k-4-x");
        assert_eq!(file_name("../"), "unnamed");
    }
}
