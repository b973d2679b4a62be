//! The page: HTML that is well-formed XML as well, without anything from elsewhere.

use super::charts::{self, Chart, Styles};
use super::figures::{BEST, Cell, FLAG, Table, short_with};
use super::pictures::{Picture, colour_strip, embedded, pictures};
use super::tables;
use crate::render::progress::significant;
use crate::study::results::{Clock, Results, Run};
use crate::study::statistics::curves::{Against, error};
use crate::study::statistics::summary::summaries;
use crate::study::statistics::{SceneSummary, Spread};
use crate::study::svg::escaped;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("viewer.js");
/// Lets browsers take nothing from anywhere, whatever stands in the page.
const POLICY: &str = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// The whole page.
pub fn page(results: &Results) -> String {
    let summaries = summaries(results);
    let styles = Styles::of(results);
    let shown: Vec<_> = summaries.iter().map(|scene| pictures(scene.scene, scene.equal_time)).collect();
    let faults = shown.iter().flat_map(|(_, faults)| faults);
    let warnings: Vec<&String> = results.warnings.iter().chain(faults).collect();
    let scenes = summaries.iter().zip(&shown).enumerate();
    let scenes: Vec<String> =
        scenes.map(|(i, (scene, (pictures, _)))| scene_section(results, &styles, i, scene, pictures)).collect();
    let title = escaped(&results.title);
    [
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n".into(),
        format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\"/>\n"),
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n".into(),
        format!("<link rel=\"icon\" href=\"data:,\"/>\n<title>{title}</title>\n<style>\n{STYLE}</style>\n"),
        "</head>\n<body>\n<header>\n".into(),
        format!("<h1>{title}</h1>\n{}{}", paragraphs(&results.note), key_facts(results)),
        contents(&summaries),
        "</header>\n<main>\n".into(),
        warning_list(&warnings),
        summary_section(&styles, &summaries),
        scenes.concat(),
        method_section(results),
        explanation_section(results, &summaries),
        origin_section(results),
        format!("</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n"),
    ]
    .concat()
}

/// All charts, in the order of the page.
pub fn all_charts(results: &Results) -> Vec<Chart> {
    let styles = Styles::of(results);
    let of_scene = |scene: &SceneSummary| {
        let mut all: Vec<Chart> = charts::speed_ups(&styles, scene).into_iter().collect();
        all.extend(curves(results, &styles, scene));
        all.extend(charts::brightness(&styles, scene));
        all.extend(scaling_charts(&styles, scene));
        all
    };
    summaries(results).iter().flat_map(of_scene).collect()
}

fn curves(results: &Results, styles: &Styles, scene: &SceneSummary) -> Vec<Chart> {
    let against = [Against::Seconds, Against::Mutations];
    against.into_iter().filter_map(|against| charts::errors(results, styles, scene, against)).collect()
}

fn scaling_charts(styles: &Styles, scene: &SceneSummary) -> Vec<Chart> {
    let groups = scene.scalings.iter().enumerate();
    groups.flat_map(|(i, scaling)| charts::scaling(styles, scene, i, scaling)).collect()
}

fn paragraphs(text: &str) -> String {
    let paragraphs = text.split("\n\n").map(str::trim).filter(|paragraph| !paragraph.is_empty());
    paragraphs.map(|paragraph| format!("<p class=\"note\">{}</p>\n", escaped_lines(paragraph, " "))).collect()
}

/// Lines escaped one by one, for line ends do not survive escaping.
fn escaped_lines(text: &str, between: &str) -> String {
    text.lines().map(|line| escaped(line.trim_end())).collect::<Vec<_>>().join(between)
}

fn key_facts(results: &Results) -> String {
    let facts = [
        ("Budget", format!("{} a run", results.budget)),
        ("Seeds", seeds(results)),
        ("Baseline", results.baseline.clone()),
        ("Clock", clock(results).into()),
        ("Machine", if results.machines.is_empty() { "unknown".into() } else { results.machines.join("; ") }),
    ];
    let facts = facts.map(|(name, fact)| format!("<div><dt>{name}</dt><dd>{}</dd></div>\n", escaped(&fact)));
    format!("<dl class=\"facts\">\n{}</dl>\n", facts.concat())
}

fn clock(results: &Results) -> &'static str {
    match results.clock {
        Clock::Wall => "wall time",
        Clock::Cpu => "processor time of all threads over their number",
    }
}

