//! Photon noise: each value becomes a random count.
//!
//! For each of the 256 values there is a table from which an output is drawn in constant time with one random number
//! (Walker, "An efficient method for generating discrete random variables with general distributions", 1977; built as
//! in Vose, "A linear algorithm for generating random numbers with a given distribution", 1991).

use crate::frame::{Frame, FrameMut};
use pdk_seed::Random;

/// The largest expected count of a white pixel: beyond it the probability of no count underflows.
pub const MAX_COUNT: f64 = 700.0;
/// The number of values that are done at a time.
const BLOCK: usize = 512;
/// The number of bits with which a table weighs an output against its alternative.
const THRESHOLD_BITS: u32 = 24;

/// The tables for one expected count.
#[derive(Debug, Clone)]
pub struct PoissonTable {
    count: f64,
    /// Whether the fractions of outputs are dropped.
    truncated: bool,
    /// For each value, for each of 256 outputs: the share with which it stays, in the upper 24 bits, and the output
    /// that comes instead, in the lower 8.
    entries: Box<[u32; 65536]>,
}

impl PoissonTable {
    /// Tables for white pixels that count `count` photons on average.
    ///
    /// # Panics
    /// If `count` is not positive or larger than [`MAX_COUNT`].
    pub fn new(count: f64) -> Self {
        let mut table = Self { count: 0.0, truncated: false, entries: Box::new([0; 65536]) };
        table.set_count(count);
        table
    }

    /// As [`PoissonTable::new`], for outputs whose fractions are dropped instead of rounded.
    ///
    /// # Panics
    /// As [`PoissonTable::new`].
    pub fn truncated(count: f64) -> Self {
        let mut table = Self { count: 0.0, truncated: true, entries: Box::new([0; 65536]) };
        table.set_count(count);
        table
    }

    /// Makes the tables those of another count, if it is another.
    ///
    /// # Panics
    /// As [`PoissonTable::new`].
    pub fn set_count(&mut self, count: f64) {
        assert!(count > 0.0 && count <= MAX_COUNT, "poisson noise takes a count of up to 700, not {count}");
        if count == self.count {
            return;
        }
        for (value, entries) in self.entries.chunks_exact_mut(256).enumerate() {
            alias_table(&output_probabilities(value as u8, count, self.truncated), entries);
        }
        self.count = count;
    }

    /// The output for a value, from 32 random bits.
    #[inline(always)]
    fn draw(&self, value: u8, random: u32) -> u8 {
        let output = random as u8;
        let entry = self.entries[usize::from(u16::from_be_bytes([value, output]))];
        if random >> 8 < entry >> 8 { output } else { entry as u8 }
    }
}

/// How likely each output is: the count `n` is Poisson distributed with mean `value / 255 * count`, the output is
/// `n / count * 255`, clipped, and rounded half to even or with its fraction dropped.
fn output_probabilities(value: u8, count: f64, truncated: bool) -> [f64; 256] {
    let mean = f64::from(value) / 255.0 * count;
    let mut outputs = [0.0; 256];
    let (mut probability, mut left, mut n) = (libm::exp(-mean), 1.0, 0.0);
    while n < count {
        let output = n / count * 255.0;
        outputs[if truncated { output } else { output.round_ties_even() } as usize] += probability;
        left -= probability;
        n += 1.0;
        probability *= mean / n;
    }
    outputs[255] += f64::max(left, 0.0);
    outputs
}

/// Fills the alias table of 256 probabilities that sum to 1.
fn alias_table(probabilities: &[f64; 256], entries: &mut [u32]) {
    let one = f64::from(1u32 << THRESHOLD_BITS);
    let mut shares = probabilities.map(|p| p * 256.0);
    let (mut small, mut large) = ([0u8; 256], [0u8; 256]);
    let (mut smalls, mut larges) = (0, 0);
    for (output, &share) in shares.iter().enumerate() {
        let (stack, len) = if share < 1.0 { (&mut small, &mut smalls) } else { (&mut large, &mut larges) };
        stack[*len] = output as u8;
        *len += 1;
    }
    while smalls > 0 && larges > 0 {
        let (poor, rich) = (usize::from(small[smalls - 1]), usize::from(large[larges - 1]));
        smalls -= 1;
        entries[poor] =
            (((shares[poor] * one).round() as u32).min((1 << THRESHOLD_BITS) - 1) << 8) | rich as u32;
        shares[rich] -= 1.0 - shares[poor];
        if shares[rich] < 1.0 {
            larges -= 1;
            small[smalls] = rich as u8;
            smalls += 1;
        }
    }
    // What is left has a share of one, up to rounding: it stays whatever the random number says.
    for &output in small[..smalls].iter().chain(&large[..larges]) {
        entries[usize::from(output)] = u32::from(output);
    }
}

