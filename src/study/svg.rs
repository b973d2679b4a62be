//! Small charts as SVG: panels with two axes, a legend, and marks.
//!
//! Nothing measures text, for viewers choose their own fonts: widths are estimated generously, and nothing stands
//! where a wider font would hide it.

/// Colours that people with any kind of colour vision tell apart (Okabe & Ito 2008).
pub const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
/// For what is in the background.
pub const GRAY: &str = "#888888";
/// For what others are compared with.
pub const DARK: &str = "#333333";

/// How a series looks; black-and-white prints and any kind of colour vision tell more than six by shapes and dashes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// As SVG has it.
    pub colour: &'static str,
    /// Pattern of lines as SVG has it; solid where empty.
    pub dash: &'static str,
    /// Of dots, and on lines at their points.
    pub shape: Option<Shape>,
}

/// What stands for a datum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Number of corners and where the first one is: up or half a step beside.
    outline: Outline,
    /// Whether its inside is white.
    hollow: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Outline {
    Circle,
    Square,
    Up,
    Diamond,
    Down,
    Pentagon,
}

impl Style {
    /// The n-th of many, from 0: six colours with a shape each, then again with dashes and hollow shapes.
    pub fn numbered(n: usize) -> Style {
        const OUTLINES: [Outline; 6] =
            [Outline::Circle, Outline::Square, Outline::Up, Outline::Diamond, Outline::Down, Outline::Pentagon];
        const DASHES: [&str; 4] = ["", "7 3", "2 2.5", "9 3 2 3"];
        let (i, turn) = (n % COLOURS.len(), n / COLOURS.len());
        let shape = Shape { outline: OUTLINES[i], hollow: turn % 2 == 1 };
        Style { colour: COLOURS[i], dash: DASHES[turn % DASHES.len()], shape: Some(shape) }
    }

    /// What others are compared with.
    pub fn of_baseline() -> Style {
        Style { colour: DARK, dash: "", shape: Some(Shape { outline: Outline::Circle, hollow: true }) }
    }

    /// A line in the background.
    pub fn guide() -> Style {
        Style { colour: GRAY, dash: "4 4", shape: None }
    }

    /// Lines without points.
    pub fn without_shape(self) -> Style {
        Style { shape: None, ..self }
    }
}

impl From<&'static str> for Style {
    fn from(colour: &'static str) -> Style {
        Style { colour, dash: "", shape: None }
    }
}

/// A page of text and panels.
pub struct Page {
    width: f64,
    height: f64,
    body: String,
}

/// A rectangle of a page in pixels.
#[derive(Clone, Copy)]
pub struct Area {
    /// From the left of the page.
    pub x: f64,
    /// From the top of the page.
    pub y: f64,
    /// To the right.
    pub width: f64,
    /// Down.
    pub height: f64,
}

/// Which end of a text is at its place.
#[derive(Clone, Copy)]
enum Anchor {
    Start,
    Middle,
    End,
}

impl Page {
    /// An empty white page of that size in pixels.
    pub fn new(width: f64, height: f64) -> Page {
        Page { width, height, body: String::new() }
    }

