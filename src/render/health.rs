//! Whether a run can be trusted, in a verdict and in words: what is wrong, and what to do about it.
//!
//! All evidence is gathered anyway, by rounds of replica exchange ([`RoundReport`]), by chains of `mlt` ([`ChainReport`])
//! and by the estimate of the normalisation; it is judged once, when the run is over. Nothing is said of a healthy run.

use serde::Serialize;

use super::settings::{LadderChoice, Method, Normalisation, Settings};
use super::status::Status;
use crate::tempering::{Mixing, RoundReport, effective_samples, rungs};

/// How far a run can be trusted, best first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing speaks against it.
    #[default]
    Good,
    /// The picture is of use, and could be much better.
    Doubtful,
    /// The picture is wrong, or nobody can say that it is not.
    Bad,
}

impl Verdict {
    /// Name in logs and pictures.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Good => "good",
            Verdict::Doubtful => "doubtful",
            Verdict::Bad => "bad",
        }
    }

    /// Bad from one limit on, doubtful from another that is reached earlier; `None` before both.
    fn from(value: f64, doubtful: f64, bad: f64) -> Option<Verdict> {
        let beyond = |limit: f64| if doubtful <= bad { value >= limit } else { value <= limit };
        match (beyond(doubtful), beyond(bad)) {
            (_, true) => Some(Verdict::Bad),
            (true, _) => Some(Verdict::Doubtful),
            _ => None,
        }
    }
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub verdict: Verdict,
    /// What was seen.
    pub what: String,
    /// What helps.
    pub advice: String,
}

/// What is to be said of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Health {
    /// That of the worst finding.
    pub verdict: Verdict,
    /// What is wrong, worst first; nothing where the run is healthy.
    pub findings: Vec<Finding>,
}

impl Health {
    /// `bad: rungs 3 and 4 exchange 2 % of …: use --replicas 12`, a line each; none for a healthy run.
    pub fn lines(&self) -> Vec<String> {
        let line = |f: &Finding| format!("{}: {}: {}", f.verdict.name(), f.what, f.advice);
        self.findings.iter().map(line).collect()
    }
}

/// What chains without a ladder tell of themselves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChainReport {
    /// Steps of each chain.
    pub steps: u64,
    /// Mean acceptance probability of small steps; NaN where there were none.
    pub acceptance: f64,
    /// Most steps in a row that one chain refused.
    pub longest_rejection_run: u64,
    /// How far blocks of chains agree, as of rounds.
    pub mixing: Mixing,
}

/// What a run is judged by.
pub struct Evidence<'a> {
    /// What was asked for.
    pub settings: &'a Settings,
    /// Where it stood at its end; with its normalisation.
    pub status: &'a Status,
    /// Pixels of the film.
    pub pixels: u64,
    /// The round of a ladder that knows most, if there is a ladder.
    pub round: Option<&'a RoundReport>,
    /// Chains without a ladder.
    pub chains: Option<&'a ChainReport>,
    /// Uniform points contradict all samples together.
    pub contradiction: bool,
}

