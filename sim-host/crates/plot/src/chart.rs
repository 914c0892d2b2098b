//! A figure as plain data: what analyses hand over to be drawn.

use crate::axes::{Axes, BESIDE, CAPTION, RIGHT, TICKS, TICKS_AND_NAME, shortened};
use crate::axis::{Axis, bounds};
use crate::canvas::{Anchor, Area, Line, TextStyle};
use crate::figure::{Sample, draw_legend, figure, legend_height};
use crate::reduce::{Point, curve};
use crate::style::{DOTS, INK, INSTANT, LEVEL, RUNS, TEXT_FONT, WIDTH, text_width};

/// A figure: panels stacked below a heading and a legend.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chart {
    /// What the figure shows.
    pub heading: String,
    /// Its panels from the top.
    pub panels: Vec<Panel>,
}

/// One pair of axes and what is drawn between them. What lies beyond axes of a given range is cut
/// off.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Panel {
    /// Text above the panel; may be empty.
    pub caption: String,
    /// Horizontal axis. Stacked panels of equal horizontal axes share its range, and the lowest of
    /// them names it.
    pub x: AxisSpec,
    /// Vertical axis.
    pub y: AxisSpec,
    /// Lines and dots.
    pub series: Vec<Series>,
    /// Ranges of the horizontal axis with their labels above the panel; every second one is
    /// shaded.
    pub regions: Vec<Region>,
    /// Vertical lines with their labels above the panel.
    pub instants: Vec<(f64, String)>,
    /// Horizontal lines at these values.
    pub levels: Vec<f64>,
}

/// An axis.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AxisSpec {
    /// What it shows, with its unit.
    pub name: String,
    /// Its ends; without any, those of the data with a margin. Ends that an axis cannot have
    /// (reversed, not finite, not positive on a logarithmic axis) count as none.
    pub range: Option<(f64, f64)>,
    /// Logarithmic instead of linear; values that are not positive are left out.
    pub logarithmic: bool,
}

impl AxisSpec {
    /// A linear axis around the data.
    pub fn linear(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            ..Self::default()
        }
    }

    /// A logarithmic axis around the data.
    pub fn logarithmic(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            logarithmic: true,
            ..Self::default()
        }
    }

    /// The axis with these ends.
    pub fn from_to(self, low: f64, high: f64) -> Self {
        Self {
            range: Some((low, high)),
            ..self
        }
    }

    fn axis(&self, values: impl Iterator<Item = f64>, ticks: usize) -> Axis {
        let name = &self.name;
        let possible = |&(low, high): &(f64, f64)| {
            low < high && low.is_finite() && high.is_finite() && (low > 0.0 || !self.logarithmic)
        };
        match (self.range.filter(possible), self.logarithmic) {
            (Some((low, high)), true) => Axis::logarithmic(name, low, high, ticks),
            (Some((low, high)), false) => Axis::linear(name, low, high, ticks),
            (None, true) => Axis::decades(name, values, ticks),
            (None, false) => Axis::around(name, values, ticks),
        }
    }
}

/// Points with their look.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend; empty: it is not in the legend.
    pub label: String,
    /// Points in the units of the axes. Those that are not finite interrupt a line.
    pub points: Vec<(f64, f64)>,
    /// How they are drawn.
    pub look: Look,
}

/// More dots than this are drawn small: large ones in such a number would hide each other.
const MOST_LARGE_DOTS: usize = 3000;
/// Colours of dots before they repeat.
const COLOURS: usize = 4;

/// The `n`-th set of dots of a panel, to be seen one by one: a name for the legend, and each dot as
/// a line of one point.
pub fn large_dots(label: &str, n: usize, points: Vec<(f64, f64)>) -> Vec<Series> {
    let named = Series {
        label: label.into(),
        points: points.clone(),
        look: Look::Dots,
    };
    if points.len() > MOST_LARGE_DOTS {
        return vec![named];
    }
    let large = |point| Series {
        label: String::new(),
        points: vec![point],
        look: Look::Line(n % COLOURS),
    };
    std::iter::once(named)
        .chain(points.into_iter().map(large))
        .collect()
}

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Joined by the n-th line style. A line so short that it could not be seen is drawn as a large
    /// dot.
    Line(usize),
    /// Small dots, those of the same pixel once. Each such series of a panel has its own colour.
    Dots,
}

