//! Fourier transforms of eight sequences at a time, one in each lane of a vector.
//!
//! Self-sorting passes after Stockham (Cochran and others, "What is the fast Fourier transform?", 1967) with radices 4, 2,
//! 3 and 5, and a sum for other prime factors, which takes the longer the larger they are. The same operations in the
//! same order on every processor, with factors from [`libm`], so the same result everywhere.

use std::f64::consts::PI;
use std::ops::{Index, IndexMut};

use crate::simd::vectorised;

/// The number of sequences that are transformed together.
pub(crate) const LANES: usize = 8;

/// The same element of each sequence, aligned as vectors are.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct Lane(pub(crate) [f32; LANES]);

impl Lane {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    /// The numbers of all lanes, one element after the other. Loops over them are vectorised as they are; in loops over elements the
    /// compiler mixes lanes of several.
    pub(crate) fn numbers(elements: &[Self]) -> &[f32] {
        // SAFETY: an element is `LANES` numbers without padding, and is aligned more strictly than they are.
        unsafe { std::slice::from_raw_parts(elements.as_ptr().cast(), elements.len() * LANES) }
    }
}

impl Index<usize> for Lane {
    type Output = f32;
    #[inline(always)]
    fn index(&self, lane: usize) -> &f32 {
        &self.0[lane]
    }
}

impl IndexMut<usize> for Lane {
    #[inline(always)]
    fn index_mut(&mut self, lane: usize) -> &mut f32 {
        &mut self.0[lane]
    }
}

/// A complex number of one lane.
#[derive(Debug, Clone, Copy, Default)]
struct Complex {
    re: f32,
    im: f32,
}

/// A complex factor that is the same for all lanes.
type Factor = Complex;

/// `e^(-2 pi i k / n)`.
fn root(k: usize, n: usize) -> Factor {
    let (sin, cos) = libm::sincos(-2.0 * PI * (k % n) as f64 / n as f64);
    Factor { re: cos as f32, im: sin as f32 }
}

impl Complex {
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }

    #[inline(always)]
    fn scale(self, factor: f32) -> Self {
        Self { re: self.re * factor, im: self.im * factor }
    }

    /// Times `-i`.
    #[inline(always)]
    fn turn(self) -> Self {
        Self { re: self.im, im: -self.re }
    }

    #[inline(always)]
    fn times(self, factor: Factor) -> Self {
        Self { re: self.re * factor.re - self.im * factor.im, im: self.re * factor.im + self.im * factor.re }
    }
}

/// Eight sequences of complex numbers, real and imaginary parts apart.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sequences {
    pub(crate) re: Vec<Lane>,
    pub(crate) im: Vec<Lane>,
}

impl Sequences {
    pub(crate) fn resize(&mut self, len: usize) {
        self.re.resize(len, Lane::ZERO);
        self.im.resize(len, Lane::ZERO);
    }
}

/// How sequences of one length are transformed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Plan {
    len: usize,
    passes: Vec<Pass>,
    factors: Vec<Factor>,
    /// What the passes write to in turn.
    scratch: Sequences,
    /// Sums and differences of a group's elements, for large radices.
    pairs: Vec<[Lane; 4]>,
}

/// One pass: it combines `radix` elements that lie `rest * done` apart into as many that lie `done` apart.
#[derive(Debug, Clone, Copy)]
struct Pass {
    radix: usize,
    /// The product of the radices of later passes.
    rest: usize,
    /// The product of the radices of earlier passes.
    done: usize,
    /// The start of its factors: `radix - 1` for each of `rest` groups; for radices above 5, then the roots of the radix.
    factors: usize,
}

impl Plan {
    /// Prepares for sequences of `len` elements, at least 1. Nothing happens if it is prepared for them already.
    pub(crate) fn prepare(&mut self, len: usize) {
        if self.len == len {
            return;
        }
        self.len = len;
        self.passes.clear();
        self.factors.clear();
        self.scratch.resize(len);
        self.pairs.clear();
        let (mut rest, mut done) = (len, 1);
        while rest > 1 {
            let radix = [4, 2, 3, 5].into_iter().find(|r| rest.is_multiple_of(*r));
            let radix = radix.unwrap_or_else(|| smallest_factor(rest));
            let length = rest;
            rest /= radix;
            self.passes.push(Pass { radix, rest, done, factors: self.factors.len() });
            for group in 0..rest {
                self.factors.extend((1..radix).map(|r| root(group * r, length)));
            }
            if radix > 5 {
                self.factors.extend((0..radix).map(|k| root(k, radix)));
                self.pairs.resize(self.pairs.len().max(radix / 2), [Lane::ZERO; 4]);
            }
            done *= radix;
        }
    }