/// `5 (1 to 5)`, or the least and greatest number of runs where methods differ.
fn seeds(results: &Results) -> String {
    let methods = || results.scenes.iter().flat_map(|scene| &scene.methods);
    let (least, most) =
        methods().map(|method| method.runs.len()).fold((usize::MAX, 0), |(least, most), n| (least.min(n), most.max(n)));
    let mut seeds: Vec<u64> = methods().flat_map(|method| &method.runs).map(|run| run.seed).collect();
    seeds.sort_unstable();
    seeds.dedup();
    let number = if least < most { format!("{least} to {most}") } else { most.to_string() };
    match (seeds.first(), seeds.last()) {
        (Some(first), Some(last)) if first < last => format!("{number} ({first} to {last})"),
        (Some(first), _) => format!("{number} ({first})"),
        _ => "none yet".into(),
    }
}

fn contents(summaries: &[SceneSummary]) -> String {
    let scenes = summaries.iter().enumerate();
    let links = scenes.map(|(i, scene)| format!("<a href=\"#scene-{i}\">{}</a>\n", escaped(&scene.scene.name)));
    format!(
        "<nav aria-label=\"Contents\">\n<a href=\"#summary\">Summary</a>\n{}<a href=\"#methods\">Methods</a>\n\
         <a href=\"#reading\">How to read this</a>\n<a href=\"#origin\">Origin</a>\n</nav>\n",
        links.collect::<String>()
    )
}

fn warning_list(warnings: &[&String]) -> String {
    if warnings.is_empty() {
        return String::new();
    }
    let items: String = warnings.iter().map(|warning| format!("<li>{}</li>\n", escaped(warning))).collect();
    format!("<aside class=\"warnings\">\n<h2>Warnings</h2>\n<ul>\n{items}</ul>\n</aside>\n")
}

fn summary_section(styles: &Styles, summaries: &[SceneSummary]) -> String {
    let tables: String = summaries.iter().map(|scene| table(&tables::summary(scene))).collect();
    let charts = summaries.iter().filter_map(|scene| charts::speed_ups(styles, scene));
    format!(
        "<section id=\"summary\">\n<h2>Summary</h2>\n{tables}<p class=\"legend\">√relMSE at the end of runs: median \
         over seeds (and largest over median). Speed-up: the baseline's time to reach that error over the method's \
         [95 % interval]. Efficiency: 1/(relMSE · seconds) at the end over the baseline's. {BEST} best of a column; \
         {FLAG} look at it: a brightness interval that excludes 0, or a slope interval that excludes −0.6 to −0.4. \
         <a href=\"#reading\">More</a></p>\n<div class=\"charts\">\n{}</div>\n</section>\n",
        charts
            .map(|chart| figure(&chart, "A line that goes to the frame is open: runs did not reach the error."))
            .collect::<String>()
    )
}

fn scene_section(
    results: &Results,
    styles: &Styles,
    number: usize,
    scene: &SceneSummary,
    pictures: &[Picture],
) -> String {
    let runs = scene.methods.iter().map(|method| method.method.runs.len()).max().unwrap_or(0);
    let caption = match charts::has_bands(scene) {
        true => format!("Median over seeds; band: {}.", Spread::ends(runs)),
        false => "Median over seeds; bands would hide one another, and are in the table of errors.".into(),
    };
    let curves: String = curves(results, styles, scene)
        .iter()
        .zip([format!("{caption} Short lines at the bottom: set-up is over."), caption.clone()])
        .map(|(chart, caption)| figure(chart, &caption))
        .collect();
    let brightness = charts::brightness(styles, scene)
        .map(|chart| figure(&chart, "Mean over seeds with 95 % interval, the reference's own error included."));
    let mut all = vec![table(&tables::times(scene)), table(&tables::errors(scene))];
    all.push(format!(
        "<div class=\"charts\">\n{}{}</div>\n",
        table(&tables::brightnesses(scene)),
        brightness.unwrap_or_default()
    ));
    all.push(table(&tables::work(scene)));
    all.extend(tables::ladders(scene).map(|ladders| table(&ladders)));
    let scaling: String = scene.scalings.iter().map(|scaling| table(&tables::scaling(scene, scaling))).collect();
    let scaling_charts: String = scaling_charts(styles, scene).iter().map(|chart| figure(chart, "")).collect();
    let scaling = match scaling.is_empty() {
        true => scaling,
        false => format!("<h3>Scaling</h3>\n{scaling}<div class=\"charts\">\n{scaling_charts}</div>\n"),
    };
    format!(
        "<section id=\"scene-{number}\" class=\"scene\">\n<h2>{}</h2>\n<p class=\"note\"><code>{}</code>, {} × {} \
         pixels. {}</p>\n{}<div class=\"charts\">\n{curves}</div>\n{}{scaling}</section>\n",
        escaped(&scene.scene.name),
        escaped(&scene.scene.scene),
        scene.scene.size[0],
        scene.scene.size[1],
        escaped(&reference_noise(scene)),
        viewer(number, scene, pictures),
        all.concat(),
    )
}

