//! Every snapshot of every run as a table (RFC 4180), for whoever wants to draw or test something else.

use crate::study::results::{MethodResults, Results, Run, SceneResults, Snapshot, Stage};

/// Columns before those of the stages.
const COLUMNS: [&str; 22] = [
    "scene",
    "method",
    "options",
    "variant",
    "seed",
    "threads",
    "snapshot",
    "last",
    "seconds",
    "wall_seconds",
    "cpu_seconds",
    "mutations",
    "rays",
    "mse",
    "rel_mse",
    "smape",
    "mean_ratio",
    "mean_ratio_error",
    "reference_rel_mse",
    "stated_brightness_error",
    "image",
    "command",
];

/// One line a snapshot under a line of names. Numbers are written so that reading them gives the same bits; a cell is
/// empty where a value is not known.
pub fn csv(results: &Results) -> String {
    let stages = Stage::ALL.map(|stage| format!("{}_seconds", stage.name()));
    let head: Vec<&str> = COLUMNS.into_iter().chain(stages.iter().map(String::as_str)).collect();
    let mut table = ::csv::Writer::from_writer(Vec::new());
    let written = "memory takes what is written, and all lines are of the same length";
    table.write_record(&head).expect(written);
    for scene in &results.scenes {
        for method in &scene.methods {
            for run in &method.runs {
                for (number, snapshot) in run.snapshots.iter().enumerate() {
                    table.write_record(line(scene, method, run, number, snapshot)).expect(written);
                }
            }
        }
    }
    String::from_utf8(table.into_inner().expect(written)).expect("made of strings")
}

fn line(scene: &SceneResults, method: &MethodResults, run: &Run, number: usize, snapshot: &Snapshot) -> Vec<String> {
    let variant: Vec<String> = method.variant.iter().map(|(option, value)| format!("{option}={value}")).collect();
    let errors = &snapshot.errors;
    let last = number + 1 == run.snapshots.len();
    let mut cells = vec![
        scene.name.clone(),
        method.name.clone(),
        method.options.clone(),
        variant.join(" "),
        run.seed.to_string(),
        run.threads.to_string(),
        number.to_string(),
        u8::from(last).to_string(),
        known(snapshot.seconds),
        known(snapshot.wall_seconds),
        known(snapshot.cpu_seconds),
        snapshot.mutations.to_string(),
        snapshot.rays.to_string(),
        known(errors.mse),
        known(errors.rel_mse),
        known(errors.smape),
        known(errors.mean_ratio),
        known(errors.mean_ratio_error),
        known(errors.reference_rel_mse),
        known(snapshot.stated_brightness_error),
        snapshot.image.as_ref().map(|path| path.display().to_string()).unwrap_or_default(),
        run.command.clone(),
    ];
    cells.extend(run.stages.iter().map(|seconds| known(*seconds)));
    cells
}

fn known(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_survive_quotes_commas_and_line_ends_and_keep_every_bit() {
        let errors = crate::study::metrics::Errors { rel_mse: 0.1 + 0.2, ..Default::default() };
        let snapshot = Snapshot { seconds: 1.0 / 3.0, cpu_seconds: f64::NAN, errors, ..Snapshot::default() };
        let run = Run { command: "relt \"a,b\"\nc".into(), snapshots: vec![snapshot; 2], ..Run::default() };
        let method = MethodResults {
            name: "re, K = 4".into(),
            variant: vec![("replicas".into(), "4".into())],
            runs: vec![run],
            ..MethodResults::default()
        };
        let scene = SceneResults { name: "door".into(), methods: vec![method], ..SceneResults::default() };
        let text = csv(&Results { scenes: vec![scene], ..Results::default() });
        let mut table = ::csv::Reader::from_reader(text.as_bytes());
        let names = table.headers().unwrap().clone();
        let column = |name: &str| names.iter().position(|other| other == name).unwrap();
        let lines: Vec<_> = table.records().map(Result::unwrap).collect();
        assert_eq!(lines.len(), 2);
        assert_eq!(&lines[0][column("method")], "re, K = 4");
        assert_eq!(&lines[0][column("command")], "relt \"a,b\"\nc");
        assert_eq!(&lines[0][column("cpu_seconds")], "");
        assert_eq!(lines[0][column("rel_mse")].parse::<f64>().unwrap().to_bits(), (0.1f64 + 0.2).to_bits());
        assert_eq!([&lines[0][column("last")], &lines[1][column("last")]], ["0", "1"]);
        assert_eq!(&lines[0][column("adaptation_seconds")], "0");
    }
}