    /// Transforms eight sequences in place: element `k` becomes the sum of all elements `j` times `e^(-2 pi i j k / n)`.
    /// With `re` and `im` exchanged it is the inverse, larger by the length.
    ///
    /// # Panics
    /// If a slice has another length than the plan.
    pub(crate) fn transform(&mut self, re: &mut [Lane], im: &mut [Lane]) {
        assert!(re.len() == self.len && im.len() == self.len, "the plan is for another length");
        let Sequences { re: other_re, im: other_im } = &mut self.scratch;
        run(&self.passes, &self.factors, re, im, other_re, other_im, &mut self.pairs);
    }
}

/// The smallest prime factor of a number that has none below 6.
fn smallest_factor(number: usize) -> usize {
    (7..).step_by(2).take_while(|f| f * f <= number).find(|f| number.is_multiple_of(*f)).unwrap_or(number)
}

vectorised! {
    fn run / run_avx2 / run_avx512 (
        passes: &[Pass], factors: &[Factor], re: &mut [Lane], im: &mut [Lane], other_re: &mut [Lane],
        other_im: &mut [Lane], pairs: &mut [[Lane; 4]],
    ) {
        for (number, pass) in passes.iter().enumerate() {
            let factors = &factors[pass.factors..];
            if number % 2 == 0 {
                one_pass(pass, factors, re, im, other_re, other_im, pairs);
            } else {
                one_pass(pass, factors, other_re, other_im, re, im, pairs);
            }
        }
        if passes.len() % 2 == 1 {
            re.copy_from_slice(other_re);
            im.copy_from_slice(other_im);
        }
    }
}

#[inline(always)]
fn one_pass(
    pass: &Pass,
    factors: &[Factor],
    re: &[Lane],
    im: &[Lane],
    to_re: &mut [Lane],
    to_im: &mut [Lane],
    pairs: &mut [[Lane; 4]],
) {
    match (pass.radix, pass.rest) {
        (2, 1) => fixed_pass::<2, false>(pass, factors, re, im, to_re, to_im),
        (3, 1) => fixed_pass::<3, false>(pass, factors, re, im, to_re, to_im),
        (4, 1) => fixed_pass::<4, false>(pass, factors, re, im, to_re, to_im),
        (5, 1) => fixed_pass::<5, false>(pass, factors, re, im, to_re, to_im),
        (2, _) => fixed_pass::<2, true>(pass, factors, re, im, to_re, to_im),
        (3, _) => fixed_pass::<3, true>(pass, factors, re, im, to_re, to_im),
        (4, _) => fixed_pass::<4, true>(pass, factors, re, im, to_re, to_im),
        (5, _) => fixed_pass::<5, true>(pass, factors, re, im, to_re, to_im),
        _ => odd_pass(pass, factors, re, im, to_re, to_im, pairs),
    }
}

/// A pass with a transform of `RADIX` elements. In the last one all factors are 1, and `TURNED` says that it is not that.
#[inline(always)]
fn fixed_pass<const RADIX: usize, const TURNED: bool>(
    pass: &Pass,
    factors: &[Factor],
    re: &[Lane],
    im: &[Lane],
    to_re: &mut [Lane],
    to_im: &mut [Lane],
) where
    Direct: Transform<RADIX>,
{
    let Pass { rest, done, .. } = *pass;
    let apart = rest * done;
    let (re, im): ([&[Lane]; RADIX], [&[Lane]; RADIX]) = (
        std::array::from_fn(|j| &re[j * apart..][..apart]),
        std::array::from_fn(|j| &im[j * apart..][..apart]),
    );
    let groups = to_re.chunks_exact_mut(RADIX * done).zip(to_im.chunks_exact_mut(RADIX * done));
    for (group, (to_re, to_im)) in groups.enumerate() {
        let factors: [Factor; RADIX] = std::array::from_fn(|r| match r {
            0 => Factor::default(),
            _ => factors[group * (RADIX - 1) + r - 1],
        });
        let re: [&[Lane]; RADIX] = std::array::from_fn(|j| &re[j][group * done..][..done]);
        let im: [&[Lane]; RADIX] = std::array::from_fn(|j| &im[j][group * done..][..done]);
        for k in 0..done {
            let (mut out_re, mut out_im) = ([Lane::ZERO; RADIX], [Lane::ZERO; RADIX]);
            // The loop is over the lanes, so that the compiler makes one vector of each step.
            for lane in 0..LANES {
                let elements = std::array::from_fn(|j| Complex { re: re[j][k][lane], im: im[j][k][lane] });
                let out = Direct::transform(elements);
                for r in 0..RADIX {
                    let turned = if TURNED && r > 0 { out[r].times(factors[r]) } else { out[r] };
                    (out_re[r][lane], out_im[r][lane]) = (turned.re, turned.im);
                }
            }
            for r in 0..RADIX {
                (to_re[r * done + k], to_im[r * done + k]) = (out_re[r], out_im[r]);
            }
        }
    }
}

