//! What a person may choose about a run, and which choices make sense.

use std::cmp::Ordering;
use std::time::Duration;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

pub use super::parts::Parts;
use crate::chain::LARGE_STEP_PROBABILITY;
pub use crate::chain::Measure;
use crate::embree::Width;
use crate::path::{Mapping, MappingKind, Widths};
use crate::scene::Scene;
pub use crate::tempering::{Choices, Combine, LadderChoice};

/// How the image is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Method {
    /// Stratified samples and nothing else.
    #[serde(rename = "path")]
    Path,
    /// Primary-sample Metropolis light transport (Kelemen et al. 2002), normalised by independent samples beforehand.
    #[serde(rename = "mlt")]
    Mlt,
    /// Replica exchange.
    #[default]
    #[serde(rename = "re")]
    ReplicaExchange,
}

impl Method {
    /// All methods, simplest first.
    pub const ALL: [Method; 3] = [Method::Path, Method::Mlt, Method::ReplicaExchange];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Method::Path => "path",
            Method::Mlt => "mlt",
            Method::ReplicaExchange => "re",
        }
    }
}

/// Where `mlt` has its normalisation c from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Normalisation {
    /// The mean of g over the first pass alone. The image is unbiased, as chains start from states resampled among the
    /// same samples (Veach & Guibas 1997), and keeps the error of c however long the chains run.
    #[default]
    TwoPass,
    /// The mean of g over the first pass and all proposals of large steps, which are independent uniform samples as
    /// well. The error of c falls like the chains'; the image is biased by O(1/N), since c and the chains' mean come of
    /// the same steps, and consistent.
    Pooled,
}

impl Normalisation {
    /// Both.
    pub const ALL: [Normalisation; 2] = [Normalisation::TwoPass, Normalisation::Pooled];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Normalisation::TwoPass => "two-pass",
            Normalisation::Pooled => "pooled",
        }
    }
}

/// What may be chosen about `mlt`.
///
/// relMSE at 64 mutations per pixel, median of three seeds, as two-pass / pooled / pooled with Kelemen's weights:
///
/// | p | `cornell-box` | `caustic` | `lattice` |
/// |---|---|---|---|
/// | 0.1 | 0.0168 / 0.0162 / 0.0140 | 1.21 / 1.24 / 1.23 | 1.31 / 1.28 / 1.28 |
/// | 0.3 | 0.0168 / 0.0165 / 0.0121 | 1.51 / 1.53 / 1.52 | 1.48 / 1.49 / 1.48 |
/// | 0.5 | 0.0185 / 0.0185 / 0.0120 | 1.80 / 1.84 / 1.84 | 1.95 / 1.88 / 1.87 |
///
/// Pooling takes out the error of brightness, up to 6 % here, which relMSE hardly minds beside noise of this size.
/// The weights change only what samples with g/c up to about p add: much of the box, little of the others' noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MltSettings {
    /// Probability of a large step, in (0, 1).
    pub large_steps: f64,
    /// Where c comes from.
    pub normalisation: Normalisation,
    /// Whether proposals of large steps enter the image as uniform samples; see
    /// [`LargeSteps`](crate::chain::LargeSteps::kelemen_weights).
    pub kelemen_weights: bool,
}

impl Default for MltSettings {
    /// The paper's baseline.
    fn default() -> MltSettings {
        MltSettings {
            large_steps: LARGE_STEP_PROBABILITY,
            normalisation: Normalisation::default(),
            kelemen_weights: false,
        }
    }
}

/// How points of the cube become light paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MappingChoice {
    /// What a short trial on the scene finds best.
    #[default]
    Auto,
    /// Always this one.
    Fixed(MappingKind),
}

impl MappingChoice {
    /// All of them.
    pub const ALL: [MappingChoice; 1 + MappingKind::ALL.len()] = {
        let mut all = [MappingChoice::Auto; 1 + MappingKind::ALL.len()];
        let mut i = 0;
        while i < MappingKind::ALL.len() {
            all[i + 1] = MappingChoice::Fixed(MappingKind::ALL[i]);
            i += 1;
        }
        all
    };

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            MappingChoice::Auto => "auto",
            MappingChoice::Fixed(kind) => kind.name(),
        }
    }
}