/// Relative standard error of the normalisation, which is that of the picture's brightness: a tenth is plain to the eye; at
/// 0.3 the estimate is made by a handful of samples, and its error as little known as itself.
const BRIGHTNESS: [f64; 2] = [0.1, 0.3];
/// Mutations a pixel below which pixels go without any.
const FEWEST_A_PIXEL: f64 = 1.0;
/// Share of paths with contributions that are not finite: any is a fault, and a thousandth of all light is missed.
const NON_FINITE_BAD: f64 = 1e-3;
/// Acceptance of swaps of lit states. Neighbours at equal rejection accept half and more where the number of rungs is free;
/// round trips take longer in proportion to 1/acceptance, so that a pair with a twentieth spoils the ladder by itself.
const SWAPS: [f64; 2] = [0.15, 0.05];
/// Round trips that must be expected for their absence to say anything: with 20, chance leaves out all with e⁻²⁰.
const ROUND_TRIPS_EXPECTED: f64 = 20.0;
/// Part of the expected round trips below which states get lost on the way.
const ROUND_TRIPS_SHARE: f64 = 0.1;
/// Share of its steps that one chain refused in a row. On the shipped scenes ladders of the automatic length stay below 0.15,
/// while `caustic` with two replicas has 0.4. One chain of many spoils one place, so this is never more than doubtful.
const STUCK: f64 = 0.25;
/// Steps in a row from which a chain may be called stuck: a 16th of a pixel's steps at 64 mutations per pixel and 64 blocks
/// of chains, and much more than chains refuse in a row by chance at the acceptances that are chosen.
const STUCK_LEAST: u64 = 256;
/// Independent states that all chains on the target are worth: 100 leave an error of a tenth to everything that they say, 30
/// one of a fifth.
const EFFECTIVE: [f64; 2] = [100.0, 30.0];
/// Mean acceptance of small steps of chains without a ladder. Metropolis chains are most efficient with a quarter to a half
/// of their steps accepted (Roberts et al. 1997); with 2 % they stand still for fifty steps on the average.
const ACCEPTANCE: [f64; 2] = [0.05, 0.02];
/// Share of the image that tempered states carry from which on their ailments matter.
const TEMPERED_SHARE: f64 = 0.05;

/// Judges a run.
pub fn judge(evidence: &Evidence) -> Health {
    let mut findings = Vec::new();
    let mut find = |verdict: Option<Verdict>, what: String, advice: &str| {
        findings.extend(verdict.map(|verdict| Finding { verdict, what, advice: advice.into() }));
    };
    brightness(evidence, &mut find);
    non_finite(evidence, &mut find);
    ladder(evidence, &mut find);
    chains(evidence, &mut find);
    findings.sort_by_key(|finding: &Finding| std::cmp::Reverse(finding.verdict));
    let verdict = findings.first().map_or(Verdict::Good, |finding| finding.verdict);
    Health { verdict, findings }
}

/// Takes what is wrong, if it is.
type Find<'a> = &'a mut dyn FnMut(Option<Verdict>, String, &str);

/// Samples enough for every pixel, and a normalisation that is known.
fn brightness(evidence: &Evidence, find: Find) {
    let &Evidence { settings, status, pixels, .. } = evidence;
    let a_pixel = status.mutations as f64 / pixels as f64;
    let verdict = (a_pixel < FEWEST_A_PIXEL).then_some(Verdict::Bad);
    let what = format!("{a_pixel:.2} mutations per pixel leave pixels without any");
    find(verdict, what, "render longer: a higher --mpp or --time");
    let Some((value, error)) = status.normalisation else { return };
    if value == 0.0 {
        let other = "look at the scene, or try another --mapping";
        find(Some(Verdict::Bad), "no independent path met light".into(), other);
        return;
    }
    let relative = error / value;
    let verdict =
        if relative.is_finite() { Verdict::from(relative, BRIGHTNESS[0], BRIGHTNESS[1]) } else { Some(Verdict::Bad) };
    let what = match relative.is_finite() {
        true => format!("the brightness of the picture is known to {:.0} % only", 100.0 * relative),
        false => "the error of the picture's brightness is not known".into(),
    };
    let first_pass = settings.method == Method::Mlt && settings.mlt.normalisation == Normalisation::TwoPass;
    find(
        verdict,
        what,
        match first_pass {
            true => "let large steps help with it by --normalisation pooled, or use --method re",
            false => "render longer, or with another --mapping",
        },
    );
    let verdict = evidence.contradiction.then_some(Verdict::Doubtful);
    let what = "uniform points contradict the chains, which may miss light".into();
    find(verdict, what, "render longer, or compare with --method path");
}

/// Contributions that were left out.
fn non_finite(evidence: &Evidence, find: Find) {
    let status = evidence.status;
    let share = status.non_finite as f64 / status.mutations.max(1) as f64;
    let verdict = Verdict::from(share, f64::MIN_POSITIVE, NON_FINITE_BAD);
    let what = format!("{} contributions ({:.1e} a path) were not finite and are missing", status.non_finite, share);
    find(verdict, what, "see where relt replay says that they arise, and make lights or scales there less extreme");
}

