//! Weighted sums of values at several places. Each is added up in a fixed order, one product after the other.

use crate::simd::vectorised;

/// Values whose sums stay in registers while all terms are added: four registers of AVX-512.
pub(super) const BLOCK: usize = 64;
/// The same for the end of a row.
const SMALL_BLOCK: usize = 8;

vectorised! {
    // Adds to sum `i` the value `i` behind the start in the middle times the first weight, then of each pair of starts at the same
    // distance from it the sum of both values times the weight of that distance.
    pub(super) fn add_around / add_around_avx2 / add_around_avx512 (
        values: &[f32], starts: &[usize], weights: &[f32], sums: &mut [f32],
    ) {
        let done = add_blocks_around::<BLOCK>(values, starts, weights, 0, sums);
        let done = add_blocks_around::<SMALL_BLOCK>(values, starts, weights, done, sums);
        add_blocks_around::<1>(values, starts, weights, done, sums);
    }
}

/// Does so for whole blocks from sum `first` on, and returns where it ends.
#[inline(always)]
fn add_blocks_around<const BLOCK: usize>(
    values: &[f32],
    starts: &[usize],
    weights: &[f32],
    first: usize,
    sums: &mut [f32],
) -> usize {
    let reach = weights.len() - 1;
    let (nearer, further) = (starts[..reach].iter().rev(), &starts[reach + 1..]);
    let mut place = first;
    for block in sums[first..].as_chunks_mut::<BLOCK>().0 {
        let mut sums = *block;
        for (sum, value) in sums.iter_mut().zip(&values[starts[reach] + place..][..BLOCK]) {
            *sum += value * weights[0];
        }
        for ((before, behind), weight) in nearer.clone().zip(further).zip(&weights[1..]) {
            let (before, behind) = (&values[before + place..][..BLOCK], &values[behind + place..][..BLOCK]);
            for ((sum, before), behind) in sums.iter_mut().zip(before).zip(behind) {
                *sum += (before + behind) * weight;
            }
        }
        *block = sums;
        place += BLOCK;
    }
    place
}

vectorised! {
    // Sum `i` becomes that of the values `i` behind each start, times its weight.
    pub(super) fn weighted_sums / weighted_sums_avx2 / weighted_sums_avx512 (
        values: &[f32], terms: &[(usize, f32)], sums: &mut [f32],
    ) {
        let done = blocks_of_weighted_sums::<BLOCK>(values, terms, 0, sums);
        let done = blocks_of_weighted_sums::<SMALL_BLOCK>(values, terms, done, sums);
        blocks_of_weighted_sums::<1>(values, terms, done, sums);
    }
}

/// Does so for whole blocks from sum `first` on, and returns where it ends.
#[inline(always)]
fn blocks_of_weighted_sums<const BLOCK: usize>(
    values: &[f32],
    terms: &[(usize, f32)],
    first: usize,
    sums: &mut [f32],
) -> usize {
    let mut place = first;
    for block in sums[first..].as_chunks_mut::<BLOCK>().0 {
        let mut sums = [0.0; BLOCK];
        for (start, weight) in terms {
            for (sum, value) in sums.iter_mut().zip(&values[start + place..][..BLOCK]) {
                *sum += value * weight;
            }
        }
        *block = sums;
        place += BLOCK;
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::with_each;
    use pdk_seed::Key;

    /// The sums in the order of the definition, one value after the other, without vectors.
    fn plain_around(values: &[f32], starts: &[usize], weights: &[f32], sums: &mut [f32]) {
        let reach = weights.len() - 1;
        for (place, sum) in sums.iter_mut().enumerate() {
            *sum += values[starts[reach] + place] * weights[0];
            for distance in 1..=reach {
                let pair =
                    values[starts[reach - distance] + place] + values[starts[reach + distance] + place];
                *sum += pair * weights[distance];
            }
        }
    }

    #[test]
    fn sums_are_those_of_the_plain_version_bit_for_bit() {
        let mut random = Key([3; 32]).sequence();
        let values: Vec<f32> = (0..600).map(|_| random.unit() as f32 * 255.0).collect();
        let starts = [0, 290, 7, 300, 3];
        let weights = [0.3, 0.21, 0.07];
        for length in [1, 7, 8, 63, 64, 65, 137, 300] {
            let before: Vec<f32> = (0..length).map(|place| place as f32 * 0.37).collect();
            let terms: Vec<(usize, f32)> = starts.into_iter().zip([0.1, 0.7, -0.3, 1.9, 0.01]).collect();
            let mut around = before.clone();
            plain_around(&values, &starts, &weights, &mut around);
            let term =
                |place: usize| terms.iter().fold(0.0, |sum, (start, w)| sum + values[start + place] * w);
            let weighted: Vec<f32> = (0..length).map(term).collect();
            with_each(|instructions| {
                let mut sums = before.clone();
                add_around(&values, &starts, &weights, &mut sums);
                assert_eq!(sums, around, "{length} with {instructions:?}");
                weighted_sums(&values, &terms, &mut sums);
                assert_eq!(sums, weighted, "{length} with {instructions:?}");
            });
        }
    }
}