impl Serialize for MappingChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// How many rays go to Embree at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PacketChoice {
    /// What a short calibration at start finds fastest.
    #[default]
    Auto,
    /// Always this many.
    Fixed(Width),
}

impl<'de> Deserialize<'de> for MappingChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<MappingChoice, D::Error> {
        named(deserializer, &MappingChoice::ALL, |choice| choice.name())
    }
}

/// The one of `all` that a text names.
fn named<'de, T: Copy, D: Deserializer<'de>>(
    deserializer: D,
    all: &[T],
    name: fn(&T) -> &'static str,
) -> Result<T, D::Error> {
    let text = String::deserialize(deserializer)?;
    all.iter().find(|one| name(one) == text).copied().ok_or_else(|| D::Error::custom(format_args!("unknown: {text}")))
}

impl PacketChoice {
    /// All of them.
    pub const ALL: [PacketChoice; 5] = [
        PacketChoice::Auto,
        PacketChoice::Fixed(Width::W1),
        PacketChoice::Fixed(Width::W4),
        PacketChoice::Fixed(Width::W8),
        PacketChoice::Fixed(Width::W16),
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            PacketChoice::Auto => "auto",
            PacketChoice::Fixed(Width::W1) => "1",
            PacketChoice::Fixed(Width::W4) => "4",
            PacketChoice::Fixed(Width::W8) => "8",
            PacketChoice::Fixed(Width::W16) => "16",
        }
    }
}

impl<'de> Deserialize<'de> for PacketChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<PacketChoice, D::Error> {
        named(deserializer, &PacketChoice::ALL, |choice| choice.name())
    }
}

impl Serialize for PacketChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// Everything about a run but its scene and its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// How the image is estimated.
    pub method: Method,
    /// From primary samples to light paths.
    pub mapping: MappingChoice,
    /// Of all random numbers; the same seed gives the same image for the same budget in mutations.
    pub seed: u64,
    /// Into how many independent parts the job is cut, and which of them is run.
    #[serde(default)]
    pub parts: Parts,
    /// Worker threads; as many as there are for this process ([`allocation::threads`](super::allocation::threads)) where
    /// absent.
    pub threads: Option<usize>,
    /// Keep every worker on a core of its own.
    pub pin: bool,
    /// Budget in mutations per pixel, independent samples included.
    pub mutations_per_pixel: Option<f64>,
    /// Budget in wall time, seconds in the log.
    #[serde(serialize_with = "seconds", deserialize_with = "from_seconds")]
    pub time: Option<Duration>,
    /// Inverse temperatures, for replica exchange.
    pub ladder: LadderChoice,
    /// Combination of the rungs, for replica exchange.
    pub combine: Combine,
    /// Share of evaluations that are uniform points, for replica exchange; tuned where absent.
    pub uniform_share: Option<f64>,
    /// The error that replica exchange is to make small.
    pub measure: Measure,
    /// Write every rung's part of the image, for replica exchange.
    pub layers: bool,
    /// Chains on the multiplexed mapping change the techniques of their paths.
    pub technique_changes: bool,
    /// Large steps and their use, for `mlt`.
    pub mlt: MltSettings,
    /// Rays at a time.
    pub packet: PacketChoice,
}

/// Budget of a run that states none.
pub const DEFAULT_MUTATIONS_PER_PIXEL: f64 = 64.0;

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            method: Method::default(),
            mapping: MappingChoice::default(),
            seed: 0,
            parts: Parts::default(),
            threads: None,
            pin: false,
            mutations_per_pixel: Some(DEFAULT_MUTATIONS_PER_PIXEL),
            time: None,
            ladder: LadderChoice::default(),
            combine: Combine::default(),
            uniform_share: None,
            measure: Measure::default(),
            layers: false,
            technique_changes: false,
            mlt: MltSettings::default(),
            packet: PacketChoice::default(),
        }
    }
}

/// Rungs at most: every thread keeps a batch of chains for each.
const MOST_REPLICAS: u32 = 1024;
/// Mutations per pixel at most: what the film is sure to hold.
const MOST_MUTATIONS_PER_PIXEL: f64 = 1e9;
/// Beyond this a time is a slip of the keyboard.
const LONGEST: Duration = Duration::from_secs(365 * 24 * 3600);
/// Threads at most; no machine we know has more.
const MOST_THREADS: usize = 4096;

