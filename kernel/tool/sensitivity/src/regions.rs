//! Where in the frames the influence of a level comes from, by the exact gradient of the driver's network: how the steering changes with each byte
//! of what it saw, times how that byte changes with the level, added up over cells of the frame.

use pdk_sdk::error::{ErrorKind, Result};
use pdk_sdk::prelude::FrameBuf;

use crate::rehearsal::{Decision, Place, Rehearsal};

/// Cells from left to right and from top to bottom.
pub const COLUMNS: usize = 32;
/// See [`COLUMNS`].
pub const ROWS: usize = 16;

/// How the largest error changes with the level in each cell of each frame, in metres for one level.
#[derive(Debug, Clone, PartialEq)]
pub struct Regions(Vec<f64>);

impl Regions {
    /// The sum over frames, row by row.
    pub fn over(&self, frames: std::ops::Range<usize>) -> Vec<f64> {
        let mut cells = vec![0.0; COLUMNS * ROWS];
        for frame in self.0.chunks_exact(COLUMNS * ROWS).take(frames.end).skip(frames.start) {
            cells.iter_mut().zip(frame).for_each(|(cell, value)| *cell += value);
        }
        cells
    }
}

/// The regions as they are gathered on the way back.
pub struct Gathered {
    gradient: Vec<f32>,
    low: FrameBuf,
    regions: Result<Vec<Regions>, String>,
}

impl Gathered {
    /// For this many perturbations and frames.
    pub fn new(rehearsal: &Rehearsal<'_>, perturbations: usize, frames: usize) -> Self {
        let frame = rehearsal.raw().clone();
        let regions = Regions(vec![0.0; frames * COLUMNS * ROWS]);
        Self {
            gradient: vec![0.0; frame.as_ref().data().len()],
            low: frame,
            regions: Ok(vec![regions; perturbations]),
        }
    }

    /// Takes the gradient at what the driver saw last. If it has none, there are no regions.
    ///
    /// # Errors
    /// If the driver panicked.
    pub fn differentiate(
        &mut self,
        rehearsal: &mut Rehearsal<'_>,
        place: &Place,
        decision: &Decision,
    ) -> Result<()> {
        if self.regions.is_err() {
            return Ok(());
        }
        match rehearsal.gradient(place, decision, &mut self.gradient) {
            Ok(_) => Ok(()),
            Err(error) if error.kind() == ErrorKind::Panic => Err(error),
            Err(error) => {
                self.regions = Err(error.to_string());
                Ok(())
            }
        }
    }

    /// Keeps what the driver saw at the lower level.
    pub fn keep(&mut self, rehearsal: &Rehearsal<'_>) {
        self.low.as_mut().copy_from(rehearsal.perturbed().as_ref());
    }

    /// Adds the difference to what the driver saw at the higher level, with `weight` metres for one unit of steering and one level.
    pub fn add(&mut self, rehearsal: &Rehearsal<'_>, perturbation: usize, frame: usize, weight: f64) {
        let Self { gradient, low, regions } = self;
        let Ok(regions) = regions else { return };
        let cells = &mut regions[perturbation].0[frame * COLUMNS * ROWS..][..COLUMNS * ROWS];
        let (low, high) = (low.as_ref(), rehearsal.perturbed().as_ref());
        let (width, height) = (high.width(), high.height());
        let rows = gradient.chunks_exact(width * 3).enumerate();
        for (y, gradient) in rows {
            let row = y * ROWS / height * COLUMNS;
            let pixels = low.row(y).chunks_exact(3).zip(high.row(y).chunks_exact(3));
            for (x, ((low, high), gradient)) in pixels.zip(gradient.chunks_exact(3)).enumerate() {
                let channel = |c: usize| f64::from(gradient[c]) * (f64::from(high[c]) - f64::from(low[c]));
                cells[row + x * COLUMNS / width] += weight * (channel(0) + channel(1) + channel(2));
            }
        }
    }

    /// What was gathered.
    pub fn all(self) -> Result<Vec<Regions>, String> {
        self.regions
    }
}