/// Transforms of a few elements, written out. (A trait, because a function handed on as an argument is not always made
/// part of its caller, whose instruction set it has to share.)
trait Transform<const RADIX: usize> {
    fn transform(elements: [Complex; RADIX]) -> [Complex; RADIX];
}

/// See [`Transform`].
struct Direct;

impl Transform<2> for Direct {
    #[inline(always)]
    fn transform([a, b]: [Complex; 2]) -> [Complex; 2] {
        [a.add(b), a.sub(b)]
    }
}

impl Transform<3> for Direct {
    #[inline(always)]
    fn transform([a, b, c]: [Complex; 3]) -> [Complex; 3] {
        /// The sine of 60 degrees.
        const SIN: f32 = 0.866_025_4;
        let sum = b.add(c);
        let middle = a.sub(sum.scale(0.5));
        let side = b.sub(c).scale(SIN).turn();
        [a.add(sum), middle.add(side), middle.sub(side)]
    }
}

impl Transform<4> for Direct {
    #[inline(always)]
    fn transform([a, b, c, d]: [Complex; 4]) -> [Complex; 4] {
        let (even, odd) = (a.add(c), b.add(d));
        let (even_side, odd_side) = (a.sub(c), b.sub(d).turn());
        [even.add(odd), even_side.add(odd_side), even.sub(odd), even_side.sub(odd_side)]
    }
}

impl Transform<5> for Direct {
    #[inline(always)]
    fn transform([a, b, c, d, e]: [Complex; 5]) -> [Complex; 5] {
        /// Cosines and sines of 72 and 144 degrees.
        const COS: [f32; 2] = [0.309_017, -0.809_017];
        const SIN: [f32; 2] = [0.951_056_54, 0.587_785_24];
        let (outer, inner) = (b.add(e), c.add(d));
        let (outer_side, inner_side) = (b.sub(e).turn(), c.sub(d).turn());
        let near = a.add(outer.scale(COS[0])).add(inner.scale(COS[1]));
        let far = a.add(outer.scale(COS[1])).add(inner.scale(COS[0]));
        let near_side = outer_side.scale(SIN[0]).add(inner_side.scale(SIN[1]));
        let far_side = outer_side.scale(SIN[1]).sub(inner_side.scale(SIN[0]));
        [
            a.add(outer).add(inner),
            near.add(near_side),
            far.add(far_side),
            far.sub(far_side),
            near.sub(near_side),
        ]
    }
}

