//! Sums of products: for many places of an input, the products with the weights of many outputs, each summed in one order.
//!
//! Convolutions and products of matrices are both of this form: what belongs to an output `o` at a place `p` is
//! `start[o] + weights[o][0] input[p + taps[0]] + weights[o][1] input[p + taps[1]] + ...`, added from left to right with a fused
//! multiply-add. Lanes are outputs, and a tile of places shares each weight that is loaded; no sum is split, so no tiling changes a result.

use std::array;

use super::lanes::{LANES, Lanes, Number, Pair, Work, dispatch_wide, has_wide_lanes};

/// A place of an input, and where what is computed for it goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// To which the taps are added.
    pub from: u32,
    /// Where the first output goes.
    pub to: u32,
}

/// The weights of all outputs, in the order in which they are used.
#[derive(Debug, Clone, Default)]
pub struct Packed<N = f32> {
    blocks: Vec<Block<N>>,
    taps: usize,
}

/// The weights of outputs that are computed together.
#[derive(Debug, Clone)]
struct Block<N> {
    /// The first output.
    first: usize,
    /// The number of outputs, of which the last vector may have fewer than it has lanes.
    count: usize,
    vectors: usize,
    /// By tap, then by output.
    weights: Vec<N>,
    /// What the sums begin with.
    start: Vec<N>,
}

/// How many vectors of outputs are computed together where there is one place: enough sums to keep the processor busy.
const VECTORS_OF_ONE: usize = 8;

/// Weights that are used for all tiles of a group before the next ones are: 16 KiB stay in the first cache of every processor of today.
const CHUNK: usize = 4 << 10;

/// The tiles of a group.
const TILES: usize = 16;

impl<N: Number> Packed<N> {
    /// Packs the weights of `outputs` sums over `taps` products for an input with this many places. `weight` gives the weight of an output
    /// and a tap, `start` what the sum of an output begins with.
    pub fn new(
        outputs: usize,
        taps: usize,
        places: usize,
        weight: impl Fn(usize, usize) -> N,
        start: impl Fn(usize) -> N,
    ) -> Self {
        let mut blocks = Vec::new();
        let mut first = 0;
        while first < outputs {
            let left = (outputs - first).div_ceil(LANES);
            let vectors = match left {
                _ if places == 1 && left >= VECTORS_OF_ONE => VECTORS_OF_ONE,
                // Two registers with sixteen lanes, of which there are twice as many. If half of the second one is for nothing, that is still
                // faster than three registers with eight.
                3.. if has_wide_lanes() => 4,
                // Pairs are fastest; three are better than a pair and one.
                _ if left % 2 == 1 && left > 1 => 3,
                _ => left.min(2),
            };
            let count = (vectors * LANES).min(outputs - first);
            let mut weights = vec![N::default(); taps * vectors * LANES];
            for (tap, row) in weights.chunks_exact_mut(vectors * LANES).enumerate() {
                for (output, into) in row[..count].iter_mut().enumerate() {
                    *into = weight(first + output, tap);
                }
            }
            let mut starts = vec![N::default(); vectors * LANES];
            for (output, into) in starts[..count].iter_mut().enumerate() {
                *into = start(first + output);
            }
            blocks.push(Block { first, count, vectors, weights, start: starts });
            first += count;
        }
        Self { blocks, taps }
    }

    /// Puts other weights in: those of a matrix whose rows are taps and whose columns are outputs, with how far apart both are.
    pub fn fill(&mut self, values: &[N], [row, column]: [usize; 2]) {
        for Block { first, count, vectors, weights, .. } in &mut self.blocks {
            for (tap, into) in weights.chunks_exact_mut(*vectors * LANES).enumerate() {
                let from = &values[tap * row + *first * column..];
                match column {
                    1 => into[..*count].copy_from_slice(&from[..*count]),
                    _ => {
                        let weights = from.iter().step_by(column);
                        into[..*count].iter_mut().zip(weights).for_each(|(into, weight)| *into = *weight);
                    }
                }
            }
        }
    }
}