impl Settings {
    /// What is chosen about replica exchange.
    pub fn ladder_choices(&self) -> Choices {
        Choices {
            ladder: self.ladder.clone(),
            combine: self.combine,
            uniform_share: self.uniform_share,
            measure: self.measure,
            layers: self.layers,
        }
    }

    /// The mapping of a scene as the method needs it, in a run that was planned for so many mutations per pixel.
    pub fn mapping<'s>(
        &self,
        scene: &'s Scene,
        kind: MappingKind,
        widths: Widths,
        planned: Option<f64>,
    ) -> Mapping<'s> {
        let pixels = u64::from(scene.film.width) * u64::from(scene.film.height);
        // the images of single rungs have what their own states find, and nothing of open points
        let views_left_open = self.leaves_open(planned, pixels) && !self.layers;
        Mapping::new(scene, kind, widths)
            .with_technique_changes(self.technique_changes)
            .with_views_left_open(views_left_open)
    }

    /// Whether stratified points leave [open](Choices::opens) what they choose, where they choose.
    pub fn leaves_open(&self, planned: Option<f64>, pixels: u64) -> bool {
        let evaluations = self.parts.mutations(planned, pixels);
        self.method == Method::ReplicaExchange && self.ladder_choices().opens(evaluations, pixels)
    }

    /// The inverse temperatures that were asked for by number; none where relt places them.
    pub fn betas_given(&self) -> &[f64] {
        match (&self.method, &self.ladder) {
            (Method::ReplicaExchange, LadderChoice::Betas(betas)) => betas,
            _ => &[],
        }
    }

    /// The options of the command line that repeat the run but for threads, packets and files, with the mapping that was
    /// settled on.
    pub fn options(&self, mapping: MappingKind) -> Vec<String> {
        let mut options = vec![format!("--method {}", self.method.name()), format!("--mapping {}", mapping.name())];
        let mut add =
            |name: &str, value: Option<String>| options.extend(value.map(|value| format!("--{name} {value}")));
        let defaults = Settings::default();
        let differs = |differs: bool, value: &str| differs.then(|| value.to_owned());
        match (self.method, &self.ladder) {
            (Method::ReplicaExchange, LadderChoice::Replicas(k)) => add("replicas", Some(k.to_string())),
            (Method::ReplicaExchange, LadderChoice::Betas(betas)) => {
                let betas: Vec<String> = betas.iter().map(f64::to_string).collect();
                add("betas", Some(betas.join(",")));
            }
            _ => {}
        }
        if self.method == Method::ReplicaExchange {
            add("combine", differs(self.combine != defaults.combine, self.combine.name()));
            add("uniform-share", self.uniform_share.map(|share| share.to_string()));
            add("error", differs(self.measure != defaults.measure, self.measure.name()));
        }
        if self.method == Method::Mlt {
            let MltSettings { large_steps, normalisation, kelemen_weights } = self.mlt;
            add("large-steps", differs(large_steps != defaults.mlt.large_steps, &large_steps.to_string()));
            add("normalisation", differs(normalisation != defaults.mlt.normalisation, normalisation.name()));
            add("kelemen-weights", differs(kelemen_weights, ""));
        }
        add("technique-changes", differs(self.technique_changes, "on"));
        add("mpp", self.mutations_per_pixel.map(|mpp| mpp.to_string()));
        add("time", self.time.map(|time| humantime::format_duration(time).to_string().replace(' ', "")));
        add("seed", Some(self.seed.to_string()));
        options.iter().map(|option| option.trim_end().to_owned()).collect()
    }

    /// Every contradiction, one sentence each in the words of the command line; none if the settings make sense.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if self.method == Method::ReplicaExchange {
            match &self.ladder {
                LadderChoice::Auto => {}
                LadderChoice::Replicas(k) => faults.extend(replicas_fault(*k)),
                LadderChoice::Betas(betas) => betas_faults(betas, &mut faults),
            }
            faults.extend(self.uniform_share.and_then(uniform_share_fault));
        }
        if self.method == Method::Mlt {
            faults.extend(large_steps_fault(self.mlt.large_steps));
        }
        faults.extend(parts_fault(self.parts));
        self.budget_faults(&mut faults);
        if let Some(threads) = self.threads.filter(|n| !(1..=MOST_THREADS).contains(n)) {
            faults.push(format!("--threads {threads}: a run needs 1 to {MOST_THREADS} threads"));
        }
        faults
    }

    /// [`faults`](Settings::faults) as an error.
    pub fn validate(&self) -> Result<(), Vec<String>> {
        match self.faults() {
            faults if faults.is_empty() => Ok(()),
            faults => Err(faults),
        }
    }

    fn budget_faults(&self, faults: &mut Vec<String>) {
        if self.mutations_per_pixel.is_none() && self.time.is_none() {
            faults.push("the run would never end: give --mpp, --time or both".into());
        }
        match self.mutations_per_pixel {
            Some(mpp) if mpp <= 0.0 || mpp.is_nan() => {
                faults.push(format!("--mpp {mpp}: the number of mutations per pixel must be above 0"));
            }
            Some(mpp) if mpp > MOST_MUTATIONS_PER_PIXEL => {
                faults.push(format!("--mpp {mpp}: at most {MOST_MUTATIONS_PER_PIXEL:e} mutations per pixel"));
            }
            _ => {}
        }
        match self.time {
            Some(Duration::ZERO) => faults.push("--time 0s: the time must be above 0".into()),
            Some(time) if time > LONGEST => faults.push("--time: more than a year is surely a mistake".into()),
            _ => {}
        }
    }
}