/// A pass for an odd prime radix. Elements `j` and `radix - j` meet conjugate roots, so that their sum is multiplied by a
/// cosine and their difference by a sine, and outputs `r` and `radix - r` share both products.
#[inline(always)]
fn odd_pass(
    pass: &Pass,
    factors: &[Factor],
    re: &[Lane],
    im: &[Lane],
    to_re: &mut [Lane],
    to_im: &mut [Lane],
    pairs: &mut [[Lane; 4]],
) {
    let Pass { radix, rest, done, .. } = *pass;
    let roots = &factors[rest * (radix - 1)..][..radix];
    let pairs = &mut pairs[..radix / 2];
    for group in 0..rest {
        let factors = &factors[group * (radix - 1)..][..radix - 1];
        for k in 0..done {
            let at = |j: usize| (j * rest + group) * done + k;
            let (first_re, first_im) = (re[at(0)], im[at(0)]);
            let (mut total_re, mut total_im) = (first_re, first_im);
            for (j, pair) in (1..).zip(pairs.iter_mut()) {
                let (near, far) = (at(j), at(radix - j));
                for lane in 0..LANES {
                    pair[0][lane] = re[near][lane] + re[far][lane];
                    pair[1][lane] = im[near][lane] + im[far][lane];
                    pair[2][lane] = re[near][lane] - re[far][lane];
                    pair[3][lane] = im[near][lane] - im[far][lane];
                    total_re[lane] += pair[0][lane];
                    total_im[lane] += pair[1][lane];
                }
            }
            let to = group * radix * done + k;
            (to_re[to], to_im[to]) = (total_re, total_im);
            for r in 1..=radix / 2 {
                let (mut even_re, mut even_im) = (first_re, first_im);
                let (mut odd_re, mut odd_im) = (Lane::ZERO, Lane::ZERO);
                let mut turn = 0;
                for pair in &*pairs {
                    turn += r;
                    turn -= if turn >= radix { radix } else { 0 };
                    let root = roots[turn];
                    for lane in 0..LANES {
                        even_re[lane] += pair[0][lane] * root.re;
                        even_im[lane] += pair[1][lane] * root.re;
                        odd_re[lane] += pair[2][lane] * root.im;
                        odd_im[lane] += pair[3][lane] * root.im;
                    }
                }
                for (r, sign) in [(r, -1.0), (radix - r, 1.0)] {
                    let (mut out_re, mut out_im) = (Lane::ZERO, Lane::ZERO);
                    for lane in 0..LANES {
                        let even = Complex { re: even_re[lane], im: even_im[lane] };
                        let side = Complex { re: odd_re[lane], im: odd_im[lane] }.turn().scale(sign);
                        let out = even.add(side).times(factors[r - 1]);
                        (out_re[lane], out_im[lane]) = (out.re, out.im);
                    }
                    (to_re[to + r * done], to_im[to + r * done]) = (out_re, out_im);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::with_each;
    use pdk_seed::Key;

    fn random_sequences(len: usize) -> Sequences {
        let mut random = Key([4; 32]).sequence();
        let mut part = || (0..len).map(|_| lanes_of(|| random.uniform(-100.0, 100.0) as f32)).collect();
        Sequences { re: part(), im: part() }
    }

    fn lanes_of(mut of: impl FnMut() -> f32) -> Lane {
        Lane(std::array::from_fn(|_| of()))
    }

    /// The sum by which the transform is defined, in double precision.
    fn plain(from: &Sequences, lane: usize) -> Vec<(f64, f64)> {
        let len = from.re.len();
        (0..len)
            .map(|k| {
                (0..len).fold((0.0, 0.0), |(re, im), j| {
                    let (sin, cos) = libm::sincos(-2.0 * PI * (j * k % len) as f64 / len as f64);
                    let (a, b) = (f64::from(from.re[j][lane]), f64::from(from.im[j][lane]));
                    (re + a * cos - b * sin, im + a * sin + b * cos)
                })
            })
            .collect()
    }

    #[test]
    fn matches_the_definition_at_any_length_with_and_without_vectors() {
        let mut plan = Plan::default();
        for len in (1..=40).chain([60, 64, 75, 97, 120, 161, 240, 320, 322]) {
            let from = random_sequences(len);
            let mut to = from.clone();
            plan.prepare(len);
            plan.transform(&mut to.re, &mut to.im);
            for lane in 0..LANES {
                for (k, (re, im)) in plain(&from, lane).into_iter().enumerate() {
                    let off = libm::hypot(f64::from(to.re[k][lane]) - re, f64::from(to.im[k][lane]) - im);
                    assert!(off < 2e-3 * (len as f64).sqrt().max(1.0), "{len}: element {k} is off by {off}");
                }
            }
            with_each(|instructions| {
                let mut again = from.clone();
                plan.transform(&mut again.re, &mut again.im);
                assert!(again.re == to.re && again.im == to.im, "{len} with {instructions:?}");
            });
        }
    }

    #[test]
    fn exchanged_parts_give_the_inverse() {
        let mut plan = Plan::default();
        for len in [1, 7, 48, 320] {
            let from = random_sequences(len);
            let mut to = from.clone();
            plan.prepare(len);
            plan.transform(&mut to.re, &mut to.im);
            plan.transform(&mut to.im, &mut to.re);
            for (before, after) in from.re.iter().flat_map(|l| &l.0).zip(to.re.iter().flat_map(|l| &l.0)) {
                assert!((before - after / len as f32).abs() < 1e-3, "{len}");
            }
        }
    }
}