    /// The file.
    pub fn finish(self) -> String {
        let Page { width, height, body } = self;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" fill=\"#222\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n{body}</svg>\n"
        )
    }

    /// A line of text that starts at (x, y), its baseline.
    pub fn words(&mut self, x: f64, y: f64, size: f64, words: &str) {
        self.text([x, y], size, Anchor::Start, "", words);
    }

    fn text(&mut self, [x, y]: [f64; 2], size: f64, anchor: Anchor, more: &str, words: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let words = escaped(words);
        self.body += &format!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" text-anchor=\"{anchor}\"{more}>{words}</text>\n"
        );
    }

    fn line(&mut self, points: &[[f64; 2]], colour: &'static str, width: f64) {
        self.styled_line(points, colour.into(), width);
    }

    fn styled_line(&mut self, points: &[[f64; 2]], style: Style, width: f64) {
        let dash = match style.dash {
            "" => String::new(),
            dash => format!(" stroke-dasharray=\"{dash}\""),
        };
        self.body += &format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\"{dash}/>\n",
            joined(points),
            style.colour
        );
    }

    fn polygon(&mut self, corners: &[[f64; 2]], more: &str) {
        self.body += &format!("<polygon points=\"{}\"{more}/>\n", joined(corners));
    }

    fn dot(&mut self, [x, y]: [f64; 2], radius: f64, colour: &str) {
        self.body += &format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"{colour}\" fill-opacity=\"0.7\" \
             stroke=\"{colour}\"/>\n"
        );
    }

    /// A shape, or a plain dot where the style has none.
    fn mark(&mut self, [x, y]: [f64; 2], style: Style) {
        let Some(Shape { outline, hollow }) = style.shape else { return self.dot([x, y], 3.5, style.colour) };
        let fill = if hollow { "#fff" } else { style.colour };
        let more = format!(" fill=\"{fill}\" stroke=\"{}\" stroke-width=\"1.4\"", style.colour);
        let (corners, turn, radius) = match outline {
            Outline::Circle => {
                self.body += &format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"{more}/>\n");
                return;
            }
            Outline::Square => (4, 0.5, 3.8),
            Outline::Up => (3, 0.0, 4.0),
            Outline::Diamond => (4, 0.0, 4.0),
            Outline::Down => (3, 0.5, 4.0),
            Outline::Pentagon => (5, 0.0, 3.8),
        };
        let angle = |i: i32| (f64::from(i) + turn) * std::f64::consts::TAU / f64::from(corners);
        let corner = |i| [x + radius * f64::sin(angle(i)), y - radius * f64::cos(angle(i))];
        self.polygon(&(0..corners).map(corner).collect::<Vec<_>>(), &more);
    }

    fn rectangle(&mut self, area: Area, colour: &str) {
        let Area { x, y, width, height } = area;
        self.body += &format!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{colour}\"/>\n"
        );
    }

    /// Draws a panel; marks that are not finite are left out, and a panel without any says so.
    pub fn panel(&mut self, area: Area, panel: &Panel) {
        let names = panel.y.ticks.iter().map(|(_, name)| name.chars().count()).max().unwrap_or(0) as f64;
        let left = (28.0 + PIXELS_PER_LETTER * names).max(62.0);
        let legend = legend_places(panel, area.width - left - 12.0);
        let below_first_row = legend.iter().map(|[_, y]| *y).fold(0.0, f64::max);
        let top = 48.0 + below_first_row;
        let plot = Area {
            x: area.x + left,
            y: area.y + top,
            width: area.width - left - 12.0,
            height: area.height - top - 44.0,
        };
        self.text([area.x + 4.0, area.y + 16.0], 14.0, Anchor::Start, " font-weight=\"bold\"", &panel.title);
        self.legend([plot.x, area.y + 36.0], &legend, panel);
        self.axes(plot, area.x + 14.0, panel);
        let drawn = panel.series.iter().enumerate().map(|(i, _)| self.series(plot, panel, i)).sum::<usize>();
        if drawn == 0 {
            let middle = [plot.x + 0.5 * plot.width, plot.y + 0.5 * plot.height];
            self.text(middle, 12.0, Anchor::Middle, &format!(" fill=\"{GRAY}\""), "not measured");
        }
    }

    fn legend(&mut self, [left, top]: [f64; 2], places: &[[f64; 2]], panel: &Panel) {
        for (series, [x, y]) in panel.series.iter().filter(|series| !series.name.is_empty()).zip(places) {
            let (x, y) = (left + x, top + y);
            let middle = [x + 9.0, y - 4.0];
            match series.marks {
                Marks::Lines | Marks::Steps | Marks::Segments => {
                    self.styled_line(&[[x, middle[1]], [x + 18.0, middle[1]]], series.style, 2.0);
                    if series.style.shape.is_some() {
                        self.mark(middle, series.style);
                    }
                }
                Marks::Bars { .. } | Marks::Band => {
                    self.rectangle(Area { x: x + 2.0, y: y - 9.0, width: 12.0, height: 10.0 }, series.style.colour);
                }
                Marks::Dots | Marks::Errors | Marks::Bubbles => self.mark(middle, series.style),
            }
            self.words(x + 23.0, y, 11.0, &series.name);
        }
    }

    /// Frame, ticks with thin lines across, labels.
    fn axes(&mut self, plot: Area, label: f64, panel: &Panel) {
        let (right, bottom) = (plot.x + plot.width, plot.y + plot.height);
        for (at, name) in &panel.x.ticks {
            let x = plot.x + plot.width * panel.x.place(*at);
            self.line(&[[x, plot.y], [x, bottom]], "#e4e4e4", 1.0);
            self.text([x, bottom + 15.0], 11.0, Anchor::Middle, "", name);
        }
        for (at, name) in &panel.y.ticks {
            let y = bottom - plot.height * panel.y.place(*at);
            self.line(&[[plot.x, y], [right, y]], "#e4e4e4", 1.0);
            self.text([plot.x - 5.0, y + 4.0], 11.0, Anchor::End, "", name);
        }
        let corners = [[plot.x, plot.y], [right, plot.y], [right, bottom], [plot.x, bottom], [plot.x, plot.y]];
        self.line(&corners, GRAY, 1.0);
        self.text([plot.x + 0.5 * plot.width, bottom + 33.0], 12.0, Anchor::Middle, "", &panel.x.label);
        let [x, y] = [label, plot.y + 0.5 * plot.height];
        let turned = format!(" transform=\"rotate(-90 {x:.1} {y:.1})\"");
        self.text([x, y], 12.0, Anchor::Middle, &turned, &panel.y.label);
    }

    /// Draws a series, which pointing at it names, and returns how many marks it has.
    fn series(&mut self, plot: Area, panel: &Panel, number: usize) -> usize {
        let series = &panel.series[number];
        if series.name.is_empty() {
            return self.marks(plot, panel, series);
        }
        self.body += &format!("<g><title>{}</title>\n", escaped(&series.name));
        let drawn = self.marks(plot, panel, series);
        self.body += "</g>\n";
        drawn
    }

    fn marks(&mut self, plot: Area, panel: &Panel, series: &Series) -> usize {
        let bottom = plot.y + plot.height;
        let x = |value: f64| plot.x + plot.width * panel.x.place(value);
        let y = |value: f64| bottom - plot.height * panel.y.place(value);
        let marks: Vec<Mark> = series.data.iter().filter(|mark| panel.holds(mark)).copied().collect();
        let points: Vec<[f64; 2]> = marks.iter().map(|mark| [x(mark.x), y(mark.y)]).collect();
        let style = series.style;
        match series.marks {
            Marks::Lines => {
                self.styled_line(&points, style, 1.8);
                if style.shape.is_some() {
                    points.iter().for_each(|at| self.mark(*at, style));
                }
            }
            Marks::Steps => self.styled_line(&steps(&points), style, 1.3),
            Marks::Segments => points.chunks_exact(2).for_each(|ends| self.styled_line(ends, style, 1.5)),
            Marks::Band => self.polygon(&points, &format!(" fill=\"{}\" fill-opacity=\"0.14\"", style.colour)),
            Marks::Dots => points.iter().for_each(|at| self.mark(*at, style)),
            Marks::Bubbles => {
                for (mark, at) in marks.iter().zip(&points).filter(|(mark, _)| mark.size > 0.0) {
                    self.dot(*at, 12.0 * mark.size.min(1.0).sqrt(), style.colour);
                }
            }
            Marks::Errors => {
                for (mark, at) in marks.iter().zip(&points) {
                    if mark.size.is_finite() {
                        self.line(&[[at[0], y(mark.y - mark.size)], [at[0], y(mark.y + mark.size)]], style.colour, 1.5);
                    }
                    self.dot(*at, 3.0, style.colour);
                }
            }
            Marks::Bars { beside, of } => {
                let width = 0.8 * (x(1.0) - x(0.0)) / of as f64;
                for at in points.iter() {
                    let left = at[0] + width * (beside as f64 - 0.5 * of as f64);
                    self.rectangle(Area { x: left, y: at[1], width, height: bottom - at[1] }, style.colour);
                }
            }
        }
        marks.len()
    }
}

