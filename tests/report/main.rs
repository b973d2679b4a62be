//! Reports of studies: well-formed, on their own, and shown by a real browser.

mod browser;
mod study;

use std::path::{Path, PathBuf};

use browser::Browser;
use relt::study::report;
use relt::study::results::{MethodResults, Results, SceneResults};

/// Where a test leaves what can be looked at.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report").join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The page of a study in its folder.
fn written(results: &Results, folder: &Path) -> String {
    report::write(results, folder).unwrap();
    std::fs::read_to_string(folder.join("report.html")).unwrap()
}

/// The page as XML, without its script, which is text to browsers alone.
fn without_script(page: &str) -> String {
    let (before, rest) = page.split_once("<script>").unwrap();
    let (_, after) = rest.split_once("</script>").unwrap();
    assert!(!after.contains("<script"), "one script, at the end");
    format!("{before}{after}").replacen("<!doctype html>", "", 1)
}

#[test]
fn the_page_is_well_formed_and_takes_nothing_from_elsewhere() {
    let folder = folder("well-formed");
    let page = written(&study::study(&folder), &folder);
    let xml = without_script(&page);
    let document = roxmltree::Document::parse(&xml).unwrap();
    let of = |name: &'static str| document.descendants().filter(move |node| node.has_tag_name(name));
    for node in document.descendants().filter(|node| node.is_element()) {
        for name in ["src", "href", "poster", "action", "data"] {
            let target = node.attribute(name).unwrap_or("#");
            assert!(target.starts_with('#') || target.starts_with("data:"), "{name} = {target}");
        }
        assert!(!node.attributes().any(|attribute| attribute.name().starts_with("on")), "scripts in attributes");
    }
    let namespaces = xml.matches("xmlns=\"http://www.w3.org/2000/svg\"").count();
    assert_eq!(
        xml.matches("http://").count() + xml.matches("https://").count() + xml.matches("//fonts").count(),
        namespaces
    );
    let links = of("a").map(|link| link.attribute("href").unwrap().trim_start_matches('#').to_owned());
    for link in links {
        assert!(document.descendants().any(|node| node.attribute("id") == Some(&link)), "#{link} leads nowhere");
    }
    // 3 scenes × (speed-up, two of errors, brightness) and 2 + 2 + 2 of scaling
    let svg = ("http://www.w3.org/2000/svg", "svg");
    let figures = document.descendants().filter(|node| node.has_tag_name(svg) && node.has_attribute("aria-label"));
    assert_eq!(figures.count(), 3 * 4 + 6);
    // 3 scenes × (reference, scale, 5 × (image, errors))
    assert_eq!(of("img").count(), 3 * (2 + 10));
    assert!(of("h1").any(|node| node.text() == Some("Doors, keyholes & <threads>")));
    let ids: Vec<_> = document.descendants().filter_map(|node| node.attribute("id")).collect();
    assert!(ids.iter().enumerate().all(|(i, id)| !ids[..i].contains(id)), "{ids:?}");
}

#[test]
fn charts_are_files_of_their_own() {
    let folder = folder("charts");
    let mut results = study::study(&folder);
    let plots = report::plots(&results);
    assert_eq!(plots.len(), 18);
    for (name, svg) in &plots {
        let document = roxmltree::Document::parse(svg).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(document.descendants().filter(|node| node.is_element()).count() > 20, "{name}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{name}");
        std::fs::write(folder.join(name), svg).unwrap();
    }
    results.scenes[1].name = "door/ajar".into();
    let names: Vec<_> = report::plots(&results).into_iter().map(|(name, _)| name).collect();
    assert!(names.iter().enumerate().all(|(i, name)| !names[..i].contains(name) && !name.contains('/')), "{names:?}");
}

#[test]
fn a_study_without_runs_or_images_has_a_page_all_the_same() {
    let folder = folder("empty");
    let method = |name: &str| MethodResults { name: name.into(), ..MethodResults::default() };
    let scene = SceneResults {
        name: "door".into(),
        reference: "nowhere.exr".into(),
        methods: vec![method("mlt"), method("re")],
        ..SceneResults::default()
    };
    let results = Results { baseline: "mlt".into(), scenes: vec![scene], ..Results::default() };
    let page = written(&results, &folder);
    roxmltree::Document::parse(&without_script(&page)).unwrap();
    assert!(page.contains("cannot read nowhere.exr") && page.contains("no runs yet"));
    assert!(report::text(&results).contains("no runs yet"));
    assert!(report::plots(&results).is_empty());
    assert_eq!(report::csv(&results).lines().count(), 1);
    written(&Results::default(), &folder);
}

