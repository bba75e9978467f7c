//! The pictures of a page as files of their own: SVG with texts as texts, which browsers show and other programs turn into PDF.

use std::fmt::Write as _;

use pdk_sdk::error::Result;

use crate::closed_loop::failing;
use crate::color::Rgb;
use crate::curve::Chart;
use crate::heat::{Cell, Grid};
use crate::tables::suffix;
use crate::tracks::{Track, Tracks};
use crate::view::Run;
use crate::{closed_loop, compare, offline, road, search, tasks};

/// A picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Its name, which its file is named after.
    pub name: String,
    /// The file.
    pub svg: String,
}

/// Colours of what the style sheet of the page colours.
const STYLE: &str = "text{font-family:Helvetica,Arial,sans-serif;fill:#1d2127}.dim{fill:#5d6570}.rule{stroke:#d9dde2}\
    .band{fill:none;stroke:#dfe3e8;stroke-width:26;stroke-linejoin:round;stroke-linecap:round}\
    .line{fill:none;stroke-linejoin:round;stroke-linecap:round}.mark{fill:none;stroke:#1d2127;stroke-width:5;stroke-linecap:round}\
    .start{fill:#fff;stroke:#1d2127;stroke-width:4}.scale{stroke:#5d6570;stroke-width:4}";

/// The colour of a failure that is not shared with other series.
const FAILED: Rgb = Rgb(179, 38, 30);
const NEVER: Rgb = Rgb(93, 101, 112);

/// The pictures of a run.
///
/// # Errors
/// If one cannot be drawn.
pub fn figures(run: &Run) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    let mut add = |name: String, svg: String| figures.push(Figure { name, svg });
    if run.drives.len() <= failing::TOGETHER {
        let all: Vec<_> = run.drives.iter().collect();
        failing::picture(&all).iter().for_each(|picture| add("failing-levels".to_owned(), tracks(picture)));
    }
    let classes = road::classes(&run.drives);
    for (place, drive) in run.drives.iter().enumerate() {
        let suffix = suffix(place, run.drives.len());
        let section = closed_loop::section(drive, &run.drives, &classes)?;
        if let Some(picture) = &section.failing {
            add(format!("failing-levels{suffix}"), tracks(picture));
        }
        add(format!("failed{suffix}"), heat(&section.failed, "Failed scenarios"));
        add(format!("error{suffix}"), heat(&section.error, "Mean absolute cross-track error in m"));
        for (number, curves) in section.curves.iter().enumerate() {
            add(format!("still-driving{suffix}-{}", number + 1), chart(curves));
        }
        for picture in &section.roads {
            let size = (picture.width.max(0) as u32, picture.height.max(0) as u32);
            add(format!("road{suffix}-{}", picture.number), file(size, &picture.label, &picture.body));
        }
    }
    let pairs = compare::pairs(&run.drives);
    for (place, (base, other)) in pairs.iter().enumerate() {
        let suffix = suffix(place, pairs.len());
        if let Some(found) = compare::comparison(base, other) {
            let title = format!("{} fails more often (+) or less often than {}", found.other, found.base);
            add(format!("difference{suffix}"), heat(&found.grids[2], &title));
        }
    }
    offline::picture::picture(&run.evaluations)
        .iter()
        .for_each(|picture| add("steering".to_owned(), tracks(picture)));
    let scale = offline::Scale::of(&run.evaluations);
    for (place, evaluation) in run.evaluations.iter().enumerate() {
        let suffix = suffix(place, run.evaluations.len());
        let section = offline::section(evaluation, &scale)?;
        add(format!("steering-error{suffix}"), heat(&section.error, "Mean absolute steering error"));
        add(format!("steering-drift{suffix}"), heat(&section.drift, "Mean absolute drift of the steering"));
        section.curves.iter().for_each(|curves| add(format!("steering-over-level{suffix}"), chart(curves)));
    }
    for (place, task) in run.tasks.iter().enumerate() {
        let (section, suffix) = (tasks::section(task), suffix(place, run.tasks.len()));
        for (number, (name, grid)) in section.grids.iter().enumerate() {
            add(format!("task{suffix}-{}", number + 1), heat(grid, &format!("{name} of {}", section.name)));
        }
    }
    for (place, search) in run.searches.iter().enumerate() {
        let (section, suffix) = (search::section(search)?, suffix(place, run.searches.len()));
        for (number, curves) in section.curves.iter().enumerate() {
            add(format!("search{suffix}-{}", number + 1), chart(curves));
        }
        for (number, picture) in section.space.iter().chain(&section.objectives).enumerate() {
            let size = (picture.width, picture.height);
            add(format!("tests{suffix}-{}", number + 1), file(size, &picture.label, &picture.body));
        }
    }
    Ok(figures)
}

/// A file of this size with what is drawn.
fn file((width, height): (u32, u32), label: &str, body: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\">\n\
         <title>{}</title>\n<style>{STYLE}</style>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n{body}\n</svg>\n",
        escaped(label)
    )
}