/// Replaces each value by a random count: Poisson distributed with mean `value / 255 * count`, scaled back by
/// `255 / count`, clipped and rounded half to even.
///
/// # Panics
/// If the sizes differ.
pub fn poisson_noise(src: Frame<'_>, mut dst: FrameMut<'_>, table: &PoissonTable, random: &mut Random) {
    assert!(src.same_size(&dst.as_ref()), "poisson_noise between frames of different size");
    let mut bytes = [0u8; 4 * BLOCK];
    for y in 0..src.height() {
        for (from, to) in src.row(y).chunks(BLOCK).zip(dst.row_mut(y).chunks_mut(BLOCK)) {
            let bytes = &mut bytes[..4 * from.len()];
            random.fill(bytes);
            for ((to, &from), word) in to.iter_mut().zip(from).zip(bytes.chunks_exact(4)) {
                *to = table.draw(from, u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{run_on, samples};
    use pdk_seed::Key;

    /// The probabilities that the table draws with.
    fn drawn(table: &PoissonTable, value: u8) -> [f64; 256] {
        let mut outputs = [0.0; 256];
        let one = f64::from(1u32 << THRESHOLD_BITS);
        for bin in 0..256 {
            let entry = table.entries[usize::from(value) * 256 + bin];
            let share = f64::from(entry >> 8) / one;
            outputs[bin] += share / 256.0;
            outputs[(entry & 255) as usize] += (1.0 - share) / 256.0;
        }
        outputs
    }

    #[test]
    fn tables_draw_with_the_probabilities_of_the_distribution() {
        for count in [1.0, 30.0, 61.7, 120.0, 500.0, MAX_COUNT] {
            let table = PoissonTable::new(count);
            for value in [0u8, 1, 7, 100, 128, 254, 255] {
                let wanted = output_probabilities(value, count, false);
                assert!((wanted.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{count} {value}");
                for (output, (drawn, wanted)) in drawn(&table, value).iter().zip(wanted).enumerate() {
                    assert!((drawn - wanted).abs() < 1e-6, "{count} {value} {output}: {drawn} {wanted}");
                }
            }
        }
    }

    #[test]
    fn probabilities_are_those_of_a_poisson_distribution() {
        // Mean 30 * 51 / 255 = 6: exp(-6) * 6^n / n!, at n counts, which come out as n / 30 * 255.
        let outputs = output_probabilities(51, 30.0, false);
        for (n, expected) in [(0, 0.002_478_752), (1, 0.014_872_513), (6, 0.160_623_141), (12, 0.011_264_480)]
        {
            let output = (f64::from(n) * 8.5).round_ties_even() as usize;
            assert!((outputs[output] - expected).abs() < 1e-9, "{n}: {}", outputs[output]);
        }
        assert_eq!(output_probabilities(0, 30.0, false)[0], 1.0);
    }

    #[test]
    fn a_table_forgets_its_last_count() {
        let mut table = PoissonTable::new(30.0);
        table.set_count(87.0);
        assert_eq!(table.entries, PoissonTable::new(87.0).entries);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn strides_do_not_matter(sample in samples(), key: [u8; 32]) {
            let table = PoissonTable::new(55.0);
            let result = run_on(&sample, |src, dst| poisson_noise(src, dst, &table, &mut Key(key).frame(1)));
            let src = sample.frame().to_buf();
            // Black has no photons.
            prop_assert!(src.data().iter().zip(result.data()).all(|(a, b)| *a != 0 || *b == 0));
        }
    }
}
