//! How well a map says by how much the steering changes when some patches of the frame are taken away.
//!
//! Sensitivity-n: the correlation of the sum of the map over the patches with the change of the steering, over many sets of n patches, on
//! average over several n (Ancona et al., "Towards better understanding of gradient-based attribution methods", 2018). Infidelity: the share of
//! the squared change that the sum leaves unexplained, under the factor that leaves the least (Yeh et al., "On the (In)fidelity and Sensitivity of
//! Explanations", 2019).

use pdk_sdk::error::Result;
use pdk_sdk::prelude::{Frame, FrameBuf, Random};

/// Patches from left to right and from top to bottom.
const GRID: [usize; 2] = [12, 8];
/// How many patches are taken away at once, of 96.
const SIZES: [usize; 4] = [5, 10, 19, 38];
/// How many sets there are of each size.
const SETS: usize = 8;

/// Sets of patches, and by how much the steering changes without each.
pub struct Patches {
    sets: Vec<(Vec<bool>, f64)>,
}

/// How well a map says these changes.
#[derive(Debug, Clone, Copy, Default)]
pub struct Agreement {
    /// The mean correlation, which is 0 if the map or the change is the same for all sets.
    pub sensitivity: f64,
    /// From 0 for all explained to 1 for nothing.
    pub infidelity: f64,
}

impl Patches {
    /// How many sets there are.
    #[cfg(test)]
    pub const SETS: usize = SIZES.len() * SETS;

    /// Draws sets, and measures each with `change`: by how much the steering changes if a frame like this is seen.
    ///
    /// # Errors
    /// If the driver fails.
    pub fn measure(
        frame: Frame<'_>,
        color: [u8; 3],
        random: &mut Random,
        mut change: impl FnMut(Frame<'_>) -> Result<f64>,
    ) -> Result<Self> {
        let count = GRID[0] * GRID[1];
        let mut sets = Vec::with_capacity(SIZES.len() * SETS);
        let mut without = FrameBuf::new(frame.width(), frame.height());
        for size in SIZES {
            for _ in 0..SETS {
                let mut order: Vec<usize> = (0..count).collect();
                for at in 0..size {
                    order.swap(at, at + random.below((count - at) as u32) as usize);
                }
                let mut taken = vec![false; count];
                order[..size].iter().for_each(|&patch| taken[patch] = true);
                without.as_mut().copy_from(frame);
                for (y, row) in without.as_mut().rows_mut().enumerate() {
                    for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                        if taken[patch([x, y], [frame.width(), frame.height()])] {
                            pixel.copy_from_slice(&color);
                        }
                    }
                }
                sets.push((taken, change(without.as_ref())?));
            }
        }
        Ok(Self { sets })
    }

    /// How well the map of a frame of this width agrees.
    pub fn agreement(&self, map: &[f32], width: usize) -> Agreement {
        let size = [width, map.len() / width];
        let mut of_patch = vec![0.0; GRID[0] * GRID[1]];
        for (at, value) in map.iter().enumerate() {
            of_patch[patch([at % width, at / width], size)] += f64::from(*value);
        }
        let sum = |taken: &[bool]| -> f64 {
            taken.iter().zip(&of_patch).filter(|(taken, _)| **taken).map(|(_, value)| value).sum()
        };
        let pairs: Vec<[f64; 2]> = self.sets.iter().map(|(taken, change)| [sum(taken), *change]).collect();
        let correlations = pairs.chunks(SETS).map(correlation);
        let total = |a: usize, b: usize| -> f64 { pairs.iter().map(|pair| pair[a] * pair[b]).sum() };
        let (own, both, change) = (total(0, 0), total(0, 1), total(1, 1));
        Agreement {
            sensitivity: correlations.sum::<f64>() / SIZES.len() as f64,
            infidelity: if own > 0.0 && change > 0.0 { 1.0 - both * both / (own * change) } else { 1.0 },
        }
    }
}

/// The patch in which a pixel lies.
fn patch([x, y]: [usize; 2], [width, height]: [usize; 2]) -> usize {
    y * GRID[1] / height * GRID[0] + x * GRID[0] / width
}

/// Pearson's correlation; 0 if one side is the same everywhere.
fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let mean = |side: usize| pairs.iter().map(|pair| pair[side]).sum::<f64>() / pairs.len() as f64;
    let means = [mean(0), mean(1)];
    let total = |a: usize, b: usize| -> f64 {
        pairs.iter().map(|pair| (pair[a] - means[a]) * (pair[b] - means[b])).sum()
    };
    let size = (total(0, 0) * total(1, 1)).sqrt();
    if size > 0.0 { total(0, 1) / size } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::seed;

    /// A frame of ones, whose patches matter as `weight` says.
    fn measured(weight: impl Fn(usize) -> f64) -> Patches {
        let frame = FrameBuf::from_vec(vec![1; 48 * 32 * 3], 48, 32).unwrap();
        let change = |without: Frame<'_>| {
            let mut change = 0.0;
            for y in 0..32 {
                for x in 0..48 {
                    change += weight(patch([x, y], [48, 32])) * f64::from(1 - without.pixel(x, y)[0]);
                }
            }
            Ok(change)
        };
        let mut random = seed::key(5, "patches", 0).sequence();
        Patches::measure(frame.as_ref(), [0; 3], &mut random, change).unwrap()
    }

    #[test]
    fn a_map_of_what_matters_explains_all_and_a_map_of_the_rest_explains_little() {
        let matters = |patch: usize| if patch % 12 < 4 { 1.0 } else { 0.0 };
        let patches = measured(matters);
        assert_eq!(patches.sets.len(), 32);
        for (set, (taken, _)) in patches.sets.iter().enumerate() {
            assert_eq!(taken.iter().filter(|taken| **taken).count(), SIZES[set / SETS]);
        }
        let map = |value: &dyn Fn(usize) -> f64| -> Vec<f32> {
            (0..48 * 32).map(|at| value(patch([at % 48, at / 48], [48, 32])) as f32).collect()
        };
        let right = patches.agreement(&map(&matters), 48);
        assert!(right.sensitivity > 0.999_999 && right.infidelity < 1e-12, "{right:?}");
        let wrong = patches.agreement(&map(&|patch| 1.0 - matters(patch)), 48);
        assert!(wrong.sensitivity < -0.999_999 && wrong.infidelity > 0.05, "{wrong:?}");
        let nothing = patches.agreement(&map(&|_| 0.0), 48);
        assert_eq!((nothing.sensitivity, nothing.infidelity), (0.0, 1.0));
        // A map that is the same everywhere knows how many patches there are, and no more.
        let flat = patches.agreement(&map(&|_| 1.0), 48);
        assert!(
            flat.sensitivity == 0.0 && flat.infidelity > 0.01 && flat.infidelity < wrong.infidelity,
            "{flat:?}"
        );
    }

    #[test]
    fn a_change_that_never_comes_is_not_explained() {
        let agreement = measured(|_| 0.0).agreement(&[0.5; 48 * 32], 48);
        assert_eq!((agreement.sensitivity, agreement.infidelity), (0.0, 1.0));
    }
}