#[test]
fn a_folder_that_is_not_there_is_told() {
    let error = report::write(&Results::default(), Path::new("nowhere")).unwrap_err().to_string();
    assert!(error.contains("report.html") && error.contains("no folder nowhere"), "{error}");
}

#[test]
fn errors_below_what_the_reference_tells_leave_gaps_and_no_nonsense() {
    let folder = folder("below-reference");
    let mut results = study::study(&folder);
    let runs = results.scenes[0].methods.iter_mut().flat_map(|method| &mut method.runs);
    for (i, snapshot) in runs.flat_map(|run| &mut run.snapshots).enumerate() {
        if i % 3 == 0 {
            snapshot.errors.rel_mse = -1e-6;
        }
    }
    results.scenes[1].methods[0].runs.iter_mut().for_each(|run| run.snapshots.truncate(1));
    let page = written(&results, &folder);
    let xml = without_script(&page);
    let document = roxmltree::Document::parse(&xml).unwrap();
    for node in document.descendants() {
        let attributes = node.attributes().filter(|attribute| attribute.name() != "src"); // base64 may hold any letters
        for words in attributes.map(|attribute| attribute.value()).chain(node.text()) {
            assert!(!words.contains("NaN") && !words.split_whitespace().any(|word| word == "inf"), "{words}");
        }
    }
}

#[test]
fn the_summary_fits_a_terminal() {
    let folder = folder("text");
    let text = report::text(&study::study(&folder));
    std::fs::write(folder.join("summary.txt"), &text).unwrap();
    let widest = text.lines().map(|line| line.chars().count()).max().unwrap();
    assert!(widest <= 120, "{widest} columns:\n{text}");
    assert!(text.contains("door-ajar (96 × 64)") && text.contains("keyhole") && text.contains("re, K = 8"), "{text}");
    assert!(text.contains('★') && text.contains('⚑') && text.contains("warning: keyhole: 1 of 25 runs"), "{text}");
}

#[test]
fn a_browser_shows_plots_and_its_divider_wipes_between_images() {
    let Some(program) = browser::find() else {
        assert!(std::env::var_os("CI").is_none(), "no Chromium: name one by RELT_CHROMIUM");
        eprintln!("skipped: no chromium, chromium-browser or google-chrome in PATH, nor RELT_CHROMIUM");
        return;
    };
    let folder = folder("browser");
    written(&study::study(&folder), &folder);
    let page = std::fs::canonicalize(folder.join("report.html")).unwrap();
    let mut browser = Browser::start(&program);

    browser.open(&page, [1280, 900]);
    shows_plots(&mut browser, &folder);
    divides(&mut browser, &folder);
    zooms_all_images_together(&mut browser);
    assert_eq!(browser.complaints(), [""; 0]);

    browser.open(&page, [390, 800]);
    let picture = browser.picture(None);
    std::fs::write(folder.join("narrow.png"), &picture.file).unwrap();
    let wider = browser.evaluate("document.documentElement.scrollWidth > innerWidth");
    assert_eq!(wider, false, "a narrow window need not be scrolled sideways");
    assert_eq!(browser.complaints(), [""; 0]);

    let many = folder.join("many-methods");
    std::fs::create_dir_all(&many).unwrap();
    written(&study::many_methods(&many, 14), &many);
    browser.open(&std::fs::canonicalize(many.join("report.html")).unwrap(), [1280, 900]);
    let picture = browser.picture(Some("#scene-0 .chart"));
    std::fs::write(many.join("chart.png"), &picture.file).unwrap();
    // seven of the fourteen share their colours with another, and are told from it by dashes and hollow marks
    for colour in ["#333333", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"] {
        assert!(picture.count(colour) > 200, "{colour} in {}", many.join("chart.png").display());
    }
    assert_eq!(browser.complaints(), [""; 0]);

    browser.call("Emulation.setScriptExecutionDisabled", serde_json::json!({"value": true}));
    browser.open(&page, [1280, 900]);
    let picture = browser.picture(Some(".thumbnails"));
    std::fs::write(folder.join("without-script.png"), &picture.file).unwrap();
    browser.call("Emulation.setEmulatedMedia", serde_json::json!({"media": "print"}));
    std::fs::write(folder.join("print.png"), browser.picture(None).file).unwrap();
    assert!(picture.pixels.iter().filter(|pixel| pixel.iter().any(|byte| *byte < 60)).count() > 1000);
    let [_, _, _, height] = browser.place(".viewer");
    assert_eq!(height, 0.0, "a viewer that cannot work is not shown");
}

