//! Pictures of a derivative: its course over time, and where in the frames it comes from.

use image::{Rgb, RgbImage};
use pdk_preview::picture::scaled;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::FrameBuf;
use plotters::prelude::*;

use crate::course::Course;
use crate::regions::{COLUMNS, ROWS};
use crate::rehearsal::Driven;
use crate::sweep::Sensitivity;

const WIDTH: u32 = 1120;
/// The height of each of the three panels.
const PANEL: u32 = 240;
const TEXT: i32 = 22;

/// The driven course, the changed one, and the error; more and less.
const DRIVEN: RGBColor = RGBColor(60, 72, 88);
const CHANGED: RGBColor = RGBColor(214, 84, 48);
const MORE: RGBColor = RGBColor(200, 40, 40);
const LESS: RGBColor = RGBColor(40, 90, 200);

/// How wide the picture of a frame is at least, in pixels.
const PICTURE: u32 = 960;

/// The course of a drive as an SVG: its cross-track error, the level of a perturbation, and how the largest error changes with the level at each frame.
/// `changed` is another course to show beside that of the drive.
///
/// # Errors
/// If it cannot be drawn.
pub fn over_time(
    driven: &Driven,
    sensitivity: &Sensitivity,
    perturbation: usize,
    rate: f64,
    changed: Option<&Course>,
) -> Result<String> {
    let mut svg = String::new();
    draw(&mut svg, driven, sensitivity, perturbation, rate, changed)
        .map_err(|error| Error::new(format!("cannot draw the course of the drive ({error})")))?;
    Ok(svg)
}

fn draw(
    svg: &mut String,
    driven: &Driven,
    sensitivity: &Sensitivity,
    perturbation: usize,
    rate: f64,
    changed: Option<&Course>,
) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, (WIDTH, 3 * PANEL)).into_drawing_area();
    root.fill(&WHITE)?;
    let panels = root.split_evenly((3, 1));
    let time = |frame: usize| frame as f64 / rate;
    let end = time(driven.places.len().saturating_sub(1)).max(1.0 / rate);
    let errors: Vec<(f64, f64)> = driven
        .places
        .iter()
        .enumerate()
        .map(|(frame, place)| (time(frame), place.state.cross_track_error))
        .collect();
    let most = errors.iter().map(|(_, error)| error.abs()).fold(0.1, f64::max);
    let mut chart = panel(
        &panels[0],
        end,
        (-1.1 * most, 1.1 * most),
        ["cross-track error (m)", ""],
        "red line: the largest error",
    )?;
    chart.draw_series(LineSeries::new(errors, DRIVEN.stroke_width(3)))?;
    let worst = time(sensitivity.worst);
    let mark = [(worst, -1.1 * most), (worst, 1.1 * most)];
    chart.draw_series(LineSeries::new(mark, MORE.mix(0.6).stroke_width(2)))?;

    let course = |course: &Course| -> Vec<(f64, f64)> {
        let levels = course.levels().iter().take(driven.places.len());
        levels.enumerate().map(|(frame, level)| (time(frame), *level)).collect()
    };
    let mut chart = panel(
        &panels[1],
        end,
        (-0.1, 4.1),
        ["level", ""],
        if changed.is_some() {
            "orange: the smallest change found with which the vehicle leaves its lane"
        } else {
            ""
        },
    )?;
    let own = course(&sensitivity.courses[perturbation]);
    chart.draw_series(LineSeries::new(own, DRIVEN.stroke_width(3)))?;
    if let Some(changed) = changed {
        chart.draw_series(LineSeries::new(course(changed), CHANGED.stroke_width(3)))?;
    }

    // In metres for a level that is there for a second, so that it does not depend on the rate.
    let influence = || sensitivity.influence[perturbation].iter().map(|by| by * rate);
    let most = influence().map(f64::abs).fold(1e-6, f64::max);
    let range = (-1.1 * most, 1.1 * most);
    let mut chart = panel(
        &panels[2],
        end,
        range,
        ["m per level per second", "simulation time (s)"],
        "how the largest error changes with the level at each time",
    )?;
    let bars = influence().enumerate().map(|(frame, by)| {
        let color = if by > 0.0 { MORE } else { LESS };
        Rectangle::new([(time(frame), 0.0), (time(frame + 1), by)], color.mix(0.75).filled())
    });
    chart.draw_series(bars)?;
    root.present()?;
    drop(chart);
    Ok(())
}

type Panel<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

/// A panel over the time of the drive.
fn panel<'a, 'b>(
    area: &'a DrawingArea<SVGBackend<'b>, plotters::coord::Shift>,
    end: f64,
    (bottom, top): (f64, f64),
    [y, x]: [&str; 2],
    caption: &str,
) -> Result<Panel<'a, 'b>, Box<dyn std::error::Error>>
where
    'b: 'a,
{
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", TEXT))
        .margin_top(6)
        .margin_left(8)
        .margin_right(24)
        .x_label_area_size(if x.is_empty() { 32 } else { 62 })
        .y_label_area_size(104)
        .build_cartesian_2d(0.0..end, bottom..top)?;
    let grid = RGBColor(128, 128, 128);
    let short = |value: &f64| format!("{}", (value * 1000.0).round() / 1000.0 + 0.0);
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(grid.mix(0.3))
        .axis_style(grid)
        .label_style(("sans-serif", TEXT))
        .x_desc(x)
        .y_desc(y)
        .x_labels(10)
        .y_labels(5)
        .x_label_formatter(&short)
        .y_label_formatter(&short)
        .draw()?;
    Ok(chart)
}

/// A frame with the cells in which more of the perturbation makes the error larger in red, and those in which it makes it smaller in blue.
pub fn in_frame(frame: &FrameBuf, cells: &[f64]) -> RgbImage {
    let width = frame.as_ref().width() as u32;
    let mut picture = scaled(frame, width * PICTURE.div_ceil(width).max(1));
    let most = cells.iter().map(|cell| cell.abs()).fold(f64::MIN_POSITIVE, f64::max);
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let cell = cells[y as usize * ROWS / height * COLUMNS + x as usize * COLUMNS / width];
        let RGBColor(r, g, b) = if cell > 0.0 { MORE } else { LESS };
        // The root, so that more than the strongest cell can be seen.
        let share = 0.8 * (cell.abs() / most).sqrt();
        let mixed =
            |own: u8, ink: u8| (f64::from(own) * (1.0 - share) + f64::from(ink) * share).round() as u8;
        let Rgb([own_r, own_g, own_b]) = *pixel;
        *pixel = Rgb([mixed(own_r, r), mixed(own_g, g), mixed(own_b, b)]);
    }
    picture
}