/// What the reference can tell.
fn reference_noise(scene: &SceneSummary) -> String {
    let mut runs = scene.methods.iter().flat_map(|method| &method.method.runs);
    match runs.next().map(|run| run.end().errors.reference_rel_mse) {
        Some(noise) if noise > 0.0 => {
            format!("The reference's own noise, √relMSE {}, is subtracted.", significant(noise.sqrt(), 2))
        }
        Some(_) => "The reference's own noise is not known, and not subtracted.".into(),
        None => String::new(),
    }
}

fn figure(chart: &Chart, caption: &str) -> String {
    let caption =
        if caption.is_empty() { String::new() } else { format!("<figcaption>{}</figcaption>\n", escaped(caption)) };
    let words = escaped(&chart.words);
    let svg = chart.svg.replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{words}\" "), 1);
    format!("<figure class=\"chart\">\n{svg}{caption}</figure>\n")
}

fn table(table: &Table) -> String {
    let head: String = table.head.iter().map(|name| format!("<th scope=\"col\">{}</th>", escaped(name))).collect();
    let rows = table.rows.iter().map(|row| {
        let cells = row.iter().enumerate().map(|(i, content)| cell(i == 0, content));
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    });
    format!(
        "<div class=\"table\">\n<table>\n<caption>{}</caption>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{}</tbody>\n\
         </table>\n</div>\n",
        escaped(&table.caption),
        rows.collect::<String>()
    )
}

fn cell(names_row: bool, content: &Cell) -> String {
    let mut words = escaped(&content.text);
    if content.best {
        words = format!("<strong>{words}</strong><span class=\"mark\" title=\"best\">{BEST}</span>");
    }
    if !content.detail.is_empty() {
        words = format!("{words} <small>{}</small>", escaped(&content.detail));
    }
    if !content.flag.is_empty() {
        words = format!("<abbr class=\"flag\" title=\"{}\">{FLAG}</abbr>{words}", escaped(content.flag));
    }
    match names_row {
        true => format!("<th scope=\"row\">{words}</th>"),
        false if content.best => format!("<td class=\"best\">{words}</td>"),
        false => format!("<td>{words}</td>"),
    }
}

/// Thumbnails that a script can make a viewer of.
fn viewer(number: usize, scene: &SceneSummary, pictures: &[Picture]) -> String {
    if pictures.is_empty() {
        return String::new();
    }
    let [width, height] = scene.scene.size;
    let thumbnails: String = pictures.iter().map(|picture| thumbnail(picture, [width, height])).collect();
    let time = short_with(scene.equal_time, "s");
    format!(
        "<h3>Images at equal time</h3>\n<p>Each method's first seed at its snapshot closest to {time}, the latest time \
         that all runs reach; its own time stands below it. Exposure 1 for all: linear 1 is white.</p>\n\
         <div class=\"images\" data-width=\"{width}\" data-height=\"{height}\">\n\
         <div class=\"viewer\" hidden=\"hidden\">\n<div class=\"controls\">\n\
         <label>Left <select class=\"left\"></select></label>\n\
         <label class=\"wide\">Divider <input class=\"divider\" type=\"range\" min=\"0\" max=\"100\" step=\"0.5\" \
         value=\"50\"/></label>\n\
         <label>Right <select class=\"right\"></select></label>\n\
         <span class=\"buttons\"><button type=\"button\" class=\"flip\">Flip</button>\n\
         <button type=\"button\" class=\"closer\" aria-label=\"closer\">+</button>\n\
         <button type=\"button\" class=\"farther\" aria-label=\"farther\">−</button>\n\
         <button type=\"button\" class=\"whole\">Whole</button></span>\n</div>\n\
         <div class=\"stage\" id=\"stage-{number}\" tabindex=\"0\" role=\"group\" aria-label=\"Comparison of two images\">\
         </div>\n<p class=\"hint\">Drag the divider or press ← →. Flip: F. Closer and farther: + and −, wheel (once the \
         image is clicked), double click. Closer, drag to move, or Shift with arrows. Whole: 0. All thumbnails follow.</p>\n\
         </div>\n<div class=\"thumbnails\">\n{thumbnails}</div>\n</div>\n"
    )
}

