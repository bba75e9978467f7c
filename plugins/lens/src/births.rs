//! Births: which particles came to the lens in which second.
//!
//! The lens is divided into columns of [`COLUMN`] heights. Each column and second is a cell with its own stream of
//! random numbers, and so always has the same particles, whatever the size of the frame and whichever frames were
//! computed before. Which of them exist at an intensity is decided by their ranks, later.

use std::collections::VecDeque;
use std::ops::RangeInclusive;

use pdk_sdk::prelude::*;

use crate::lens::Lens;

/// Width of a column in heights of the frame.
pub const COLUMN: f32 = 0.5;

/// One column of the lens in one second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell {
    column: i32,
    second: i64,
}

impl Cell {
    /// A time within the second.
    pub fn time(&self, random: &mut Random) -> f64 {
        self.second as f64 + random.unit()
    }

    /// A place within the column, in heights from the middle of the frame.
    pub fn x(&self, random: &mut Random) -> f32 {
        (self.column as f32 + random.unit() as f32) * COLUMN
    }
}

/// Where a particle is in a window: which second, and which of that second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place(usize, usize);

/// The particles of one kind that were born within a window of time. A cache: it holds nothing that does not follow from
/// the key, the columns and the seconds it was last asked for.
pub struct Births<T> {
    kind: u64,
    key: Key,
    columns: RangeInclusive<i32>,
    first: i64,
    seconds: VecDeque<Vec<T>>,
}

impl<T> Births<T> {
    /// For particles of one `kind`; kinds have different random numbers.
    pub fn new(kind: u16) -> Self {
        let kind = u64::from(kind) << 48;
        Self { kind, key: Key::default(), columns: 0..=0, first: 0, seconds: VecDeque::new() }
    }

    /// Makes the window end with the second that holds `time` and start `window` seconds earlier, for all columns that
    /// the frame shows and those within `margin` heights beside it. `bear` adds the particles of a cell.
    pub fn advance(
        &mut self,
        sequence: &Key,
        lens: &Lens,
        margin: f32,
        (time, window): (f64, i64),
        mut bear: impl FnMut(Cell, &mut Random, &mut Vec<T>),
    ) {
        let outermost = ((lens.half_width() + margin) / COLUMN).ceil() as i32;
        let columns = -outermost..=outermost - 1;
        let last = time.floor() as i64;
        let first = last - window;
        if self.key != *sequence || self.columns != columns {
            (self.key, self.columns) = (*sequence, columns);
            self.seconds.iter_mut().for_each(Vec::clear);
            self.first = i64::MIN;
        }
        let held = self.first..self.first.saturating_add(self.seconds.len() as i64);
        // Seconds are kept where they can be: the oldest are turned into the newest.
        let length = (window + 1) as usize;
        let ahead = first.wrapping_sub(self.first);
        let all_new = self.seconds.len() != length || !held.contains(&first);
        if all_new {
            self.seconds.resize_with(length, Vec::new);
        }
        let renewed = if all_new { length } else { ahead as usize };
        self.first = first;
        for i in 0..renewed {
            let mut second = self.seconds.pop_front().unwrap_or_default();
            second.clear();
            let number = last - (renewed - 1 - i) as i64;
            for column in self.columns.clone() {
                let stream = self.kind | u64::from(column as u16) << 32 | u64::from(number as u32);
                bear(Cell { column, second: number }, &mut self.key.frame(stream), &mut second);
            }
            self.seconds.push_back(second);
        }
    }

    /// All particles of the window with their places in it, the oldest second first.
    pub fn iter(&self) -> impl Iterator<Item = (Place, &T)> {
        let seconds = self.seconds.iter().enumerate();
        seconds.flat_map(|(second, all)| all.iter().enumerate().map(move |(i, one)| (Place(second, i), one)))
    }

    /// The number of particles of the window.
    pub fn len(&self) -> usize {
        self.seconds.iter().map(Vec::len).sum()
    }

    /// The particle at a place that [`Births::iter`] gave, since the window last moved.
    pub fn at(&self, Place(second, i): Place) -> &T {
        &self.seconds[second][i]
    }
}

/// The key of everything that is born, from what is drawn once per sequence.
pub fn sequence_key(cx: &Context<'_>) -> Key {
    let mut bytes = [0; 32];
    cx.sequence_random().fill(&mut bytes);
    Key(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: Lens = Lens { width: 320, height: 240, unit: 240.0 };

    fn at(births: &mut Births<(f64, u64)>, key: u8, time: f64, lens: &Lens) -> Vec<(f64, u64)> {
        births.advance(&Key([key; 32]), lens, 0.0, (time, 5), |cell, random, into| {
            into.push((cell.time(random), random.next_u64()));
        });
        births.iter().map(|(place, birth)| (*birth, births.at(place)).0).collect()
    }

    #[test]
    fn a_window_is_the_same_however_it_was_reached() {
        let mut veteran = Births::new(1);
        let wide = Lens { width: 640, ..LENS };
        for (key, time, lens) in [
            (1, 0.0, LENS),
            (1, 0.9, LENS),
            (1, 1.0, LENS),
            (1, 4.5, LENS),
            (1, 4.5, wide),
            (1, 900.0, wide),
            (1, 905.9, wide),
            (1, 3.0, LENS),
            (1, -8.5, LENS),
            (2, -8.5, LENS),
            (2, 1e9, LENS),
        ] {
            let found = at(&mut veteran, key, time, &lens);
            assert_eq!(found, at(&mut Births::new(1), key, time, &lens), "{time}");
            let columns = if lens == wide { 6 } else { 4 };
            assert_eq!(found.len(), 6 * columns);
            assert!(found.iter().all(|(born, _)| *born >= time.floor() - 5.0 && *born < time.floor() + 1.0));
        }
    }

    #[test]
    fn cells_kinds_and_keys_have_their_own_numbers() {
        let mut all = at(&mut Births::new(1), 1, 9.0, &LENS);
        all.extend(at(&mut Births::new(2), 1, 9.0, &LENS));
        all.extend(at(&mut Births::new(1), 2, 9.0, &LENS));
        let mut numbers: Vec<u64> = all.iter().map(|(_, number)| *number).collect();
        numbers.sort_unstable();
        numbers.dedup();
        assert_eq!(numbers.len(), 3 * 4 * 6);
    }

    #[test]
    fn a_wider_frame_shows_the_same_births_in_the_middle() {
        let narrow = at(&mut Births::new(1), 1, 9.0, &LENS);
        let wide = at(&mut Births::new(1), 1, 9.0, &Lens { width: 640, ..LENS });
        assert!(narrow.iter().all(|birth| wide.contains(birth)));
    }
}
