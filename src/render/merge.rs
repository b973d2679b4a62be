//! One picture of parts that ran apart.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use super::{
    checkpoint::{self, CheckpointError, Resumed, differences},
    output::{Picture, metadata},
    parts::{Agreement, Parts, Pool},
    status::Status,
};

/// What came of parts.
pub struct Merged {
    /// The picture of all.
    pub picture: Picture,
    /// The parts, in order.
    pub parts: Vec<MergedPart>,
    /// How many there are of the job.
    pub of: u32,
    /// Whether they tell the same, where there are several.
    pub agreement: Option<Agreement>,
    /// What the person should know, one sentence each.
    pub warnings: Vec<String>,
}

/// A part and how far it has come.
pub struct MergedPart {
    /// Its number, from 1; absent for all of a job's parts together.
    pub number: Option<u32>,
    /// Its file.
    pub path: PathBuf,
    /// Mutations done.
    pub mutations: u64,
    /// Mutations in all, where there are more to come.
    pub wanted: Option<u64>,
    /// Wall time spent.
    pub elapsed: Duration,
}

/// Pools the parts of one job that those files hold, checkpoints all of them, at whatever moment they were taken: each at most
/// once, and of the same scene, settings and seed.
///
/// In memory there is one part at a time, beside the sums. See [`parts`](super::parts) for what is pooled.
pub fn merge(paths: &[PathBuf]) -> Result<Merged, CheckpointError> {
    let mut warnings = Vec::new();
    let mut files = Vec::new();
    for path in paths {
        let (file, warning) = checkpoint::open(path)?;
        warnings.extend(warning);
        files.push(file);
    }
    files.sort_by_key(|file| file.header.start.settings.parts.only);
    one_job(&files)?;
    let first = files[0].header.clone();
    let Parts { of, only } = first.start.settings.parts;
    warnings.extend(only.and_then(|_| missing(&files, of)));
    warnings.extend(other_machines(&files));

    let mut status = Status::default();
    let mut pool = Pool::new(first.sheet);
    let mut whole = None;
    let mut parts = Vec::new();
    for file in &mut files {
        let engine = file.engine()?;
        let counts = engine.counts();
        status.mutations += counts.mutations;
        status.rays += counts.rays;
        status.non_finite += counts.faults.total();
        status.faults.merge(&counts.faults);
        status.elapsed += file.header.done.elapsed;
        let number = file.header.start.settings.parts.only;
        let (path, elapsed) = (file.path.clone(), file.header.done.elapsed);
        let wanted = engine.mutations_wanted().filter(|wanted| *wanted > counts.mutations);
        parts.push(MergedPart { number, path, mutations: counts.mutations, wanted, elapsed });
        match number {
            Some(number) => pool.add(number, engine.as_ref()),
            None => whole = Some(engine.develop()),
        }
    }
    let development = whole.unwrap_or_else(|| pool.develop());
    status.normalisation = development.normalisation.map(|e| (e.value, e.standard_error));
    let mut metadata = metadata(&first.start, &status);
    metadata.extend(development.agreement.iter().flat_map(Agreement::metadata));
    let picture = Picture::new(&first.sheet.film, development.image, development.layers, metadata);
    warnings.extend(development.warnings);
    Ok(Merged { picture, parts, of, agreement: development.agreement, warnings })
}

/// Nothing, if all are parts of one job, each once.
fn one_job(files: &[Resumed]) -> Result<(), CheckpointError> {
    let foreign = |file: &Resumed, differences| Err(CheckpointError::Foreign { path: file.path.clone(), differences });
    let first = &files[0];
    let name = |path: &Path| format!("{} has", path.display());
    for file in &files[1..] {
        let (a, b) = (&first.header, &file.header);
        let mut found = differences(b, &a.start.settings, ["it has", &name(&first.path)]);
        if a.scene_digest != b.scene_digest || a.sheet != b.sheet {
            let first = first.path.display();
            found.insert(0, format!("its scene ({}) has other contents than that of {first}", b.start.scene));
        }
        if a.start.mapping != b.start.mapping && found.is_empty() {
            let [ours, theirs] = [b, a].map(|header| header.start.mapping.name());
            found.push(format!("mapping: it has {ours}, {} {theirs}", name(&first.path)));
        }
        if a.planned_mutations_per_pixel != b.planned_mutations_per_pixel {
            let words = |mpp: Option<f64>| mpp.map_or("no limit".into(), |mpp| mpp.to_string());
            let [ours, theirs] = [b, a].map(|header| words(header.planned_mutations_per_pixel));
            found.push(format!("--mpp at the beginning: it has {ours}, {} {theirs}", name(&first.path)));
        }
        if !found.is_empty() {
            return foreign(file, found);
        }
    }
    for pair in files.windows(2) {
        let [a, b] = [&pair[0], &pair[1]].map(|file| file.header.start.settings.parts.only);
        if a == b {
            let what = a.map_or("the whole job".into(), |part| format!("part {part}"));
            let other = pair[0].path.display();
            return foreign(&pair[1], vec![format!("it is {what}, as {other} is; a part counts once")]);
        }
        if a.is_none() || b.is_none() {
            let other = pair[1].path.display();
            return foreign(&pair[0], vec![format!("it is the whole job, of which {other} is a part")]);
        }
    }
    Ok(())
}

/// A warning about parts that are not there.
fn missing(files: &[Resumed], of: u32) -> Option<String> {
    /// Numbers that are told, at most.
    const TOLD: usize = 8;
    let there: Vec<Option<u32>> = files.iter().map(|file| file.header.start.settings.parts.only).collect();
    let missing = (1..=of).filter(|part| !there.contains(&Some(*part)));
    let number = of as usize - files.len();
    let mut told: Vec<String> = missing.take(TOLD).map(|part| part.to_string()).collect();
    if number > TOLD {
        told.push("…".into());
    }
    (number > 0)
        .then(|| format!("{number} of {of} parts are missing ({}): the picture is of the others", told.join(", ")))
}

/// A warning about parts that were computed otherwise.
fn other_machines(files: &[Resumed]) -> Option<String> {
    let first = &files[0].header.arithmetic;
    let other = files.iter().find(|file| file.header.arithmetic != *first)?;
    Some(format!(
        "{} is by {}, {} by {first}: the picture is as good, but last bits may differ from those of one machine alone",
        other.path.display(),
        other.header.arithmetic,
        files[0].path.display()
    ))
}