/// Computes what belongs to each place. The outputs of a place lie `apart` from each other. If they are `cut`, those below 0 become 0.
///
/// # Panics
/// If a place with a tap lies outside the input, or an output outside the result.
pub fn sum<N: Number>(
    input: &[N],
    packed: &Packed<N>,
    taps: &[u32],
    places: &[Place],
    apart: usize,
    cut: bool,
    into: &mut [N],
) {
    dispatch_wide(Sums::new(input, packed, taps, places, apart, cut, into));
}

/// What [`sum`] has to do.
struct Sums<'a, N> {
    input: &'a [N],
    packed: &'a Packed<N>,
    taps: &'a [u32],
    places: &'a [Place],
    apart: usize,
    cut: bool,
    into: &'a mut [N],
}

impl<'a, N: Number> Sums<'a, N> {
    fn new(
        input: &'a [N],
        packed: &'a Packed<N>,
        taps: &'a [u32],
        places: &'a [Place],
        apart: usize,
        cut: bool,
        into: &'a mut [N],
    ) -> Self {
        let last = places.iter().map(|place| place.from as usize).max().zip(taps.iter().max());
        let inside = |(place, tap): (usize, &u32)| place + (*tap as usize) < input.len();
        assert!(last.is_none_or(inside), "a tap lies outside the input");
        assert_eq!(taps.len(), packed.taps, "there is a weight for each tap");
        Self { input, packed, taps, places, apart, cut, into }
    }

    #[inline(always)]
    fn block<L: Lanes<N>, const VECTORS: usize, const PLACES: usize>(&mut self, block: &Block<N>) {
        let row = VECTORS * LANES;
        assert!(block.weights.len() == self.taps.len() * row && block.start.len() == row);
        // Sums that are not finished wait here; what is written and read again loses nothing.
        let mut waiting = [[[[N::default(); LANES]; VECTORS]; PLACES]; TILES];
        let chunk = CHUNK / row;
        for group in self.places.chunks(PLACES * TILES) {
            for first in (0..self.taps.len().max(1)).step_by(chunk) {
                let last = (first + chunk).min(self.taps.len());
                let (taps, weights) = (&self.taps[first..last], &block.weights[first * row..last * row]);
                for (places, sums) in group.chunks(PLACES).zip(&mut waiting) {
                    // A short tile computes its last place several times.
                    let from = array::from_fn(|place| places[place.min(places.len() - 1)].from as usize);
                    if first == 0 {
                        for vectors in sums.iter_mut() {
                            vectors.as_flattened_mut().copy_from_slice(&block.start);
                        }
                    }
                    // SAFETY: `new` has seen that each place with each tap lies inside the input, and the weights are as many as the
                    // assertion says.
                    unsafe {
                        let flat = sums.as_flattened_mut().as_flattened_mut();
                        match VECTORS {
                            2 => tile_of_pairs::<N, L, 1, PLACES>(self.input, from, taps, weights, flat),
                            4 => tile_of_pairs::<N, L, 2, PLACES>(self.input, from, taps, weights, flat),
                            _ => tile::<N, L, VECTORS, PLACES>(self.input, from, taps, weights, sums),
                        }
                    };
                }
            }
            if self.cut {
                let sums = waiting.as_flattened_mut()[..group.len()].as_flattened_mut().as_flattened_mut();
                sums.iter_mut().for_each(|sum| *sum = sum.cut());
            }
            self.write(block, group, waiting.as_flattened());
        }
    }