/// A range of the horizontal axis.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Region {
    /// Its lower end.
    pub from: f64,
    /// Its upper end.
    pub to: f64,
    /// Its name; may be empty.
    pub label: String,
}

const TICKS_ACROSS: usize = 12;
const MOST_POINTS: usize = 12_000;
/// A line that stays within this many units of the drawing is drawn as a dot.
const DOT: f64 = 8.0;
/// Least distance of two labels.
const GAP: i32 = 16;

impl Chart {
    /// The figure as an SVG document. A panel without a point that can be drawn says "no data".
    ///
    /// ```
    /// use plot::chart::{AxisSpec, Chart, Look, Panel, Series};
    /// let points = (0..100).map(|k| (f64::from(k), f64::from(k).sin())).collect();
    /// let chart = Chart {
    ///     heading: "A sine".into(),
    ///     panels: vec![Panel {
    ///         x: AxisSpec::linear("time (s)"),
    ///         y: AxisSpec::linear("angle (rad)"),
    ///         series: vec![Series { label: "sine".into(), points, look: Look::Line(0) }],
    ///         ..Panel::default()
    ///     }],
    /// };
    /// assert!(chart.svg().starts_with("<svg"));
    /// ```
    pub fn svg(&self) -> String {
        let plot_height = match self.panels.len() {
            0 | 1 => 560,
            2 => 380,
            _ => 280,
        };
        let layouts: Vec<Layout> = (0..self.panels.len())
            .map(|n| Layout::new(self, n, plot_height))
            .collect();
        let height = layouts.iter().map(|layout| layout.height).sum();
        figure(&self.heading, &self.legend(), height, |area| {
            let mut rest = *area;
            for (panel, layout) in self.panels.iter().zip(&layouts) {
                let (row, below) = rest.split_below(layout.height);
                panel.draw(&row, layout);
                rest = below;
            }
        })
    }

    /// The legend of the figure; empty if its panels differ in their legends and have their own.
    fn legend(&self) -> Legend {
        let mut legends = self.panels.iter().map(Panel::legend);
        let mut legends: Vec<Legend> = legends.by_ref().filter(|own| !own.is_empty()).collect();
        legends.dedup();
        match legends.len() {
            1 => legends.remove(0),
            _ => Vec::new(),
        }
    }
}

/// Labels with what is shown of them.
type Legend = Vec<(String, Sample)>;

/// Where the parts of a panel go.
struct Layout {
    x: Axis,
    y: Axis,
    /// Rows of text above the axes.
    rows: i32,
    /// Label, middle and row from the bottom of those rows.
    labels: Vec<(String, i32, i32)>,
    /// The panel's own legend, above its caption.
    legend: Legend,
    height: i32,
}

impl Layout {
    fn new(chart: &Chart, n: usize, plot_height: i32) -> Self {
        let panel = &chart.panels[n];
        let sharing = chart.panels.iter().filter(|other| other.x == panel.x);
        let values = sharing.flat_map(|other| other.points().map(|point| point.0));
        let mut x = panel.x.axis(values, TICKS_ACROSS);
        let heights = panel.points().map(|point| point.1);
        let levels = panel.levels.iter().copied();
        let y = panel
            .y
            .axis(heights.chain(levels), (plot_height / 60) as usize);
        let named_below = chart.panels.get(n + 1).is_some_and(|p| p.x == panel.x);
        if named_below {
            x = x.named("");
        }
        let labels = panel.labels(&x);
        let label_rows = labels.iter().map(|label| label.2 + 1).max().unwrap_or(0);
        let rows = (label_rows + i32::from(!panel.caption.is_empty())).max(1);
        let below = if x.name.is_empty() {
            TICKS
        } else {
            TICKS_AND_NAME
        };
        let legend = if chart.legend().is_empty() {
            panel.legend()
        } else {
            Vec::new()
        };
        Self {
            height: legend_height(&legend) + CAPTION * rows + plot_height + below,
            x,
            y,
            rows,
            labels,
            legend,
        }
    }
}

