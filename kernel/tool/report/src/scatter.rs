//! Points over two quantities.

use pdk_sdk::error::{Error, Result};
use plotters::prelude::*;
use serde::Serialize;

use crate::color::{LINES, NOMINAL, ORDERED, Rgb};

/// A picture of points, without its outermost tag.
#[derive(Debug, Clone, Serialize)]
pub struct Scatter {
    /// The width of its coordinates.
    pub width: u32,
    /// Their height.
    pub height: u32,
    /// The tags within.
    pub body: String,
    /// What it shows.
    pub label: String,
}

/// A point, and what it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark {
    /// Its place from left to right.
    pub x: f64,
    /// Its place from below.
    pub y: f64,
    /// What it is.
    pub kind: Kind,
}

/// What a point is. Later ones are drawn above earlier ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A test that is not critical.
    Passed,
    /// A critical test.
    Critical,
    /// One of the best compromises.
    Best,
}

impl Kind {
    /// Its colour.
    pub fn color(self) -> Rgb {
        match self {
            Kind::Passed => NOMINAL,
            Kind::Critical => ORDERED[4],
            Kind::Best => LINES[0],
        }
    }
}

const SIZE: (u32, u32) = (1120, 760);
const TEXT: i32 = 34;

/// Draws points.
///
/// # Errors
/// If the picture cannot be drawn.
pub fn scatter(marks: &[Mark], x: &str, y: &str) -> Result<Scatter> {
    let label = format!("{y} over {x}");
    let mut svg = String::new();
    draw(&mut svg, marks, x, y).map_err(|error| Error::new(format!("cannot draw {label} ({error})")))?;
    let inner = svg.split_once('>').and_then(|(_, rest)| rest.rsplit_once("</svg>"));
    let body = inner.map(|(inner, _)| inner.trim().to_owned()).unwrap_or_default();
    Ok(Scatter { width: SIZE.0, height: SIZE.1, body, label })
}

fn draw(svg: &mut String, marks: &[Mark], x: &str, y: &str) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    let (across, up) = (range(marks.iter().map(|mark| mark.x)), range(marks.iter().map(|mark| mark.y)));
    let mut chart = ChartBuilder::on(&root)
        .margin(14)
        .x_label_area_size(92)
        .y_label_area_size(150)
        .build_cartesian_2d(across.0..across.1, up.0..up.1)?;
    let grid = RGBColor(128, 128, 128);
    let written = |value: &f64| format!("{}", (value * 1000.0).round() / 1000.0);
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(grid.mix(0.25))
        .axis_style(grid)
        .label_style(("sans-serif", TEXT))
        .x_desc(x)
        .y_desc(y)
        .x_labels(6)
        .y_labels(6)
        .x_label_formatter(&written)
        .y_label_formatter(&written)
        .draw()?;
    let mut order: Vec<&Mark> = marks.iter().collect();
    order.sort_by_key(|mark| mark.kind);
    chart.draw_series(order.into_iter().map(|mark| {
        let Rgb(r, g, b) = mark.kind.color();
        let size = if mark.kind == Kind::Best { 9 } else { 6 };
        Circle::new((mark.x, mark.y), size, RGBColor(r, g, b).mix(0.7).filled())
    }))?;
    root.present()?;
    Ok(())
}

/// What there is, with some room around.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    let room = if high > low { (high - low) * 0.05 } else { 0.5 };
    (low - room, high + room)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_drawn_also_a_single_one() {
        let marks: Vec<Mark> =
            [Kind::Best, Kind::Passed, Kind::Critical].map(|kind| Mark { x: 1.0, y: 2.0, kind }).to_vec();
        for count in 0..=3 {
            let picture = scatter(&marks[..count], "a", "<b>").unwrap();
            assert_eq!(picture.body.matches("<circle").count(), count);
            assert!(!picture.body.contains("<b>") && !picture.body.contains("<svg"));
        }
    }
}