    /// Puts the sums of places where they belong.
    #[inline(always)]
    fn write<const VECTORS: usize>(
        &mut self,
        block: &Block<N>,
        places: &[Place],
        sums: &[[[N; LANES]; VECTORS]],
    ) {
        let sums = &sums[..places.len()];
        if self.apart != 1 && places.windows(2).all(|two| two[1].to == two[0].to + 1) {
            // Row by row, which is several times faster than place by place.
            let first = places[0].to as usize + block.first * self.apart;
            for vector in 0..VECTORS {
                let outputs = block.count.saturating_sub(vector * LANES).min(LANES);
                for lane in 0..outputs {
                    let from = first + (vector * LANES + lane) * self.apart;
                    let row = &mut self.into[from..][..places.len()];
                    row.iter_mut().zip(sums).for_each(|(into, sums)| *into = sums[vector][lane]);
                }
            }
            return;
        }
        for (place, sums) in places.iter().zip(sums) {
            let to = place.to as usize + block.first * self.apart;
            let sums = &sums.as_flattened()[..block.count];
            if self.apart == 1 {
                self.into[to..to + block.count].copy_from_slice(sums);
            } else {
                for (output, sum) in sums.iter().enumerate() {
                    self.into[to + output * self.apart] = *sum;
                }
            }
        }
    }
}

impl<N: Number> Work<N> for Sums<'_, N> {
    #[inline(always)]
    fn with<L: Lanes<N>>(mut self) {
        let packed = self.packed;
        for block in &packed.blocks {
            // As many sums as sixteen registers have room for, beside a row of weights and an element of the input, and as many places
            // as others have room for.
            match block.vectors {
                VECTORS_OF_ONE => self.block::<L, VECTORS_OF_ONE, 1>(block),
                3 => self.block::<L, 3, 3>(block),
                // Only if two of these vectors are one register.
                4 => self.block::<L, 4, 6>(block),
                // Fewer sums than that would wait for each other.
                2 if has_wide_lanes() => self.block::<L, 2, 12>(block),
                2 => self.block::<L, 2, 6>(block),
                _ => self.block::<L, 1, 8>(block),
            }
        }
    }
}

/// Adds the products of these taps to the sums of a tile.
///
/// # Safety
/// Each element of `from` with each tap has to lie inside the input. There are `VECTORS * LANES` weights for each tap.
#[inline(always)]
unsafe fn tile<N: Number, L: Lanes<N>, const VECTORS: usize, const PLACES: usize>(
    input: &[N],
    from: [usize; PLACES],
    taps: &[u32],
    weights: &[N],
    waiting: &mut [[[N; LANES]; VECTORS]; PLACES],
) {
    // SAFETY: each is an array of as many numbers as there are lanes.
    let mut sums: [[L; VECTORS]; PLACES] =
        array::from_fn(|place| array::from_fn(|vector| unsafe { L::load(waiting[place][vector].as_ptr()) }));
    // Without taps, nothing is read, and a place may lie outside.
    let places = from.map(|from| input.as_ptr().wrapping_add(from));
    let mut row = weights.as_ptr();
    for &tap in taps {
        // SAFETY: there is a row of weights for each tap.
        let weights: [L; VECTORS] = array::from_fn(|vector| unsafe { L::load(row.add(vector * LANES)) });
        // SAFETY: at most one past the last row.
        row = unsafe { row.add(VECTORS * LANES) };
        for (sums, place) in sums.iter_mut().zip(places) {
            // SAFETY: a place with a tap lies inside the input.
            let value = L::splat(unsafe { *place.add(tap as usize) });
            for (sum, weight) in sums.iter_mut().zip(weights) {
                *sum = value.multiply_add(weight, *sum);
            }
        }
    }
    for (waiting, sums) in waiting.iter_mut().zip(sums) {
        *waiting = sums.map(L::to_array);
    }
}

