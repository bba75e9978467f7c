//! What all methods share: a model is viewed, a grid is made, and laid over the frame.

use pdk_network::region::Part;
use pdk_onnx::layers::Layer;
use pdk_sdk::prelude::*;

use super::grid::{Grid, Sign};
use super::kept::Kept;
use super::viewer::Viewer;
use crate::driver::built_in;
use crate::model_file;

/// How a frame becomes a grid.
pub trait Method: Send + Sized {
    /// Whether the network, the parameters and the frame are all that its maps of recorded frames depend on, so that they can be kept.
    const KEPT: bool = true;

    /// Name, documentation and parameters, those that all methods have among them.
    fn description() -> Description;

    /// Files that it reads besides the model.
    ///
    /// # Errors
    /// If they cannot be listed.
    fn input_files(_config: &Config) -> Result<Vec<InputFiles>> {
        Ok(Vec::new())
    }

    /// Prepares the method for a model.
    ///
    /// # Errors
    /// If the model does not have what the method needs.
    fn new(viewer: &mut Viewer, config: &Config) -> Result<Self>;

    /// How its numbers become values from 0 to 1.
    fn sign(config: &Config) -> Sign {
        Sign::of(config.text("sign"))
    }

    /// Rows and columns of its grid.
    fn cells(&self, viewer: &Viewer) -> [usize; 2];

    /// The grid of a frame that has the size of the model's image.
    ///
    /// # Errors
    /// If the engine fails.
    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, cx: &MapContext<'_>) -> Result<Grid>;
}

/// A saliency method as a component.
pub struct Map<M> {
    viewer: Viewer,
    method: M,
    sign: Sign,
    by_cell: bool,
    kept: Option<Kept>,
}

impl<M: Method> Component for Map<M> {
    fn description() -> Description {
        M::description()
    }

    fn new(config: &Config) -> Result<Self> {
        let open = || {
            let mut viewer = Viewer::open(config)?;
            let method = M::new(&mut viewer, config)?;
            let kept = if M::KEPT { Kept::new(&M::description(), config, &viewer) } else { None };
            Ok(Self { method, viewer, sign: M::sign(config), by_cell: config.text("size") == "layer", kept })
        };
        open().map_err(|error: Error| error.at(format!("model `{}`", config.text("model"))))
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let model = config.text("model");
        let mut files = M::input_files(config)?;
        if built_in::content(model).is_none() {
            files.extend(model_file::files_beside(model));
        }
        Ok(files)
    }
}

impl<M: Method> Saliency for Map<M> {
    fn map_size(&mut self, width: usize, height: usize) -> Result<[usize; 2]> {
        // The cells of a model that sees a part of the frame have no size that divides it.
        if !self.by_cell || self.viewer.part(width, height)?.is_some() {
            return Ok([width, height]);
        }
        let [rows, columns] = self.method.cells(&self.viewer);
        // A frame that is smaller than the model's image may have fewer pixels than a layer has cells.
        Ok(if columns > width || rows > height { [width, height] } else { [columns, rows] })
    }

    fn map(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, out: HeatmapMut<'_>) -> Result<()> {
        let Self { viewer, method, kept, .. } = self;
        let fitted = viewer.fit(frame).map_err(|error| error.at(&viewer.place))?;
        let part = viewer.part(frame.width(), frame.height())?;
        let frame = fitted;
        viewer.move_at(cx.speed);
        let speed = viewer.speed();
        let mut make = || method.grid(viewer, frame.as_ref(), cx);
        let grid = match kept.as_ref().filter(|_| cx.recorded) {
            Some(kept) => kept.find_or_make(frame.as_ref(), speed, cx, make),
            None => make(),
        };
        let grid =
            grid.and_then(|grid| grid.normalize(self.sign)).map_err(|error| error.at(&self.viewer.place))?;
        match self.by_cell && (out.width(), out.height()) == (grid.columns, grid.rows) {
            true => grid.copy_to(out),
            false => {
                let nothing = if self.sign == Sign::Signed { 0.5 } else { 0.0 };
                lay_over(&grid, self.viewer.size(), part, nothing, out)?;
            }
        }
        Ok(())
    }
}

/// Lays a grid over the part of the frame that the model sees. What it does not see does not matter.
fn lay_over(
    grid: &Grid,
    model: (usize, usize),
    part: Option<Part>,
    nothing: f32,
    mut out: HeatmapMut<'_>,
) -> Result<()> {
    let Some(part) = part else {
        grid.lay_over(model, out);
        return Ok(());
    };
    let mut values = vec![0.0; part.width * part.height];
    grid.lay_over(model, HeatmapMut::new(&mut values, part.width, part.height)?);
    for y in 0..out.height() {
        let row = out.row_mut(y);
        row.fill(nothing);
        if let Some(from) = y.checked_sub(part.top).and_then(|y| values.chunks_exact(part.width).nth(y)) {
            row[part.left..][..part.width].copy_from_slice(from);
        }
    }
    Ok(())
}

/// A grid of zeros over a layer.
pub fn empty(layer: &Layer) -> Grid {
    let (rows, columns) = (layer.shape[layer.rows.0], layer.shape[layer.columns.0]);
    Grid { rows, columns, values: vec![0.0; rows * columns], looks: [layer.rows.1, layer.columns.1] }
}

/// A grid of zeros with a cell for each pixel of the model's image.
pub fn pixels(viewer: &Viewer) -> Grid {
    use pdk_onnx::field::{ImageAxis, Look};
    let (columns, rows) = viewer.size();
    let look = |along| Look { along, start: 0.0, step: 1.0, size: 1.0 };
    Grid {
        rows,
        columns,
        values: vec![0.0; rows * columns],
        looks: [ImageAxis::Height, ImageAxis::Width].map(look),
    }
}

/// What is put where something is taken away.
pub fn fill_parameter() -> Parameter {
    Parameter::choice(
        "fill",
        &["mean", "black"],
        "what is put in place of what is taken away: the frame's mean colour, or black",
    )
}

/// The colour that is put where something is taken away.
pub fn fill(frame: Frame<'_>, name: &str) -> [f64; 3] {
    let mut sums = [0u64; 3];
    if name == "black" {
        return [0.0; 3];
    }
    for pixel in frame.rows().flat_map(|row| row.chunks_exact(3)) {
        sums.iter_mut().zip(pixel).for_each(|(sum, &value)| *sum += u64::from(value));
    }
    sums.map(|sum| sum as f64 / (frame.width() * frame.height()) as f64)
}

/// The frame where `shares` is 1, the colour where it is 0.
pub fn blend(frame: Frame<'_>, color: [f64; 3], shares: &[f32], mut into: FrameMut<'_>) {
    let width = frame.width();
    for y in 0..frame.height() {
        let pixels = frame.row(y).chunks_exact(3).zip(into.row_mut(y).chunks_exact_mut(3));
        for ((from, to), &share) in pixels.zip(&shares[y * width..]) {
            for channel in 0..3 {
                let value = color[channel] + (f64::from(from[channel]) - color[channel]) * f64::from(share);
                to[channel] = (value + 0.5) as u8;
            }
        }
    }
}