/// Generous width of a letter of sans-serif fonts at size 11.
const PIXELS_PER_LETTER: f64 = 6.2;

/// Where the names of series stand from the upper left: side by side, and in further rows where a row is full.
fn legend_places(panel: &Panel, width: f64) -> Vec<[f64; 2]> {
    const ROW: f64 = 16.0;
    let (mut x, mut y) = (0.0, 0.0);
    let named = panel.series.iter().filter(|series| !series.name.is_empty());
    named
        .map(|series| {
            let needed = 29.0 + PIXELS_PER_LETTER * series.name.chars().count() as f64;
            if x > 0.0 && x + needed > width {
                (x, y) = (0.0, y + ROW);
            }
            let place = [x, y];
            x += needed + 11.0;
            place
        })
        .collect()
}

/// Points as SVG has them.
fn joined(points: &[[f64; 2]]) -> String {
    points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
}

/// The corners of a line that keeps each value until the next.
fn steps(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let corners = points.windows(2).flat_map(|pair| [pair[0], [pair[1][0], pair[0][1]]]);
    corners.chain(points.last().copied()).collect()
}

pub(super) fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;");
    text.replace(char::is_control, " ") // which XML does not allow at all
}

/// A chart.
pub struct Panel {
    /// What it shows.
    pub title: String,
    /// Across.
    pub x: Axis,
    /// Up.
    pub y: Axis,
    /// Drawn in this order.
    pub series: Vec<Series>,
}