fn thumbnail(picture: &Picture, [width, height]: [u32; 2]) -> String {
    let image = |class: &str, name: &str, png: &[u8]| {
        let (name, data) = (escaped(name), embedded(png));
        format!(
            "<div class=\"{class}\"><img src=\"{data}\" width=\"{width}\" height=\"{height}\" alt=\"{name}\" \
             data-name=\"{name}\"/></div>\n"
        )
    };
    let (name, facts, second) = match &picture.source {
        None => ("reference".to_owned(), "the truth".to_owned(), scale()),
        Some(source) => {
            let error = error(&source.snapshot.errors).map_or("–".into(), |error| significant(error, 3));
            let name = source.method.name.clone();
            let facts = format!(
                "{}, √relMSE {error}, seed {}",
                short_with(Some(source.snapshot.seconds), "s"),
                source.run.seed
            );
            let errors =
                picture.errors.as_ref().map(|errors| image("frame errors", &format!("errors of {name}"), errors));
            (name, facts, errors.unwrap_or_default())
        }
    };
    format!(
        "<figure>\n{}{second}<figcaption><b>{}</b> {}</figcaption>\n</figure>\n",
        image("frame", &name, &picture.image),
        escaped(&name),
        escaped(&facts)
    )
}

/// What the colours of error maps mean.
fn scale() -> String {
    let labels = ["−100", "−25", "0", "+25", "+100 %"].map(|label| format!("<span>{label}</span>"));
    format!(
        "<div class=\"scale\">\n<p>Errors: (x − r)/√(r² + 0.01) of luminances</p>\n<img src=\"{}\" width=\"201\" \
         height=\"1\" alt=\"colours of errors\"/>\n<p class=\"ticks\">{}</p>\n<p class=\"ends\"><span>too dark</span>\
         <span>too bright</span></p>\n</div>\n",
        colour_strip(),
        labels.concat()
    )
}

fn method_section(results: &Results) -> String {
    let mut seen: Vec<&str> = Vec::new();
    let mut rows = String::new();
    for method in results.scenes.iter().flat_map(|scene| &scene.methods) {
        if seen.contains(&&method.name[..]) {
            continue;
        }
        seen.push(&method.name);
        let variant: Vec<String> = method.variant.iter().map(|(option, value)| format!("{option} = {value}")).collect();
        let command = method.runs.first().map_or("", |run| &run.command);
        rows += &format!(
            "<tr><th scope=\"row\">{}</th><td class=\"words\"><code>{}</code>{}</td><td class=\"words\"><code>{}</code>\
             </td></tr>\n",
            escaped(&method.name),
            escaped(&method.options),
            if variant.is_empty() {
                String::new()
            } else {
                format!(" <small>{}</small>", escaped(&variant.join(", ")))
            },
            escaped(command)
        );
    }
    format!(
        "<section id=\"methods\">\n<h2>Methods</h2>\n<div class=\"table\">\n<table>\n<thead><tr><th \
         scope=\"col\">method</th><th class=\"words\" scope=\"col\">options</th><th class=\"words\" scope=\"col\">a \
         command that repeats its first run</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n</div>\n{}</section>\n",
        run_warnings(results)
    )
}

fn run_warnings(results: &Results) -> String {
    let mut items = String::new();
    let mut number = 0;
    for scene in &results.scenes {
        for method in &scene.methods {
            let warnings = method.runs.iter().flat_map(|run: &Run| run.warnings.iter().map(move |w| (run.seed, w)));
            for (seed, warning) in warnings {
                let words = format!("{}, {}, seed {seed}: {warning}", scene.name, method.name);
                items += &format!("<li>{}</li>\n", escaped(&words));
                number += 1;
            }
        }
    }
    match number {
        0 => String::new(),
        _ => format!("<details>\n<summary>{number} warnings of runs</summary>\n<ul>\n{items}</ul>\n</details>\n"),
    }
}