fn parts_fault(Parts { of, only }: Parts) -> Option<String> {
    match only {
        _ if of == 0 => Some("--parts 0: a job has one part at least".into()),
        _ if of > Parts::MOST => Some(format!("--parts {of}: at most {} parts", Parts::MOST)),
        Some(only) if !(1..=of).contains(&only) => Some(format!("--part {only}/{of}: parts are 1 to {of}")),
        _ => None,
    }
}

fn replicas_fault(k: u32) -> Option<String> {
    match k {
        0 => Some(
            "--replicas 0: the number counts the uniform replica, which is always there; 1 is uniform sampling alone"
                .into(),
        ),
        1..=MOST_REPLICAS => None,
        _ => Some(format!("--replicas {k}: at most {MOST_REPLICAS} replicas")),
    }
}

fn uniform_share_fault(share: f64) -> Option<String> {
    let accepted = share > 0.0 && share < 1.0;
    (!accepted).then(|| {
        format!(
            "--uniform-share {share}: the share must be above 0, or nothing normalises the image, and below 1; for uniform \
             sampling alone use --method path"
        )
    })
}

fn betas_faults(betas: &[f64], faults: &mut Vec<String>) {
    let mut fault = |what: String| faults.push(format!("--betas: {what}"));
    if !(2..=MOST_REPLICAS as usize).contains(&betas.len()) {
        fault(format!("{} given; a ladder has 2 to {MOST_REPLICAS} inverse temperatures", betas.len()));
    }
    for beta in betas.iter().filter(|beta| !(0.0..=1.0).contains(*beta)) {
        fault(format!("{beta} is outside [0, 1]"));
    }
    for pair in betas.windows(2).filter(|pair| pair[0].partial_cmp(&pair[1]) != Some(Ordering::Less)) {
        fault(format!("{} after {} does not rise; the order is from 0 (uniform) to 1 (the image)", pair[1], pair[0]));
    }
    if betas.first().is_some_and(|first| *first != 0.0) {
        fault(format!("the first is {} and must be 0, the uniform replica", betas[0]));
    }
    if betas.last().is_some_and(|last| *last != 1.0) {
        fault(format!("the last is {} and must be 1, the image itself", betas[betas.len() - 1]));
    }
}

fn large_steps_fault(p: f64) -> Option<String> {
    let accepted = p > 0.0 && p < 1.0;
    (!accepted).then(|| {
        format!(
            "--large-steps {p}: the probability must be above 0, or chains stay where they began, and below 1, or they \
             never explore; for uniform sampling alone use --method path"
        )
    })
}

fn seconds<S: Serializer>(time: &Option<Duration>, serializer: S) -> Result<S::Ok, S::Error> {
    time.map(|time| time.as_secs_f64()).serialize(serializer)
}