impl Panel {
    fn holds(&self, mark: &Mark) -> bool {
        self.x.holds(mark.x) && self.y.holds(mark.y)
    }
}

/// Data of one kind.
pub struct Series {
    /// In the legend; none where empty.
    pub name: String,
    /// How it looks.
    pub style: Style,
    /// How each datum is drawn.
    pub marks: Marks,
    /// The data.
    pub data: Vec<Mark>,
}

/// How data are drawn.
#[derive(Clone, Copy)]
pub enum Marks {
    /// A line from point to point.
    Lines,
    /// A line that keeps each value until the next.
    Steps,
    /// A line from each datum of even number to the next.
    Segments,
    /// An area that the line from point to point surrounds.
    Band,
    /// Filled dots, or the style's shape.
    Dots,
    /// Filled dots whose areas are as the sizes, 0 to 1.
    Bubbles,
    /// Dots with bars of half-length size.
    Errors,
    /// Bars from the bottom, several side by side on a unit of x.
    Bars {
        /// Which of those side by side, from 0.
        beside: usize,
        /// How many there are.
        of: usize,
    },
}

/// A datum.
#[derive(Clone, Copy)]
pub struct Mark {
    /// Across.
    pub x: f64,
    /// Up.
    pub y: f64,
    /// For [`Marks::Bubbles`] and [`Marks::Errors`].
    pub size: f64,
}

/// Data without sizes.
pub fn points(data: impl IntoIterator<Item = [f64; 2]>) -> Vec<Mark> {
    data.into_iter().map(|[x, y]| Mark { x, y, size: 0.0 }).collect()
}

/// A quantity along an edge of a panel.
pub struct Axis {
    label: String,
    scale: Scale,
    ticks: Vec<(f64, String)>,
}

#[derive(Clone, Copy)]
enum Scale {
    /// From low to high.
    Linear { low: f64, high: f64 },
    /// Logarithms of low and high; 0 has a place of its own at the end.
    Log { low: f64, high: f64, zero: bool },
}

/// Share of a logarithmic axis that is kept for 0.
const FOR_ZERO: f64 = 0.1;

impl Axis {
    /// From `low` to `high`, widened to the next ticks; 0 to 1 where both are 0 or one is not finite.
    pub fn linear(label: &str, [low, high]: [f64; 2]) -> Axis {
        let [low, high] = match high - low {
            span if !span.is_finite() || low == 0.0 && high == 0.0 => [0.0, 1.0],
            span if span <= 1e-12 * high.abs() => [low - 0.5 * low.abs(), high + 0.5 * high.abs()],
            _ => [low, high],
        };
        let step = nice_step((high - low) / 5.0);
        let (first, last) = ((low / step + 1e-9).floor(), (high / step - 1e-9).ceil());
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let name = |value: f64| match step {
            0.0001..100_000.0 => format!("{value:.decimals$}").replace('-', "−"),
            _ => format!("{value:.2e}"),
        };
        let ticks = (0..=(last - first) as usize).map(|i| (first + i as f64) * step).map(|v| (v, name(v))).collect();
        Axis { label: label.into(), scale: Scale::Linear { low: first * step, high: last * step }, ticks }
    }