/// Rungs that exchange, states that travel, chains that move and agree.
fn ladder(evidence: &Evidence, find: Find) {
    let &Evidence { settings, round, .. } = evidence;
    if settings.method != Method::ReplicaExchange {
        return;
    }
    let asked = !matches!(settings.ladder, LadderChoice::Auto | LadderChoice::Replicas(1));
    let Some(round) = round.filter(|round| !round.rungs.is_empty()) else {
        let verdict = (asked && evidence.status.last_round.is_none()).then_some(Verdict::Doubtful);
        find(verdict, "the run ended before any chain started: this is path tracing".into(), "render longer");
        return;
    };
    let tempered: f64 = round.rungs[1..].iter().map(|rung| rung.image_share).sum();
    if tempered < TEMPERED_SHARE {
        return;
    }
    swaps(evidence, round, find);
    trips(round, find);
    let steps = round.rungs[round.rungs.len() - 1].evaluations / round.ladders.max(1) as u64;
    let wanted = recommended(round);
    let advice = if wanted > round.replicas {
        format!("use --replicas {wanted}, so that swaps free it sooner, or render longer")
    } else {
        "render longer".into()
    };
    stuck(round.longest_rejection_run, steps, &advice, find);
    let mixing =
        Mixing { r_hat_ln_g: round.split_r_hat, r_hat_film: round.split_r_hat_image, halves: round.r_hat_halves };
    effective(&mixing, "ladders", "render longer, or with fewer --replicas", find);
}

/// Neighbours that refuse to swap.
fn swaps(evidence: &Evidence, round: &RoundReport, find: Find) {
    for (k, rejection) in round.rejection.iter().enumerate() {
        // the first pair's rejections count dark offers as well, which no number of rungs would change
        let lit = if k == 0 { round.lit_share.max(f64::MIN_POSITIVE) } else { 1.0 };
        let of = |rejection: f64| ((1.0 - rejection) / lit).min(1.0);
        let accepted = of(*rejection);
        let Some(verdict) = Verdict::from(accepted, SWAPS[0], SWAPS[1]) else { continue };
        let predicted = round.predicted_rejection.get(k).map_or(f64::NAN, |rejection| of(*rejection));
        let what = format!("rungs {} and {} accept {:.1} % of their swaps", k + 1, k + 2, 100.0 * accepted);
        let wanted = recommended(round);
        let advice = match evidence.settings.ladder {
            // more rungs would help, did states between swaps not stay where they are
            _ if predicted > 2.0 * SWAPS[0] => {
                format!(
                    "independent states would accept {:.0} %, so chains hardly move: render longer",
                    100.0 * predicted
                )
            }
            LadderChoice::Betas(_) => format!("let relt place the rungs: --replicas {wanted} in the place of --betas"),
            _ => format!("use --replicas {}", wanted.max(round.replicas + 1)),
        };
        find(Some(verdict), what, &advice);
    }
}

/// Replicas with which neighbours at equal rejection reject about half of their swaps.
fn recommended(round: &RoundReport) -> usize {
    if round.barrier.is_finite() { rungs(round.barrier).max((2.0 * round.barrier).ceil() as usize + 1) } else { 0 }
}

/// States that come from the uniform rung to the target and back.
fn trips(round: &RoundReport, find: Find) {
    let (trips, expected) = (round.round_trips as f64, round.round_trips_predicted);
    if expected >= ROUND_TRIPS_EXPECTED && trips < ROUND_TRIPS_SHARE * expected {
        let verdict = if trips == 0.0 { Verdict::Bad } else { Verdict::Doubtful };
        let what = format!("{trips} round trips along the ladder, where {expected:.0} are to be expected");
        find(Some(verdict), what, "render longer; if that does not help, with another --mapping");
    } else if round.restarts == 0 {
        let what = "no uniform point has come as far as the target, whose chains are where they started".into();
        find(Some(Verdict::Doubtful), what, "render longer, or with fewer --replicas");
    }
}

