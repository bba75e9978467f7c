//! Curves over time or over the level.

use pdk_sdk::error::{Error, Result};
use plotters::prelude::*;
use serde::Serialize;

use crate::color::Rgb;

/// A picture of curves, without its outermost tag.
#[derive(Debug, Clone, Serialize)]
pub struct Chart {
    /// The width of its coordinates.
    pub width: u32,
    /// Their height.
    pub height: u32,
    /// The tags within.
    pub body: String,
    /// What it shows, for those who do not see it.
    pub label: String,
    /// Keys, names and colours of the curves.
    pub legend: Vec<(String, String, Rgb)>,
}

/// A curve.
#[derive(Debug, Clone)]
pub struct Curve {
    /// A few letters beside its end.
    pub key: String,
    /// Its name in the legend.
    pub name: String,
    /// Its points, from left to right.
    pub points: Vec<(f64, f64)>,
    /// A band around it: places with their lower and upper end. May be empty.
    pub band: Vec<(f64, f64, f64)>,
    /// Its colour.
    pub color: Rgb,
}

/// What the axes say.
#[derive(Debug, Clone)]
pub struct Axes<'a> {
    /// What lies on the horizontal axis.
    pub x: &'a str,
    /// Its range.
    pub x_range: (f64, f64),
    /// What lies on the vertical axis.
    pub y: &'a str,
    /// The upper end of its range.
    pub top: f64,
    /// Whether it is a share that is written in percent.
    pub share: bool,
    /// What the picture shows.
    pub label: &'a str,
}

/// Coordinates are whole numbers, so there are twice as many as pixels on a usual screen.
const SIZE: (u32, u32) = (1120, 620);
/// Large enough to be read where the picture is as narrow as a phone.
const TEXT: i32 = 34;
/// Between two keys, which are larger on a phone.
const GAP: i32 = 37;
/// Room on the right before the keys, and for each of those side by side.
const LEADER: i32 = 46;
const KEY: i32 = 30;

/// Draws curves.
///
/// # Errors
/// If the picture cannot be drawn.
pub fn chart(curves: &[Curve], axes: &Axes<'_>) -> Result<Chart> {
    let mut svg = String::new();
    let keys = draw(&mut svg, curves, axes)
        .map_err(|error| Error::new(format!("cannot draw the picture of {} ({error})", axes.label)))?;
    let inner = svg.split_once('>').and_then(|(_, rest)| rest.rsplit_once("</svg>"));
    let mut body = inner.map(|(inner, _)| inner.trim().to_owned()).unwrap_or_default();
    body += &end_labels(curves, &keys);
    Ok(Chart {
        width: SIZE.0,
        height: SIZE.1,
        body,
        label: axes.label.to_owned(),
        legend: curves.iter().map(|c| (c.key.clone(), c.name.clone(), c.color)).collect(),
    })
}

/// Draws axes and curves, and returns where each curve ends.
fn draw(
    svg: &mut String,
    curves: &[Curve],
    axes: &Axes<'_>,
) -> Result<Vec<(i32, i32)>, Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    // At most as many keys are side by side as curves end at the same value.
    let together = |a: &Curve| curves.iter().filter(|b| last(a).1 == last(b).1).count();
    let keys = curves.iter().map(together).max().unwrap_or(0) as i32;
    let margin = if axes.share { 0.02 } else { 0.05 } * axes.top;
    let mut chart = ChartBuilder::on(&root)
        .margin_top(14)
        .margin_right(LEADER + KEY * keys)
        .x_label_area_size(92)
        .y_label_area_size(130)
        .build_cartesian_2d(axes.x_range.0..axes.x_range.1, 0.0..axes.top + margin)?;
    let grid = RGBColor(128, 128, 128);
    let written = |value: &f64| match axes.share {
        true => format!("{:.0} %", value * 100.0),
        false => format!("{}", (value * 1000.0).round() / 1000.0),
    };
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(grid.mix(0.35))
        .axis_style(grid)
        .label_style(("sans-serif", TEXT))
        .x_desc(axes.x)
        .y_desc(axes.y)
        .x_labels(8)
        .y_labels(6)
        .x_label_formatter(&|value| format!("{}", (value * 100.0).round() / 100.0))
        .y_label_formatter(&written)
        .draw()?;
    for curve in curves.iter().filter(|curve| curve.band.len() > 1) {
        let Rgb(r, g, b) = curve.color;
        let upper = curve.band.iter().map(|(x, _, high)| (*x, *high));
        let outline: Vec<_> = upper.chain(curve.band.iter().rev().map(|(x, low, _)| (*x, *low))).collect();
        chart.draw_series(std::iter::once(Polygon::new(outline, RGBColor(r, g, b).mix(0.18).filled())))?;
    }
    let mut ends = Vec::new();
    for curve in curves {
        let Rgb(r, g, b) = curve.color;
        let style = RGBColor(r, g, b).stroke_width(5);
        chart.draw_series(LineSeries::new(curve.points.iter().copied(), style))?;
        ends.push(chart.backend_coord(&last(curve)));
    }
    root.present()?;
    drop(chart);
    Ok(ends)
}

