//! A map over the cells of a layer: its sign, its range, and its place on the frame.

use pdk_onnx::field::Look;
use pdk_sdk::prelude::*;

/// A number for each cell of a layer, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    pub rows: usize,
    pub columns: usize,
    pub values: Vec<f64>,
    /// Where the cells look, downwards and to the right.
    pub looks: [Look; 2],
}

/// How numbers of both signs become values from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// By size: both what raises the output and what lowers it matters.
    Absolute,
    /// What raises the output matters, what lowers it does not.
    Positive,
    /// 0.5 does not matter, above it raises the output, below it lowers it.
    Signed,
    /// From the least number to the greatest.
    Range,
}

impl Sign {
    /// The names that the parameter `sign` takes.
    pub const NAMES: [&str; 3] = ["absolute", "positive", "signed"];

    /// The sign of this name.
    pub fn of(name: &str) -> Self {
        match name {
            "positive" => Self::Positive,
            "signed" => Self::Signed,
            _ => Self::Absolute,
        }
    }
}

/// The parameter that chooses among [`Sign::NAMES`].
pub fn sign_parameter() -> Parameter {
    Parameter::choice(
        "sign",
        &Sign::NAMES,
        "what matters: all that changes the output; what raises it alone; or both, with 0.5 for what does not matter, 1 for what \
         raises it and 0 for what lowers it",
    )
}

impl Grid {
    /// Brings the numbers to 0 to 1. A map that is zero everywhere stays so.
    ///
    /// # Errors
    /// If a number is not finite.
    pub fn normalize(mut self, sign: Sign) -> Result<Self> {
        if self.values.iter().any(|value| !value.is_finite()) {
            return Err(Error::of(ErrorKind::Nonsense, "the map holds numbers that are not finite"));
        }
        let largest = self.values.iter().fold(0.0f64, |largest, value| match sign {
            Sign::Positive => largest.max(*value),
            _ => largest.max(value.abs()),
        });
        let least = self.values.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = self.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let share = |value: f64, of: f64| if of > 0.0 { value / of } else { 0.0 };
        for value in &mut self.values {
            *value = match sign {
                Sign::Absolute => share(value.abs(), largest),
                Sign::Positive => share(value.max(0.0), largest),
                Sign::Signed => 0.5 + share(*value, largest) / 2.0,
                Sign::Range => share(*value - least, greatest - least),
            };
        }
        Ok(self)
    }

    /// Lays the cells over a frame: each where it looks, in between by linear interpolation, and beyond the outermost as
    /// those. `model` is width and height of the model's image, to which frames are brought.
    pub fn lay_over(&self, model: (usize, usize), mut out: HeatmapMut<'_>) {
        let (width, height) = (out.width(), out.height());
        let down = steps(&self.looks[0], self.rows, model.1, height);
        let right = steps(&self.looks[1], self.columns, model.0, width);
        for (y, &(top, share_down)) in down.iter().enumerate() {
            let bottom = (top + 1).min(self.rows - 1);
            let [upper, lower] = [top, bottom].map(|row| &self.values[row * self.columns..][..self.columns]);
            for (value, &(left, share)) in out.row_mut(y).iter_mut().zip(&right) {
                let next = (left + 1).min(self.columns - 1);
                let above = upper[left] + (upper[next] - upper[left]) * share;
                let below = lower[left] + (lower[next] - lower[left]) * share;
                *value = ((above + (below - above) * share_down) as f32).clamp(0.0, 1.0);
            }
        }
    }

    /// Writes the value of each cell.
    pub fn copy_to(&self, mut out: HeatmapMut<'_>) {
        let flips = self.looks.map(|look| look.step < 0.0);
        for row in 0..self.rows {
            let from = if flips[0] { self.rows - 1 - row } else { row };
            for (column, value) in out.row_mut(row).iter_mut().enumerate() {
                let from = from * self.columns + if flips[1] { self.columns - 1 - column } else { column };
                *value = self.values[from] as f32;
            }
        }
    }
}

/// For each pixel of a frame the cell before it, and the share of the next one.
fn steps(look: &Look, cells: usize, model: usize, frame: usize) -> Vec<(usize, f64)> {
    let last = cells as f64 - 1.0;
    let step = |pixel: usize| {
        // The middle of the pixel, in pixels of the model's image.
        let at = (pixel as f64 + 0.5) * model as f64 / frame as f64 - 0.5;
        let cell = ((at - look.start) / look.step).clamp(0.0, last);
        (cell as usize, cell - cell.floor())
    };
    (0..frame).map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_onnx::field::ImageAxis;

    fn grid(values: &[f64], columns: usize, start: f64, step: f64) -> Grid {
        let look = |along| Look { along, start, step, size: 1.0 };
        let looks = [look(ImageAxis::Height), look(ImageAxis::Width)];
        Grid { rows: values.len() / columns, columns, values: values.to_vec(), looks }
    }

    #[test]
    fn each_sign_has_its_range() {
        let of = |sign| grid(&[-4.0, 0.0, 2.0], 3, 0.0, 1.0).normalize(sign).unwrap().values;
        assert_eq!(of(Sign::Absolute), [1.0, 0.0, 0.5]);
        assert_eq!(of(Sign::Positive), [0.0, 0.0, 1.0]);
        assert_eq!(of(Sign::Signed), [0.0, 0.5, 0.75]);
        assert_eq!(of(Sign::Range), [0.0, 4.0 / 6.0, 1.0]);
        for (sign, value) in
            [(Sign::Absolute, 0.0), (Sign::Positive, 0.0), (Sign::Signed, 0.5), (Sign::Range, 0.0)]
        {
            assert_eq!(grid(&[0.0, 0.0], 2, 0.0, 1.0).normalize(sign).unwrap().values, [value; 2]);
        }
        assert!(grid(&[f64::NAN], 1, 0.0, 1.0).normalize(Sign::Absolute).is_err());
    }

    #[test]
    fn cells_lie_where_they_look_and_not_where_stretching_puts_them() {
        // Two cells in a row of 16 pixels, looking at the pixels 6 and 10.
        let grid = grid(&[0.0, 1.0], 2, 6.0, 4.0);
        let mut values = [f32::NAN; 16];
        grid.lay_over((16, 1), HeatmapMut::new(&mut values, 16, 1).unwrap());
        assert!(
            values[..=6].iter().all(|&value| value == 0.0) && values[10..].iter().all(|&value| value == 1.0),
            "{values:?}"
        );
        assert_eq!(values[7..10], [0.25, 0.5, 0.75]);
        // On a frame of twice the size the same place is twice as far, from middle to middle.
        let mut large = [f32::NAN; 32];
        grid.lay_over((16, 1), HeatmapMut::new(&mut large, 32, 1).unwrap());
        assert!(large[12] == 0.0 && large[13] > 0.0 && large[20] < 1.0 && large[21] == 1.0, "{large:?}");
    }

    #[test]
    fn cells_that_run_backwards_are_turned() {
        let grid = grid(&[1.0, 2.0, 3.0, 4.0], 2, 1.0, -1.0);
        let mut values = [0.0; 4];
        grid.copy_to(HeatmapMut::new(&mut values, 2, 2).unwrap());
        assert_eq!(values, [4.0, 3.0, 2.0, 1.0]);
    }
}