/// A chain that refuses all that it is offered.
fn stuck(longest: u64, steps: u64, advice: &str, find: Find) {
    let stuck = longest >= STUCK_LEAST && longest as f64 >= STUCK * steps as f64;
    let what = format!(
        "a chain refused {longest} mutations in a row (of late, chains made {steps} steps), which may leave a bright dot"
    );
    find(stuck.then_some(Verdict::Doubtful), what, advice);
}

/// Few independent states, by what tells of fewer: how bright they are, or where they are.
fn effective(mixing: &Mixing, of: &str, advice: &str, find: Find) {
    let told = [(mixing.r_hat_ln_g, "ln g"), (mixing.r_hat_film, "image blocks")];
    // the larger R̂ is that of fewer states; one that is not known says nothing
    let known = told.into_iter().filter(|(r_hat, _)| !r_hat.is_nan());
    let Some((r_hat, what)) = known.max_by(|a, b| a.0.total_cmp(&b.0)) else { return };
    let effective = effective_samples(r_hat, mixing.halves);
    let verdict = Verdict::from(effective, EFFECTIVE[0], EFFECTIVE[1]);
    let what = format!(
        "all chains on the target are worth {effective:.0} independent states (split R̂ of {what} over {of} {r_hat:.3})"
    );
    find(verdict, what, advice);
}