    /// Whole numbers from `low` to `high` with half a unit around.
    pub fn whole(label: &str, [low, high]: [usize; 2]) -> Axis {
        let step = nice_step((high.saturating_sub(low) as f64 / 12.0).max(1.0)).ceil() as usize;
        let multiples = (low + step / 2..=high).filter(|i| i % step == 0 && *i > low);
        let ticks = [low].into_iter().chain(multiples).map(|i| (i as f64, i.to_string())).collect();
        Axis {
            label: label.into(),
            scale: Scale::Linear { low: low as f64 - 0.5, high: high.max(low) as f64 + 0.5 },
            ticks,
        }
    }

    /// A line for each name, the first on top; that of number i is at −i. Long names are cut.
    pub fn named(label: &str, names: &[String]) -> Axis {
        const LONGEST: usize = 32;
        let cut = |name: &String| match name.char_indices().nth(LONGEST) {
            Some(_) => name.chars().take(LONGEST - 1).chain(['…']).collect(),
            None => name.clone(),
        };
        let ticks = names.iter().enumerate().map(|(i, name)| (-(i as f64), cut(name))).collect();
        Axis { label: label.into(), scale: Scale::Linear { low: 0.5 - names.len() as f64, high: 0.5 }, ticks }
    }

    /// Logarithmic with ticks at these numbers alone, ascending.
    pub fn log_at(label: &str, numbers: &[usize]) -> Axis {
        let mut axis = Axis::log(label, numbers.iter().map(|number| *number as f64));
        axis.ticks = numbers.iter().map(|number| (*number as f64, number.to_string())).collect();
        axis
    }

    /// Logarithmic over the positive ones of `values`, with a place for 0 if one is 0.
    pub fn log(label: &str, values: impl Iterator<Item = f64> + Clone) -> Axis {
        let positive = values.clone().filter(|value| *value > 0.0 && value.is_finite());
        let zero = values.clone().any(|value| value == 0.0);
        let low = positive.clone().fold(f64::INFINITY, f64::min);
        let high = positive.fold(0.0, f64::max);
        let (low, high) = if low <= high { (low, high) } else { (0.1, 1.0) };
        // a little wider, so that marks do not touch the frame
        let (low, high) = (low.log10(), high.log10());
        let margin = 0.05f64.max(0.04 * (high - low));
        let (low, high) = (low - margin, high + margin);
        let digits: &[f64] = match high - low {
            ..1.0 => &[1.0, 2.0, 3.0, 5.0, 7.0],
            ..2.5 => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        let every = ((high - low) / 8.0).ceil() as i32;
        let powers = (low.floor() as i32..=high.ceil() as i32).filter(|power| power % every == 0);
        let at = powers.flat_map(|power| digits.iter().map(move |digit| (*digit, power)));
        let named = at.map(|(digit, power)| {
            let value = digit * 10f64.powi(power);
            let name = match power {
                -3..=3 => format!("{value:.*}", (-power).max(0) as usize),
                _ => format!("{digit:.0}e{power}"),
            };
            (value, name)
        });
        let mut ticks: Vec<_> = named.filter(|(value, _)| (low..=high).contains(&value.log10())).collect();
        if zero {
            ticks.push((0.0, "0".into()));
        }
        Axis { label: label.into(), scale: Scale::Log { low, high, zero }, ticks }
    }

    /// Values at its ends; the place for 0 is beyond.
    pub fn ends(&self) -> [f64; 2] {
        match self.scale {
            Scale::Linear { low, high } => [low, high],
            Scale::Log { low, high, .. } => [10f64.powf(low), 10f64.powf(high)],
        }
    }

    /// Whether it has a place for that value.
    fn holds(&self, value: f64) -> bool {
        match self.scale {
            Scale::Linear { .. } => value.is_finite(),
            Scale::Log { low, zero, .. } => value.is_finite() && (value.log10() >= low || zero && value == 0.0),
        }
    }

    /// 0 at the low end to 1 at the high end; values beyond an end are at that end.
    fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear { low, high } => ((value - low) / (high - low)).clamp(0.0, 1.0),
            Scale::Log { zero: true, .. } if value == 0.0 => 0.4 * FOR_ZERO,
            Scale::Log { low, high, zero } => {
                let start = if zero { FOR_ZERO } else { 0.0 };
                start + (1.0 - start) * ((value.log10() - low) / (high - low)).clamp(0.0, 1.0)
            }
        }
    }
}