fn from_seconds<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Duration>, D::Error> {
    let seconds: Option<f64> = Deserialize::deserialize(deserializer)?;
    seconds.map(|seconds| Duration::try_from_secs_f64(seconds).map_err(D::Error::custom)).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(change: impl FnOnce(&mut Settings)) -> String {
        let mut settings = Settings::default();
        change(&mut settings);
        settings.faults().join("\n")
    }

    #[test]
    fn the_defaults_make_sense() {
        assert_eq!(Settings::default().validate(), Ok(()));
    }

    #[test]
    fn a_ladder_has_the_uniform_replica_at_least() {
        assert!(faults(|s| s.ladder = LadderChoice::Replicas(0)).contains("counts the uniform replica"));
        for k in [1, 2, 1024] {
            assert_eq!(faults(|s| s.ladder = LadderChoice::Replicas(k)), "");
        }
        assert!(faults(|s| s.ladder = LadderChoice::Replicas(1025)).contains("at most 1024"));
    }

    #[test]
    fn inverse_temperatures_rise_from_0_to_1() {
        let of = |betas: &[f64]| faults(|s| s.ladder = LadderChoice::Betas(betas.to_vec()));
        assert_eq!(of(&[0.0, 1.0]), "");
        assert_eq!(of(&[0.0, 0.25, 0.5, 1.0]), "");
        assert!(of(&[]).contains("0 given"));
        assert!(of(&[1.0]).contains("1 given"));
        assert!(of(&[0.1, 1.0]).contains("the first is 0.1"));
        assert!(of(&[0.0, 0.9]).contains("the last is 0.9"));
        assert!(of(&[0.0, 0.5, 0.5, 1.0]).contains("0.5 after 0.5 does not rise"));
        assert!(of(&[0.0, 1.5, 1.0]).contains("1.5 is outside [0, 1]"));
        assert!(of(&[0.0, f64::NAN, 1.0]).contains("NaN is outside [0, 1]"));
        // All faults in one go.
        assert_eq!(of(&[-1.0, 2.0, 0.5]).lines().count(), 5);
    }

    #[test]
    fn the_uniform_rung_has_some_share_but_not_all() {
        for share in [0.0, 1.0, -0.5, f64::NAN] {
            assert!(faults(|s| s.uniform_share = Some(share)).contains("--uniform-share"), "{share}");
        }
        assert_eq!(faults(|s| s.uniform_share = Some(0.75)), "");
    }

    #[test]
    fn a_ladder_is_of_no_account_to_other_methods() {
        let message = faults(|s| {
            s.method = Method::Mlt;
            s.ladder = LadderChoice::Replicas(0);
        });
        assert_eq!(message, "");
    }

    #[test]
    fn some_steps_are_large_and_some_are_small() {
        let of = |method, p| {
            faults(|s| {
                s.method = method;
                s.mlt.large_steps = p;
            })
        };
        for p in [f64::MIN_POSITIVE, 0.5, 1.0 - f64::EPSILON] {
            assert_eq!(of(Method::Mlt, p), "");
        }
        for p in [0.0, 1.0, -0.1, 2.0, f64::NAN, f64::INFINITY] {
            let message = of(Method::Mlt, p);
            assert!(message.contains(&format!("--large-steps {p}: ")) && message.contains("above 0"), "{message}");
            assert_eq!(of(Method::ReplicaExchange, p), "", "of no account to other methods");
        }
    }

    #[test]
    fn budgets_are_positive_and_one_of_them_is_there() {
        for mpp in [0.0, -1.0, f64::NAN, f64::NEG_INFINITY] {
            assert!(faults(|s| s.mutations_per_pixel = Some(mpp)).contains("must be above 0"), "{mpp}");
        }
        assert!(faults(|s| s.mutations_per_pixel = Some(f64::INFINITY)).contains("at most 1e9"));
        assert!(faults(|s| s.mutations_per_pixel = None).contains("never end"));
        assert!(faults(|s| s.time = Some(Duration::ZERO)).contains("above 0"));
        assert!(faults(|s| s.time = Some(Duration::MAX)).contains("more than a year"));
        assert_eq!(faults(|s| s.time = Some(Duration::from_millis(1))), "");
    }

    #[test]
    fn at_least_one_thread_works() {
        assert!(faults(|s| s.threads = Some(0)).contains("1 to 4096 threads"));
        assert!(faults(|s| s.threads = Some(4097)).contains("1 to 4096 threads"));
        assert_eq!(faults(|s| s.threads = Some(1)), "");
    }
}