/// Colours of the series are where the first scene's charts are: of the baseline and of four others.
fn shows_plots(browser: &mut Browser, folder: &Path) {
    let whole = browser.picture(None);
    std::fs::write(folder.join("page.png"), &whole.file).unwrap();
    let picture = browser.picture(Some("#scene-0 .chart"));
    std::fs::write(folder.join("chart.png"), &picture.file).unwrap();
    for colour in ["#333333", "#0072b2", "#d55e00", "#009e73", "#cc79a7"] {
        let pixels = picture.count(colour);
        // thirteen markers of about 25 pixels each alone are more
        assert!(pixels > 200, "{pixels} pixels of {colour} in {}", folder.join("chart.png").display());
    }
}

/// By dragging, by keys and by the range beside it.
fn divides(browser: &mut Browser, folder: &Path) {
    browser
        .evaluate("document.querySelector('#scene-0 .stage').scrollIntoView({block: 'center', behavior: 'instant'})");
    let value = |browser: &mut Browser| browser.evaluate("Number(document.querySelector('#scene-0 .divider').value)");
    let shown = |browser: &mut Browser, name: &str| {
        let picture = browser.picture(Some("#scene-0 .stage"));
        std::fs::write(folder.join(format!("{name}.png")), &picture.file).unwrap();
        picture.pixels
    };
    let middle = shown(browser, "divider-in-the-middle");
    let [x, y, width, height] = browser.place("#scene-0 .stage");
    let scroll = browser.evaluate("scrollY").as_f64().unwrap();
    let at = |share: f64| [x + share * width, y - scroll + 0.5 * height];
    browser.drag(&[at(0.5), at(0.7), at(0.9)]);
    let dragged = value(browser).as_f64().unwrap();
    assert!((dragged - 90.0).abs() < 1.0, "{dragged}");
    let right = shown(browser, "divider-to-the-right");
    let changed = middle.iter().zip(&right).filter(|(a, b)| a != b).count();
    assert!(changed > middle.len() / 10, "{changed} pixels of {} changed", middle.len());

    browser.press("ArrowLeft", 37);
    assert_eq!(value(browser).as_f64().unwrap().round(), (dragged - 2.0).round(), "the image has the focus by now");
    browser.press("f", 70);
    assert_eq!(value(browser), 0);
    let all_right = shown(browser, "flipped");
    browser.press("f", 70);
    assert_eq!(value(browser), 100);
    assert!(shown(browser, "flipped-back") != all_right);

    browser.evaluate(
        "(() => { const range = document.querySelector('#scene-0 .divider'); range.value = 50; \
         range.dispatchEvent(new Event('input')); })()",
    );
    assert!(shown(browser, "by-range") == middle, "the same as at first");
    browser.evaluate("document.querySelector('#scene-0 .divider').focus()");
    browser.press("ArrowRight", 39);
    assert_eq!(value(browser), 50.5, "ranges have keys of their own");

    let choose = "(() => { const choice = document.querySelector('#scene-0 select.right'); \
                  choice.selectedIndex = 2; choice.dispatchEvent(new Event('change')); \
                  return document.querySelector('#scene-0 .name.right').textContent; })()";
    assert_eq!(browser.evaluate(choose), "errors of mlt");
    assert!(shown(browser, "errors") != middle);
}

fn zooms_all_images_together(browser: &mut Browser) {
    let transforms = "[...new Set([...document.querySelectorAll('#scene-0 .stage img, #scene-0 .frame img')]\
                      .map((image) => image.style.transform))]";
    browser.evaluate("document.querySelector('#scene-0 .stage').focus()");
    browser.press("+", 187);
    browser.press("+", 187);
    let zoomed = browser.evaluate(transforms);
    assert_eq!(zoomed.as_array().unwrap().len(), 1, "{zoomed}");
    assert!(zoomed[0].as_str().unwrap().contains("scale(4)"), "{zoomed}");
    let [x, y, width, height] = browser.place("#scene-0 .stage");
    let scroll = browser.evaluate("scrollY").as_f64().unwrap();
    let at = |right: f64, down: f64| [x + right * width, y - scroll + down * height];
    browser.drag(&[at(0.2, 0.5), at(0.3, 0.6)]);
    let moved = browser.evaluate(transforms);
    assert!(moved[0] != zoomed[0] && moved.as_array().unwrap().len() == 1, "{zoomed} {moved}");
    browser.press("0", 48);
    assert!(browser.evaluate(transforms)[0].as_str().unwrap().contains("scale(1)"));
}