/// The same for pairs of vectors, each of which may be one register.
///
/// # Safety
/// As for [`tile`].
#[inline(always)]
unsafe fn tile_of_pairs<N: Number, L: Lanes<N>, const PAIRS: usize, const PLACES: usize>(
    input: &[N],
    from: [usize; PLACES],
    taps: &[u32],
    weights: &[N],
    waiting: &mut [N],
) {
    let (waiting, _) = waiting.as_chunks_mut::<{ 2 * LANES }>();
    let (waiting, _) = waiting.as_chunks_mut::<PAIRS>();
    assert_eq!(waiting.len(), PLACES);
    let mut sums: [[L::Pair; PAIRS]; PLACES] = array::from_fn(|place| {
        // SAFETY: each is an array of as many numbers as a pair has.
        array::from_fn(|pair| unsafe { L::Pair::load(waiting[place][pair].as_ptr()) })
    });
    // Without taps, nothing is read, and a place may lie outside.
    let places = from.map(|from| input.as_ptr().wrapping_add(from));
    let mut row = weights.as_ptr();
    for &tap in taps {
        // SAFETY: there is a row of weights for each tap.
        let weights: [L::Pair; PAIRS] =
            array::from_fn(|pair| unsafe { L::Pair::load(row.add(pair * 2 * LANES)) });
        // SAFETY: at most one past the last row.
        row = unsafe { row.add(PAIRS * 2 * LANES) };
        for (sums, place) in sums.iter_mut().zip(places) {
            // SAFETY: a place with a tap lies inside the input.
            let value = L::Pair::splat(unsafe { *place.add(tap as usize) });
            for (sum, weights) in sums.iter_mut().zip(weights) {
                *sum = value.multiply_add(weights, *sum);
            }
        }
    }
    for (waiting, sums) in waiting.iter_mut().zip(sums) {
        *waiting = sums.map(L::Pair::to_array);
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Portable, dispatch, multiply_add};
    use super::*;
    use crate::testing::numbers;

    /// What each kind of lanes computes is what the definition says, bit for bit.
    #[test]
    fn sums_are_added_in_one_order_whatever_the_lanes_and_tiles() {
        let draw =
            |seed, count| -> Vec<f32> { numbers(seed, count).iter().map(|&value| value as f32).collect() };
        for (outputs, taps, places) in [
            (1, 1, 1),
            (3, 5, 2),
            (8, 27, 13),
            (16, 9, 6),
            (24, 75, 9),
            (33, 11, 5),
            (36, 40, 7),
            (100, 64, 1),
            (72, 130, 20),
            (65, 3, 1),
        ] {
            let input = draw(1, 3 * (places + taps));
            let weights = draw(2, outputs * taps);
            let start = draw(3, outputs);
            let offsets: Vec<u32> = (0..taps as u32).map(|tap| tap * 2).collect();
            for (apart, cut) in [(1, false), (1, true), (places, false), (places, true)] {
                let to = |place: usize| if apart == 1 { place * outputs } else { place };
                let list: Vec<Place> =
                    (0..places).map(|place| Place { from: place as u32, to: to(place) as u32 }).collect();
                let packed = Packed::new(outputs, taps, places, |o, t| weights[o * taps + t], |o| start[o]);
                let mut expected = vec![0.0; outputs * places];
                for place in &list {
                    for output in 0..outputs {
                        let products = offsets.iter().zip(&weights[output * taps..]);
                        let sum = products.fold(start[output], |sum, (tap, weight)| {
                            multiply_add(input[(place.from + tap) as usize], *weight, sum)
                        });
                        expected[place.to as usize + output * apart] = if cut { sum.max(0.0) } else { sum };
                    }
                }
                let mut found = vec![0.0; outputs * places];
                sum(&input, &packed, &offsets, &list, apart, cut, &mut found);
                assert_eq!(found, expected, "{outputs} outputs, {taps} taps, {places} places");
                found.fill(0.0);
                dispatch(Sums::new(&input, &packed, &offsets, &list, apart, cut, &mut found));
                assert_eq!(found, expected, "{outputs} outputs, {taps} taps, {places} places, eight lanes");
                found.fill(0.0);
                Sums::new(&input, &packed, &offsets, &list, apart, cut, &mut found).with::<Portable>();
                assert_eq!(found, expected, "{outputs} outputs, {taps} taps, {places} places, portable");
            }
        }
    }

    #[test]
    #[should_panic(expected = "a tap lies outside the input")]
    fn what_lies_outside_the_input_is_not_read() {
        let packed = Packed::new(1, 2, 1, |_, _| 1.0, |_| 0.0);
        sum(&[1.0, 2.0], &packed, &[0, 2], &[Place { from: 0, to: 0 }], 1, false, &mut [0.0]);
    }
}