/// Chains of `mlt`.
fn chains(evidence: &Evidence, find: Find) {
    let Some(chains) = evidence.chains.filter(|chains| chains.steps > 0) else { return };
    let accepted = Verdict::from(chains.acceptance, ACCEPTANCE[0], ACCEPTANCE[1]);
    let what = format!("chains accept {:.1} % of their small steps", 100.0 * chains.acceptance);
    find(accepted, what, "use --method re, which makes steps as small as the scene needs");
    stuck(chains.longest_rejection_run, chains.steps, "use --method re, whose ladder frees it, or render longer", find);
    effective(&chains.mixing, "blocks", "render longer, or use --method re", find);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tempering::RungReport;

    /// A round of four rungs that nothing is wrong with.
    fn round() -> RoundReport {
        let rung = |k: usize| RungReport {
            evaluations: 10_000 * 64,
            image_share: 0.25,
            beta: k as f64 / 3.0,
            ..RungReport::default()
        };
        RoundReport {
            ladders: 64,
            replicas: 4,
            lit_share: 0.02,
            barrier: 1.4,
            rejection: vec![0.99, 0.4, 0.45],
            predicted_rejection: vec![0.99, 0.4, 0.45],
            round_trips: 900,
            restarts: 1000,
            round_trips_predicted: 1000.0,
            longest_rejection_run: 300,
            split_r_hat: 1.01,
            split_r_hat_image: 1.01,
            r_hat_halves: 128,
            rungs: (0..4).map(rung).collect(),
            ..RoundReport::default()
        }
    }

    fn chain_report() -> ChainReport {
        let mixing = Mixing { r_hat_ln_g: 1.01, r_hat_film: 1.01, halves: 128 };
        ChainReport { steps: 4096, acceptance: 0.4, longest_rejection_run: 200, mixing }
    }

    fn status() -> Status {
        Status { mutations: 64_000, normalisation: Some((2.0, 0.02)), ..Status::default() }
    }

    fn settings(method: Method) -> Settings {
        Settings { method, ladder: LadderChoice::Replicas(4), ..Settings::default() }
    }

    fn judged(settings: &Settings, status: &Status, round: &RoundReport, chains: Option<&ChainReport>) -> Health {
        judge(&Evidence { settings, status, pixels: 1000, round: Some(round), chains, contradiction: false })
    }

    fn of_round(change: impl FnOnce(&mut RoundReport)) -> Health {
        let mut round = round();
        change(&mut round);
        judged(&settings(Method::ReplicaExchange), &status(), &round, None)
    }

    /// The verdict, and that there is one finding with these words.
    fn assert_told(health: &Health, verdict: Verdict, what: &str, advice: &str) {
        let [finding] = &health.findings[..] else { panic!("{health:?}") };
        assert_eq!((health.verdict, finding.verdict), (verdict, verdict), "{health:?}");
        assert!(finding.what.contains(what) && finding.advice.contains(advice), "{finding:?}");
        assert_eq!(health.lines().len(), 1);
        assert!(health.lines()[0].starts_with(verdict.name()));
    }

    #[test]
    fn nothing_is_said_of_healthy_runs() {
        assert_eq!(of_round(|_| ()), Health::default());
        for method in [Method::Path, Method::Mlt] {
            let chains = Some(chain_report()).filter(|_| method == Method::Mlt);
            assert_eq!(
                judged(&settings(method), &status(), &RoundReport::default(), chains.as_ref()),
                Health::default()
            );
        }
    }

    #[test]
    fn rungs_that_do_not_exchange_are_named_with_a_ladder_that_does() {
        let health = of_round(|r| (r.rejection[2], r.predicted_rejection[2], r.barrier) = (0.98, 0.98, 5.2));
        assert_told(&health, Verdict::Bad, "rungs 3 and 4 accept 2.0 %", "use --replicas 12");
        let health = of_round(|r| (r.rejection[2], r.predicted_rejection[2]) = (0.9, 0.9));
        assert_told(&health, Verdict::Doubtful, "rungs 3 and 4 accept 10.0 %", "use --replicas 5");
        // dark offers do not count: 1 % of all is half of those with 2 % lit ones, 0.05 % is not
        let health = of_round(|r| (r.rejection[0], r.predicted_rejection[0]) = (0.9995, 0.9995));
        assert_told(&health, Verdict::Bad, "rungs 1 and 2 accept 2.5 %", "--replicas");
        let health = of_round(|r| r.rejection[1] = 0.97);
        assert_told(&health, Verdict::Bad, "rungs 2 and 3", "chains hardly move");
        let mut given = settings(Method::ReplicaExchange);
        given.ladder = LadderChoice::Betas(vec![0.0, 0.1, 0.2, 1.0]);
        let round =
            RoundReport { rejection: vec![0.99, 0.4, 0.98], predicted_rejection: vec![0.99, 0.4, 0.98], ..round() };
        assert_told(&judged(&given, &status(), &round, None), Verdict::Bad, "rungs 3 and 4", "place of --betas");
    }

    #[test]
    fn states_that_do_not_travel_are_told() {
        assert_told(&of_round(|r| r.round_trips = 0), Verdict::Bad, "0 round trips", "another --mapping");
        assert_told(&of_round(|r| r.round_trips = 50), Verdict::Doubtful, "50 round trips", "render longer");
        let short = |r: &mut RoundReport| (r.round_trips, r.restarts, r.round_trips_predicted) = (0, 0, 3.0);
        assert_told(&of_round(short), Verdict::Doubtful, "no uniform point", "fewer --replicas");
        let short = |r: &mut RoundReport| (r.round_trips, r.restarts, r.round_trips_predicted) = (0, 2, 3.0);
        assert_eq!(of_round(short), Health::default());
    }

    #[test]
    fn chains_that_stand_still_or_disagree_are_told() {
        assert_told(&of_round(|r| r.longest_rejection_run = 3000), Verdict::Doubtful, "refused 3000", "render longer");
        assert_told(&of_round(|r| r.longest_rejection_run = 7000), Verdict::Doubtful, "made 10000", "render longer");
        let few = |r: &mut RoundReport| (r.longest_rejection_run, r.barrier) = (3000, 3.4);
        assert_told(&of_round(few), Verdict::Doubtful, "refused 3000", "--replicas 8");
        // 128 halves: R̂² − 1 = 128/N
        assert_told(&of_round(|r| r.split_r_hat = 1.6), Verdict::Doubtful, "worth 82 independent", "render longer");
        assert_told(&of_round(|r| r.split_r_hat = 2.5), Verdict::Bad, "worth 24 independent", "fewer --replicas");
        assert_told(&of_round(|r| r.split_r_hat_image = 2.5), Verdict::Bad, "R̂ of image blocks", "fewer --replicas");
        assert_eq!(of_round(|r| (r.split_r_hat, r.split_r_hat_image) = (f64::NAN, f64::NAN)), Health::default());
    }

    #[test]
    fn ailments_of_chains_that_the_image_does_without_are_none() {
        let health = of_round(|r| {
            (r.round_trips, r.longest_rejection_run, r.split_r_hat, r.rejection[1]) = (0, 9000, 3.0, 1.0);
            r.rungs[1..].iter_mut().for_each(|rung| rung.image_share = 0.01);
        });
        assert_eq!(health, Health::default());
    }

    #[test]
    fn a_ladder_that_was_asked_for_and_never_raised_is_missed() {
        let none = RoundReport::default();
        let health = judged(&settings(Method::ReplicaExchange), &status(), &none, None);
        assert_told(&health, Verdict::Doubtful, "before any chain started", "render longer");
        let auto = Settings { ladder: LadderChoice::Auto, ..settings(Method::ReplicaExchange) };
        assert_eq!(judged(&auto, &status(), &none, None), Health::default());
    }

    #[test]
    fn chains_without_a_ladder_are_judged_alike() {
        let of = |change: fn(&mut ChainReport)| {
            let mut chains = chain_report();
            change(&mut chains);
            judged(&settings(Method::Mlt), &status(), &RoundReport::default(), Some(&chains))
        };
        assert_told(&of(|c| c.acceptance = 0.03), Verdict::Doubtful, "accept 3.0 %", "--method re");
        assert_told(&of(|c| c.acceptance = 0.01), Verdict::Bad, "accept 1.0 %", "--method re");
        assert_told(&of(|c| c.longest_rejection_run = 4000), Verdict::Doubtful, "refused 4000", "--method re");
        assert_told(&of(|c| c.mixing.r_hat_film = 2.5), Verdict::Bad, "worth 24", "--method re");
        assert_eq!(of(|c| (c.steps, c.longest_rejection_run) = (300, 200)), Health::default(), "too short to be stuck");
    }

    #[test]
    fn an_uncertain_brightness_and_missing_light_are_told_whatever_the_method() {
        for method in Method::ALL {
            let of = |change: fn(&mut Status)| {
                let mut status = status();
                change(&mut status);
                judged(&settings(method), &status, &round(), None)
            };
            let advice = if method == Method::Mlt { "--normalisation pooled" } else { "render longer" };
            assert_told(&of(|s| s.normalisation = Some((2.0, 0.4))), Verdict::Doubtful, "to 20 %", advice);
            assert_told(&of(|s| s.normalisation = Some((2.0, 0.8))), Verdict::Bad, "to 40 %", advice);
            assert_told(&of(|s| s.normalisation = Some((2.0, f64::NAN))), Verdict::Bad, "is not known", advice);
            assert_told(&of(|s| s.normalisation = Some((0.0, 0.0))), Verdict::Bad, "met light", "--mapping");
            assert_told(&of(|s| s.non_finite = 1), Verdict::Doubtful, "1 contributions", "relt replay");
            assert_told(&of(|s| s.non_finite = 640), Verdict::Bad, "640 contributions", "relt replay");
            assert_told(&of(|s| s.mutations = 500), Verdict::Bad, "0.50 mutations per pixel", "--mpp");
        }
        let (settings, status, round) = (settings(Method::ReplicaExchange), status(), round());
        let evidence = Evidence {
            settings: &settings,
            status: &status,
            pixels: 1000,
            round: Some(&round),
            chains: None,
            contradiction: true,
        };
        assert_told(&judge(&evidence), Verdict::Doubtful, "uniform points contradict", "--method path");
    }

    #[test]
    fn the_worst_comes_first() {
        let health = of_round(|r| (r.longest_rejection_run, r.round_trips) = (3000, 0));
        let verdicts: Vec<Verdict> = health.findings.iter().map(|finding| finding.verdict).collect();
        assert_eq!(verdicts, [Verdict::Bad, Verdict::Doubtful]);
        assert_eq!(health.verdict, Verdict::Bad);
    }
}