impl Panel {
    /// Points without a caption, a label or ranges: for instance one component of states over
    /// another.
    pub fn of_points(
        (x, y): (impl Into<String>, impl Into<String>),
        points: Vec<(f64, f64)>,
        look: Look,
    ) -> Self {
        Self {
            x: AxisSpec::linear(x),
            y: AxisSpec::linear(y),
            series: vec![Series {
                label: String::new(),
                points,
                look,
            }],
            ..Self::default()
        }
    }

    /// Points that are finite.
    fn points(&self) -> impl Iterator<Item = Point> + '_ {
        let all = self.series.iter().flat_map(|series| &series.points);
        all.copied().filter(|(x, y)| x.is_finite() && y.is_finite())
    }

    /// The series, each with its line or the line whose colour its dots have.
    fn styled(&self) -> impl Iterator<Item = (&Series, Line)> {
        let mut dots = DOTS.into_iter().cycle();
        self.series.iter().map(move |series| {
            let line = match series.look {
                Look::Line(n) => RUNS[n % RUNS.len()],
                Look::Dots => dots.next().unwrap_or(DOTS[0]),
            };
            (series, line)
        })
    }

    fn legend(&self) -> Legend {
        let mut legend: Legend = Vec::new();
        for (series, line) in self.styled() {
            let known = legend.iter().any(|(label, _)| *label == series.label);
            if !series.label.is_empty() && !known {
                let sample = match series.look {
                    Look::Line(_) => Sample::Line(line),
                    Look::Dots => Sample::Dot(line),
                };
                legend.push((series.label.clone(), sample));
            }
        }
        legend
    }

    /// Labels of regions and instants, each in the lowest row in which it does not meet another.
    fn labels(&self, x: &Axis) -> Vec<(String, i32, i32)> {
        let (left, right) = (BESIDE, WIDTH - RIGHT);
        let unit = |value: f64| left + (x.fraction(value) * f64::from(right - left)) as i32;
        let visible = |from: f64, to: f64| to >= x.low && from <= x.high;
        let regions = self.regions.iter().map(|region| {
            let middle = (unit(region.from) + unit(region.to)) / 2;
            (region.from, region.to, middle, &region.label)
        });
        let instants = self.instants.iter();
        let instants = instants.map(|(at, label)| (*at, *at, unit(*at), label));
        let mut labels: Vec<(i32, &String)> = regions
            .chain(instants)
            .filter(|(from, to, _, label)| visible(*from, *to) && !label.is_empty())
            .map(|(_, _, middle, label)| (middle, label))
            .collect();
        labels.sort();
        let mut ends: Vec<i32> = Vec::new();
        labels
            .into_iter()
            .map(|(middle, label)| {
                let half = text_width(label, TEXT_FONT) / 2;
                let most = (WIDTH - GAP - half).max(half);
                let middle = middle.clamp(half, most);
                let free = |end: &i32| middle - half >= end + GAP;
                let row = ends.iter().position(free).unwrap_or(ends.len());
                ends.resize(ends.len().max(row + 1), 0);
                ends[row] = middle + half;
                (label.clone(), middle, row as i32)
            })
            .collect()
    }

    fn draw(&self, area: &Area, layout: &Layout) {
        draw_legend(area, &layout.legend, 0);
        let (_, area) = area.split_below(legend_height(&layout.legend));
        let row_middle = |row: i32| CAPTION * row + CAPTION / 2;
        let style = TextStyle::new(TEXT_FONT, INK);
        let caption = shortened(&self.caption, WIDTH - BESIDE - RIGHT);
        area.text(&caption, (BESIDE, row_middle(0)), style);
        let style = style.anchored(Anchor::Middle);
        for (label, middle, row) in &layout.labels {
            let place = (*middle, row_middle(layout.rows - 1 - row));
            area.text(label, place, style);
        }
        let (_, axes_area) = area.split_below(CAPTION * (layout.rows - 1));
        let (x, y) = (layout.x.clone(), layout.y.clone());
        let axes = Axes::new(&axes_area, ("", ""), x, y);
        for region in self.regions.iter().skip(1).step_by(2) {
            axes.band(region.from, region.to);
        }
        for level in self.levels.iter().filter(|level| layout.y.holds(**level)) {
            axes.level(*level, LEVEL);
        }
        for (at, _) in &self.instants {
            axes.instant(*at, INSTANT);
        }
        let mut drawn = false;
        for (series, line) in self.styled() {
            drawn |= match series.look {
                Look::Line(_) => draw_line(&axes, layout, &series.points, line),
                Look::Dots => draw_dots(&axes, layout, &series.points, line),
            };
        }
        if !drawn {
            axes.no_data();
        }
    }
}