/// The right end of a curve.
fn last(curve: &Curve) -> (f64, f64) {
    curve.points.last().copied().unwrap_or_default()
}

/// The keys at the right edge, each at the height of its curve's end, or as near as the others let it. Those of curves that
/// end together stand side by side.
fn end_labels(curves: &[Curve], ends: &[(i32, i32)]) -> String {
    let mut order: Vec<usize> = (0..curves.len()).collect();
    order.sort_by_key(|&i| (ends[i].1, i));
    let groups: Vec<&[usize]> =
        order.chunk_by(|&a, &b| ends[a].1 == ends[b].1 && last(&curves[a]).1 == last(&curves[b]).1).collect();
    let heights: Vec<i32> = groups.iter().map(|group| ends[group[0]].1).collect();
    let heights = spread(&heights, GAP, SIZE.1 as i32 - TEXT / 2);
    let right = ends.iter().map(|end| end.0).max().unwrap_or_default();
    let mut text = String::new();
    for (group, height) in groups.iter().zip(heights) {
        for (place, &i) in group.iter().enumerate() {
            let (x, y) = ends[i];
            if place == 0 {
                text += &format!(
                    "<path d=\"M{x} {y}L{} {height}\" stroke=\"{}\" stroke-width=\"2\" fill=\"none\"/>",
                    right + LEADER - 22,
                    curves[i].color
                );
            }
            text += &format!(
                "<text x=\"{}\" y=\"{height}\" dy=\".35em\" font-size=\"28\">{}</text>\n",
                right + LEADER - 16 + KEY * place as i32,
                minijinja::HtmlEscape(&curves[i].key)
            );
        }
    }
    text
}

/// Moves heights that come in order apart, so that two have at least `gap` between them and none is below `bottom`.
fn spread(heights: &[i32], gap: i32, bottom: i32) -> Vec<i32> {
    let mut spread: Vec<i32> = heights.to_vec();
    for i in 1..spread.len() {
        spread[i] = spread[i].max(spread[i - 1] + gap);
    }
    let mut limit = bottom;
    for height in spread.iter_mut().rev() {
        *height = (*height).min(limit);
        limit = *height - gap;
    }
    spread
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_do_not_overlap_and_stay_in_the_picture() {
        assert_eq!(spread(&[10, 10, 100], 20, 500), [10, 30, 100]);
        assert_eq!(spread(&[90, 95, 100], 20, 100), [60, 80, 100]);
        assert!(spread(&[], 20, 100).is_empty());
    }

    #[test]
    fn a_chart_has_its_curves_and_no_tag_around() {
        let curve = Curve {
            key: "<A>".into(),
            name: "a".into(),
            points: vec![(0.0, 1.0), (5.0, 0.5)],
            band: vec![(0.0, 0.9, 1.0), (5.0, 0.4, 0.6)],
            color: Rgb(1, 2, 3),
        };
        let axes =
            Axes { x: "time in s", x_range: (0.0, 5.0), y: "share", top: 1.0, share: true, label: "x" };
        let chart = chart(&[curve.clone(), curve], &axes).unwrap();
        assert_eq!(chart.body.matches("stroke=\"#010203\"").count(), 3, "{}", chart.body);
        assert_eq!(chart.body.matches("<polygon").count(), 2, "{}", chart.body);
        assert!(
            chart.body.contains("100 %")
                && chart.body.contains("time in s")
                && chart.body.contains("&lt;A&gt;")
        );
        assert!(
            !chart.body.contains("<svg") && !chart.body.contains("</svg") && !chart.body.contains("http")
        );
    }
}