fn explanation_section(results: &Results, summaries: &[SceneSummary]) -> String {
    let intervals =
        summaries.iter().flat_map(|scene| &scene.methods).filter(|method| method.brightness.is_some()).count();
    let by_chance = significant(0.05 * intervals as f64, 2);
    let excluded: Vec<&str> = results.excluded.iter().map(|stage| stage.name()).collect();
    let excluded = match excluded.is_empty() {
        true => "Nothing of a run is left out of its time.".to_owned(),
        false => format!("Left out of all times: {}.", excluded.join(", ")),
    };
    let terms: [(&str, String); 10] = [
        (
            "√relMSE",
            "Root of the mean over pixels and channels of (x − r)²/(r² + 0.01), r the reference. Where the reference's \
             variance is known, it is subtracted from (x − r)²; what is then 0 or less is below what the reference can \
             tell and counts as not known."
                .into(),
        ),
        ("Time", format!("Seconds are {}. {excluded} Time spent on snapshots counts nowhere.", clock(results))),
        (
            "Medians and bands",
            "Over seeds, of errors read on straight lines between the snapshots of each run, both axes logarithmic, \
             never beyond a run's first and last. Bands go from least to greatest of fewer than eight runs and from \
             first to third quartile of more."
                .into(),
        ),
        (
            "Time to an error",
            "Of each run, when its error was first that or less; then the median. Runs that never were count as later \
             than their end: > t. Targets are the study's, or four times, twice and once the baseline's median at its \
             end, rounded up to two digits; the summary takes the least that all runs of the baseline reach."
                .into(),
        ),
        (
            "Speed-up",
            "Median time of the baseline over that of the method. Intervals are the middle 95 % of 1000 bootstrap \
             resamples of the runs of both; with few runs they are coarse. > and < stand where the error was not reached, or before the first \
             snapshot."
                .into(),
        ),
        (
            "Brightness error",
            format!(
                "Mean over runs of Σx/Σr − 1 at the end: what remains when noise is averaged away. ± is \
                 √(t² s²/n + 1.96² v) with Student's t at 95 %, s the deviation over runs and √v the reference's own \
                 error. Of {intervals} such intervals, {by_chance} exclude 0 by chance alone. \u{201c}Stated by \
                 runs\u{201d} is the standard error that a run itself gives, to be compared with the deviation."
            ),
        ),
        (
            "Slope",
            "Least squares of ln √relMSE over ln seconds in the last decade of a run (from its end/10), without the \
             part before it was set up; mean over runs ± 95 % by Student's t. Independent samples give −½. Flagged \
             where the interval has nothing of −0.6 to −0.4."
                .into(),
        ),
        (
            "Deviation",
            "Standard deviation over runs: of √relMSE over its mean, of the brightness in per cent of the reference's."
                .into(),
        ),
        (
            "Efficiency",
            "1/(relMSE · seconds) at the end, median over runs. If errors fall as 1/√time, it is the same \
             whenever runs end."
                .into(),
        ),
        (
            "Speed",
            "Mutations over wall time of whole runs, set-up included; independent samples count as mutations.".into(),
        ),
    ];
    let terms = terms.map(|(term, words)| format!("<dt>{}</dt>\n<dd>{}</dd>\n", escaped(term), escaped(&words)));
    format!(
        "<section id=\"reading\">\n<h2>How to read this</h2>\n<dl class=\"terms\">\n{}</dl>\n</section>\n",
        terms.concat()
    )
}

fn origin_section(results: &Results) -> String {
    let list = |items: &[String]| items.iter().map(|item| escaped(item)).collect::<Vec<_>>().join("<br/>");
    format!(
        "<section id=\"origin\">\n<h2>Origin</h2>\n<dl class=\"terms\">\n<dt>Command</dt>\n<dd><code>{}</code></dd>\n\
         <dt>Programs</dt>\n<dd>{}</dd>\n<dt>Machines</dt>\n<dd>{}</dd>\n<dt>Data</dt>\n\
         <dd><code>results.csv</code> beside this page has a line for each snapshot of each run, <code>plots</code> the \
         charts as SVG.</dd>\n</dl>\n<details>\n<summary>Study file\
         </summary>\n<pre>{}</pre>\n</details>\n</section>\n",
        escaped(&results.command),
        list(&results.programs),
        list(&results.machines),
        escaped_lines(&results.study_file, "\n"),
    )
}