fn escaped(text: &str) -> minijinja::HtmlEscape<'_> {
    minijinja::HtmlEscape(text)
}

fn text(body: &mut String, (x, y): (u32, u32), size: u32, rest: &str, words: &str) {
    let _ = writeln!(body, "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{rest}>{}</text>", escaped(words));
}

/// Room for the names of rows, by the longest.
fn labels<'a>(names: impl Iterator<Item = &'a String>) -> u32 {
    let longest = names.map(|name| name.chars().count()).max().unwrap_or(0);
    40 + 11 * longest.clamp(10, 45) as u32
}

/// Curves with their legend below.
fn chart(chart: &Chart) -> String {
    let mut body = chart.body.clone();
    let mut y = chart.height + 34;
    for (key, name, color) in &chart.legend {
        let _ = writeln!(body, "<path d=\"M20 {}h50\" stroke=\"{color}\" stroke-width=\"6\"/>", y - 9);
        text(&mut body, (84, y), 28, "", &format!("{key}  {name}"));
        y += 38;
    }
    file((chart.width, y), &chart.label, &body)
}

const ROW: u32 = 38;

/// A heat map.
fn heat(grid: &Grid, title: &str) -> String {
    let names: Vec<String> = grid.rows.iter().map(|row| row.label.clone()).collect();
    let (left, columns) = (labels(names.iter()), grid.columns.len().max(1) as u32);
    let longest = |cells: &[Option<Cell>]| cells.iter().flatten().map(|cell| cell.text.chars().count()).max();
    let longest = grid.rows.iter().filter_map(|row| longest(&row.cells)).max().unwrap_or(0);
    let width = (24 + 12 * longest as u32).max(100);
    let mut body = String::new();
    text(&mut body, (12, 34), 24, " font-weight=\"bold\"", title);
    for (place, level) in (0..).zip(&grid.columns) {
        let name = level.as_ref().map_or("as given".to_owned(), |level| format!("level {level}"));
        let at = (left + place * width + width / 2, 78);
        text(&mut body, at, 20, " text-anchor=\"middle\" class=\"dim\"", &name);
    }
    let cell = |body: &mut String, (x, y): (u32, u32), wide: u32, cell: &Cell| {
        let (ground, ink) = cell.shade.on_paper();
        let _ = writeln!(
            body,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" fill=\"{ground}\"/>",
            wide - 3,
            ROW - 3
        );
        if cell.mixed {
            let _ = writeln!(
                body,
                "<rect x=\"{x}\" y=\"{y}\" width=\"7\" height=\"{}\" fill=\"{FAILED}\"/>",
                ROW - 3
            );
        }
        let style = format!(" text-anchor=\"middle\" style=\"fill:{ink}\"");
        text(body, (x + wide / 2, y + 25), 20, &style, &cell.text);
    };
    let mut y = 92;
    if let Some(nominal) = &grid.nominal {
        text(&mut body, (12, y + 25), 20, "", "no perturbation");
        cell(&mut body, (left, y), columns * width, nominal);
        y += ROW;
    }
    for row in &grid.rows {
        text(&mut body, (12, y + 25), 20, "", &row.label);
        for (place, one) in (0..).zip(&row.cells) {
            if let Some(one) = one {
                cell(&mut body, (left + place * width, y), width, one);
            }
        }
        y += ROW;
    }
    let (end, mut x) = ((left + columns * width + 12).max(760), 12);
    for ramp in &grid.legend {
        let steps = if ramp.least.is_empty() { 1 } else { 12 };
        text(&mut body, (x, y + 34), 18, " class=\"dim\"", &ramp.least);
        x += 10 * ramp.least.chars().count() as u32 + 8;
        for step in 0..steps {
            let share = if steps == 1 { 1.0 } else { f64::from(step) / f64::from(steps - 1) };
            let (ground, _) = crate::color::Shade::new(ramp.hue, share).on_paper();
            let _ = writeln!(
                body,
                "<rect x=\"{x}\" y=\"{}\" width=\"12\" height=\"18\" fill=\"{ground}\"/>",
                y + 19
            );
            x += 12;
        }
        text(&mut body, (x + 8, y + 34), 18, " class=\"dim\"", &ramp.most);
        x += 10 * ramp.most.chars().count() as u32 + 36;
    }
    file((end.max(x), y + 56), title, &body)
}

/// Where the scale lies, and how wide it is.
const SCALE: u32 = 620;