fn draw_dots(axes: &Axes, layout: &Layout, points: &[Point], line: Line) -> bool {
    let visible = |point: &&Point| layout.x.holds(point.0) && layout.y.holds(point.1);
    let points: Vec<Point> = points.iter().filter(visible).copied().collect();
    axes.dots(&points, line);
    !points.is_empty()
}

/// Draws a line as far as it lies between the axes; false if no part of it does.
fn draw_line(axes: &Axes, layout: &Layout, points: &[Point], line: Line) -> bool {
    let scale = axes.units_per_place();
    let pieces = visible_pieces(&layout.x, &layout.y, points);
    for piece in &pieces {
        let reduced = curve(piece.iter().copied(), scale, MOST_POINTS);
        let values: Vec<Point> = reduced
            .iter()
            .map(|place| (layout.x.value(place.0), layout.y.value(place.1)))
            .collect();
        let extent = |places: &mut dyn Iterator<Item = f64>| {
            bounds(places).map_or(0.0, |(low, high)| high - low)
        };
        let width = extent(&mut reduced.iter().map(|place| place.0)) * scale.0;
        let height = extent(&mut reduced.iter().map(|place| place.1)) * scale.1;
        if width.max(height) < DOT && pieces.len() == 1 {
            axes.dot(values[0], line);
        } else {
            axes.lines(&[(&values, line)]);
        }
    }
    !pieces.is_empty()
}

/// The parts of a line that lie between the axes, in places on them.
fn visible_pieces(x: &Axis, y: &Axis, points: &[Point]) -> Vec<Vec<Point>> {
    let takes = |point: &Point| x.takes(point.0) && y.takes(point.1);
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    for run in points.split(|point| !takes(point)) {
        let places: Vec<Point> = run.iter().map(|p| (x.place(p.0), y.place(p.1))).collect();
        if let [only] = places[..]
            && x.holds(run[0].0)
            && y.holds(run[0].1)
        {
            pieces.push(vec![only]);
        }
        let mut joined = false;
        for pair in places.windows(2) {
            let Some((from, to)) = clipped(pair[0], pair[1], x.ends(), y.ends()) else {
                joined = false;
                continue;
            };
            match pieces.last_mut() {
                Some(piece) if joined && from == pair[0] => piece.push(to),
                _ => pieces.push(vec![from, to]),
            }
            joined = to == pair[1];
        }
    }
    pieces
}