/// 1, 2 or 5 times a power of ten, at least `step`.
fn nice_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    power * [1.0, 2.0, 5.0, 10.0].into_iter().find(|digit| digit * power >= step * 0.999).unwrap_or(10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|(_, name)| name.as_str()).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(names(&Axis::linear("", [0.0, 1.0])), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(names(&Axis::linear("", [0.0123, 0.0321])), ["0.010", "0.015", "0.020", "0.025", "0.030", "0.035"]);
        assert_eq!(
            names(&Axis::linear("", [3.0, 3.0])),
            ["1", "2", "3", "4", "5"],
            "a single value has some room around it"
        );
        assert_eq!(names(&Axis::linear("", [f64::INFINITY, f64::NEG_INFINITY])).len(), 6, "no value at all");
        assert_eq!(names(&Axis::linear("", [0.0, 0.0])).first(), Some(&"0.0"), "what is never negative stays so");
        assert_eq!(names(&Axis::whole("", [1, 4])), ["1", "2", "3", "4"]);
        assert_eq!(names(&Axis::whole("", [1, 64])), ["1", "10", "20", "30", "40", "50", "60"]);
        assert_eq!(
            names(&Axis::log("", [0.0, 0.01, 1.0].into_iter())),
            ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5", "1", "0"]
        );
        assert_eq!(
            names(&Axis::log("", [1e-12, 1.0].into_iter())),
            ["1e-12", "1e-10", "1e-8", "1e-6", "1e-4", "0.01", "1"]
        );
    }

    #[test]
    fn a_logarithmic_axis_keeps_zero_apart() {
        let axis = Axis::log("", [0.0, 0.001, 1.0].into_iter());
        assert!(axis.place(0.0) < axis.place(0.001) - 0.05);
        assert!(axis.holds(0.0) && !axis.holds(-1.0) && !axis.holds(f64::NAN));
        assert!(!axis.holds(1e-5), "it would stand at the lower end, where it is not");
        assert!(!Axis::log("", [0.1, 1.0].into_iter()).holds(0.0));
    }

    #[test]
    fn many_series_have_looks_of_their_own_and_legends_of_several_rows() {
        let styles: Vec<Style> = (0..24).map(Style::numbered).chain([Style::of_baseline()]).collect();
        assert!(styles.iter().enumerate().all(|(i, style)| !styles[..i].contains(style)));
        let series = |i: usize| Series {
            name: format!("replicas {i}"),
            style: Style::numbered(i),
            marks: Marks::Lines,
            data: points([[1.0, 1.0], [2.0, 0.5]]),
        };
        let panel = Panel {
            title: String::new(),
            x: Axis::log("", [1.0, 2.0].into_iter()),
            y: Axis::log("", [1.0, 0.5].into_iter()),
            series: (0..24).map(series).collect(),
        };
        let places = legend_places(&panel, 400.0);
        assert!(places.iter().all(|[x, _]| x + 29.0 + 10.0 * PIXELS_PER_LETTER <= 400.0));
        assert!(places.iter().enumerate().all(|(i, place)| !places[..i].contains(place)));
        let mut page = Page::new(500.0, 400.0);
        page.panel(Area { x: 0.0, y: 0.0, width: 500.0, height: 400.0 }, &panel);
        roxmltree::Document::parse(&page.finish()).unwrap();
    }

    #[test]
    fn any_text_is_legal_xml() {
        let mut page = Page::new(10.0, 10.0);
        page.words(0.0, 0.0, 1.0, "a<b & \"c\"\u{1b}>");
        let file = page.finish();
        let document = roxmltree::Document::parse(&file).unwrap();
        assert!(document.descendants().any(|node| node.text() == Some("a<b & \"c\" >")));
    }
}