/// Estimates with their intervals.
fn tracks(picture: &Tracks) -> String {
    let left = labels(picture.rows.iter().map(|row| &row.label));
    let lanes = |row: &crate::tracks::Row| row.tracks.iter().flatten().count().max(1) as u32;
    let rows: u32 = picture.rows.iter().map(lanes).sum();
    let at = |place: f64| f64::from(left) + place * f64::from(SCALE);
    let (mut body, mut y) = (String::new(), 60);
    text(&mut body, (12, 34), 24, " font-weight=\"bold\"", &picture.title);
    for (key, name, color) in &picture.series {
        let _ = writeln!(body, "<path d=\"M12 {}h44\" stroke=\"{color}\" stroke-width=\"6\"/>", y + 13);
        text(&mut body, (68, y + 20), 20, "", &format!("{key}  {name}"));
        y += 30;
    }
    let bottom = y + rows * ROW;
    if let Some((_, place)) = &picture.beyond {
        let (from, wide) = (at(*place), (1.0 - place) * f64::from(SCALE));
        let _ = writeln!(
            body,
            "<rect x=\"{from:.1}\" y=\"{y}\" width=\"{wide:.1}\" height=\"{}\" fill=\"#f3f4f6\"/>",
            rows * ROW
        );
    }
    for (words, place) in picture.ticks.iter().chain(&picture.beyond) {
        let x = at(*place);
        let _ = writeln!(body, "<path class=\"rule\" d=\"M{x:.1} {y}V{bottom}\"/>");
        let anchor =
            if picture.beyond.as_ref().is_some_and(|(_, end)| end == place) { "start" } else { "middle" };
        let rest = format!(" text-anchor=\"{anchor}\" class=\"dim\"");
        text(&mut body, (x as u32, bottom + 26), 18, &rest, words);
    }
    if let Some((_, place)) = &picture.reference {
        let _ = writeln!(
            body,
            "<path d=\"M{:.1} {y}V{bottom}\" stroke=\"{NEVER}\" stroke-width=\"2\"/>",
            at(*place)
        );
    }
    text(&mut body, (12, bottom + 26), 18, " class=\"dim\"", &picture.scale);
    for row in &picture.rows {
        let _ = writeln!(body, "<path class=\"rule\" d=\"M12 {y}H{}\"/>", left + SCALE + 300);
        text(&mut body, (12, y + 26), 20, "", &row.label);
        for (series, track) in
            row.tracks.iter().enumerate().filter_map(|(at, track)| Some((at, track.as_ref()?)))
        {
            let color = match picture.series.get(series) {
                Some((_, _, color)) => *color,
                None if track.is_reached => FAILED,
                None => NEVER,
            };
            draw(&mut body, track, color, y, &at);
            let key = picture.series.get(series).map_or(String::new(), |(key, ..)| format!("{key}  "));
            let interval =
                if track.interval.is_empty() { String::new() } else { format!(" ({})", track.interval) };
            text(&mut body, (left + SCALE + 14, y + 26), 18, "", &format!("{key}{}{interval}", track.text));
            y += ROW;
        }
        if row.tracks.iter().flatten().next().is_none() {
            y += ROW;
        }
    }
    file((left + SCALE + 320, bottom + 44), &picture.title, &body)
}

fn draw(body: &mut String, track: &Track, color: Rgb, y: u32, at: &dyn Fn(f64) -> f64) {
    let (low, high) = (at(track.low), at(if track.is_open { 1.0 } else { track.high }));
    let middle = y + ROW / 2;
    let _ = writeln!(
        body,
        "<path d=\"M{low:.1} {middle}H{:.1}\" stroke=\"{color}\" stroke-width=\"10\" stroke-opacity=\".38\"/>",
        high.max(low + 3.0)
    );
    if let Some(place) = track.at {
        let fill = if track.is_reached { color } else { Rgb(255, 255, 255) };
        let _ = writeln!(
            body,
            "<circle cx=\"{:.1}\" cy=\"{middle}\" r=\"8\" fill=\"{fill}\" stroke=\"{color}\" stroke-width=\"3\"/>",
            at(place)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Drive, Scenario, Verdict};

    #[test]
    fn figures_are_files_that_need_nothing_besides_themselves() {
        let at = |name: &str, level: f64, road: usize| Scenario {
            perturbation: Some(name.to_owned()),
            level: Some(level),
            road_id: road.to_string(),
            verdict: if level > 1.0 { Verdict::Unsafe } else { Verdict::Passed },
            time: 5.0,
            ..Scenario::default()
        };
        let levels = [0.0, 2.0];
        let scenarios: Vec<Scenario> =
            (0..5).flat_map(|road| levels.map(|level| at("<fog> & \"rain\"", level, road))).collect();
        let drive = Drive { driver: "a&b".into(), scenarios, ..Drive::default() };
        let run = Run { drives: vec![drive], ..Run::default() };
        let all = figures(&run).unwrap();
        let names: Vec<&str> = all.iter().map(|figure| figure.name.as_str()).collect();
        assert_eq!(names, ["failing-levels", "failed", "error", "still-driving-1", "still-driving-2"]);
        for figure in &all {
            let svg = &figure.svg;
            assert!(svg.starts_with("<svg xmlns=") && svg.trim_end().ends_with("</svg>"), "{svg}");
            assert_eq!(svg.matches("http").count(), 1, "only the name space: {svg}");
            assert!(!svg.contains("<fog>") && !svg.contains("var("), "{svg}");
            assert!(svg.contains("<text"), "texts stay texts");
        }
        assert!(all[0].svg.contains("&lt;fog&gt;"));
    }
}