/// The part of a straight piece within the ranges of both coordinates (Liang and Barsky's
/// algorithm).
fn clipped(from: Point, to: Point, x: Point, y: Point) -> Option<(Point, Point)> {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let sides = [
        (-dx, from.0 - x.0),
        (dx, x.1 - from.0),
        (-dy, from.1 - y.0),
        (dy, y.1 - from.1),
    ];
    for (outwards, room) in sides {
        if outwards == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if outwards < 0.0 {
            enter = enter.max(room / outwards);
        } else {
            leave = leave.min(room / outwards);
        }
    }
    let at = |share: f64| match share {
        0.0 => from,
        1.0 => to,
        _ => (from.0 + share * dx, from.1 + share * dy),
    };
    (enter <= leave).then(|| (at(enter), at(leave)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(label: &str, look: Look, points: Vec<Point>) -> Series {
        Series {
            label: label.into(),
            points,
            look,
        }
    }

    fn chart(panel: Panel) -> Chart {
        Chart {
            heading: "heading".into(),
            panels: vec![panel],
        }
    }

    #[test]
    fn nothing_to_draw_says_so() {
        let nan = series("nan", Look::Line(0), vec![(f64::NAN, 1.0), (1.0, f64::NAN)]);
        let outside = series("outside", Look::Dots, vec![(5.0, 5.0)]);
        for all in [vec![], vec![nan], vec![outside]] {
            let panel = Panel {
                x: AxisSpec::linear("x").from_to(0.0, 1.0),
                series: all,
                levels: vec![f64::NAN, 0.5],
                instants: vec![(f64::NAN, "never".into())],
                regions: vec![Region::default(); 3],
                ..Panel::default()
            };
            let svg = chart(panel).svg();
            assert!(svg.contains("no data") && !svg.contains("NaN"), "{svg}");
        }
        assert!(Chart::default().svg().starts_with("<svg"));
    }

    #[test]
    fn impossible_ranges_count_as_none() {
        for range in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, 1.0)] {
            let axis = AxisSpec::logarithmic("f (Hz)").from_to(range.0, range.1);
            let axis = axis.axis([10.0, 100.0].into_iter(), 8);
            assert_eq!((axis.low, axis.high), (10.0, 100.0));
        }
    }

    #[test]
    fn a_line_is_cut_where_it_leaves_the_axes() {
        let x = Axis::linear("", 0.0, 10.0, 5);
        let y = Axis::linear("", 0.0, 1.0, 5);
        let points = [(0.0, 0.5), (2.0, 0.5), (4.0, 2.5), (6.0, 0.5), (8.0, 0.5)];
        let pieces = visible_pieces(&x, &y, &points);
        assert_eq!(
            pieces,
            [
                vec![(0.0, 0.5), (2.0, 0.5), (2.5, 1.0)],
                vec![(5.5, 1.0), (6.0, 0.5), (8.0, 0.5)]
            ]
        );
        let gap = [(1.0, 0.1), (2.0, 0.1), (f64::NAN, 0.1), (3.0, 0.1)];
        assert_eq!(visible_pieces(&x, &y, &gap).len(), 2);
    }

    #[test]
    fn panels_with_different_legends_have_their_own() {
        let panel = |label: &str| Panel {
            series: vec![series(label, Look::Line(0), vec![(0.0, 0.0), (1.0, 1.0)])],
            ..Panel::default()
        };
        let with = |labels: [&str; 2]| {
            let panels = labels.map(panel).into();
            let heading = String::new();
            Chart { heading, panels }
        };
        assert_eq!(with(["a", "a"]).legend().len(), 1);
        assert_eq!(with(["a", ""]).legend().len(), 1);
        let chart = with(["a", "b"]);
        assert!(chart.legend().is_empty());
        assert!(chart.svg().contains(">a</text>") && chart.svg().contains(">b</text>"));
    }

    #[test]
    fn many_dots_stay_a_small_file() {
        let points = (0..200_000)
            .map(|k| (f64::from(k) * 1e-3, (f64::from(k) * 0.618_034).fract()))
            .collect();
        let panel = Panel {
            series: vec![series("maxima", Look::Dots, points)],
            ..Panel::default()
        };
        let svg = chart(panel).svg();
        assert!(svg.len() < 1_000_000, "{} bytes", svg.len());
    }

    #[test]
    fn labels_that_would_meet_go_to_different_rows() {
        let region = |from: f64, to, label: &str| Region {
            from,
            to,
            label: label.into(),
        };
        let panel = Panel {
            x: AxisSpec::linear("wheel speed (rpm)").from_to(1600.0, 1900.0),
            regions: vec![
                region(1600.0, 1700.0, "I"),
                region(1700.0, 1702.0, "a long name"),
                region(1702.0, 1704.0, "another long name"),
                region(2000.0, 2100.0, "out of sight"),
            ],
            instants: vec![(1703.0, "instant".into())],
            ..Panel::default()
        };
        let labels = panel.labels(&panel.x.axis([].into_iter(), 8));
        let rows: Vec<i32> = labels.iter().map(|label| label.2).collect();
        assert_eq!(rows, [0, 0, 1, 2]);
    }

    #[test]
    fn a_motion_at_rest_is_a_dot() {
        let rest = series("rest", Look::Line(0), vec![(0.1, 0.2); 100]);
        let panel = Panel {
            series: vec![rest],
            ..Panel::default()
        };
        let svg = chart(panel).svg();
        assert!(svg.contains("<circle") && !svg.contains("no data"));
    }
}
