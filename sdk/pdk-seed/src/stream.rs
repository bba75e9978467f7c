//! What is drawn from a stream of a [`Key`](crate::Key): numbers, and orders.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use crate::wide;

/// Below this many bytes, the generator's own four blocks at a time are faster.
const FEW: usize = 512;
/// The bytes of a word, in which the generator counts.
const WORD: usize = 4;
/// The words of a block.
const WORDS_OF_BLOCK: u128 = (wide::BLOCK / WORD) as u128;

/// One stream of random numbers.
#[derive(Debug, Clone)]
pub struct Random {
    generator: ChaCha8Rng,
}

impl Random {
    pub(crate) fn new(generator: ChaCha8Rng) -> Self {
        Self { generator }
    }

    /// 32 random bits.
    pub fn next_u32(&mut self) -> u32 {
        self.generator.next_u32()
    }

    /// 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.generator.next_u64()
    }

    /// Fills a slice with random bytes. What is drawn next begins with a whole word of four bytes.
    pub fn fill(&mut self, bytes: &mut [u8]) {
        if bytes.len() < FEW || !self.fill_wide(bytes) {
            self.generator.fill_bytes(bytes);
        }
    }

    /// As [`fill`](Self::fill), many blocks at a time; false if this processor cannot.
    fn fill_wide(&mut self, bytes: &mut [u8]) -> bool {
        let position = self.generator.get_word_pos();
        let end = position.wrapping_add(bytes.len().div_ceil(WORD) as u128);
        let stream = wide::Stream::new(&self.generator.get_seed(), self.generator.get_stream());
        let mut block = (position / WORDS_OF_BLOCK) as u64;
        // Of the first block, what was drawn already is left out.
        let mut drawn = (position % WORDS_OF_BLOCK) as usize * WORD;
        let (mut group, mut left) = ([0; wide::GROUP], bytes);
        while !left.is_empty() {
            match left.first_chunk_mut() {
                Some(whole) if drawn == 0 => {
                    if !stream.blocks(block, whole) {
                        return false;
                    }
                    left = &mut left[wide::GROUP..];
                }
                _ => {
                    if !stream.blocks(block, &mut group) {
                        return false;
                    }
                    let count = left.len().min(wide::GROUP - drawn);
                    left[..count].copy_from_slice(&group[drawn..drawn + count]);
                    left = &mut left[count..];
                    drawn = 0;
                }
            }
            block = block.wrapping_add((wide::GROUP / wide::BLOCK) as u64);
        }
        self.generator.set_word_pos(end);
        true
    }

    /// A number in `0.0..1.0`, in steps of 2^-53.
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// A number in `low..high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// An integer in `0..bound`, every one equally likely; 0 where `bound` is 0.
    pub fn below(&mut self, bound: u32) -> u32 {
        // Lemire, "Fast random integer generation in an interval" (2019).
        let mut product = u64::from(self.next_u32()) * u64::from(bound);
        if (product as u32) < bound {
            let threshold = bound.wrapping_neg() % bound;
            while (product as u32) < threshold {
                product = u64::from(self.next_u32()) * u64::from(bound);
            }
        }
        (product >> 32) as u32
    }

    /// An integer in `low..=high`; `low` where the range is empty.
    pub fn between(&mut self, low: i32, high: i32) -> i32 {
        let span = (i64::from(high) - i64::from(low) + 1).clamp(1, i64::from(u32::MAX)) as u32;
        (i64::from(low) + i64::from(self.below(span))) as i32
    }

    /// A number from the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        // The half step keeps the argument inside the open interval.
        normal_quantile(
            (self.next_u64() >> 12) as f64 * (1.0 / (1u64 << 52) as f64) + 0.5 / (1u64 << 52) as f64,
        )
    }

    /// Puts a slice into random order.
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last as u32 + 1) as usize);
        }
    }
}

/// The quantile function of the standard normal distribution for `0 < p < 1`: the value that a standard normal
/// variable stays below with probability `p`. Relative error below 1e-15.
///
/// Wichura, "Algorithm AS 241: The percentage points of the normal distribution" (1988).
pub fn normal_quantile(p: f64) -> f64 {
    fn ratio(x: f64, numerator: [f64; 8], denominator: [f64; 7]) -> f64 {
        let top = numerator.iter().rev().fold(0.0, |sum, c| sum * x + c);
        let bottom = denominator.iter().rev().fold(0.0, |sum, c| sum * x + c) * x + 1.0;
        top / bottom
    }
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let x = 0.180625 - q * q;
        return q * ratio(
            x,
            [
                3.387_132_872_796_366_5,
                1.331_416_678_917_843_8e2,
                1.971_590_950_306_551_3e3,
                1.373_169_376_550_946e4,
                4.592_195_393_154_987e4,
                6.726_577_092_700_87e4,
                3.343_057_558_358_813e4,
                2.509_080_928_730_122_7e3,
            ],
            [
                4.231_333_070_160_091e1,
                6.871_870_074_920_579e2,
                5.394_196_021_424_751e3,
                2.121_379_430_158_659_7e4,
                3.930_789_580_009_271e4,
                2.872_908_573_572_194_3e4,
                5.226_495_278_852_854e3,
            ],
        );
    }
    let tail = if q < 0.0 { p } else { 1.0 - p };
    let r = libm::sqrt(-libm::log(tail));
    let magnitude = if r <= 5.0 {
        ratio(
            r - 1.6,
            [
                1.423_437_110_749_683_5,
                4.630_337_846_156_546,
                5.769_497_221_460_691,
                3.647_848_324_763_204_5,
                1.270_458_252_452_368_4,
                2.417_807_251_774_506e-1,
                2.272_384_498_926_918_4e-2,
                7.745_450_142_783_414e-4,
            ],
            [
                2.053_191_626_637_759,
                1.676_384_830_183_803_8,
                6.897_673_349_851e-1,
                1.481_039_764_274_800_8e-1,
                1.519_866_656_361_645_7e-2,
                5.475_938_084_995_345e-4,
                1.050_750_071_644_416_9e-9,
            ],
        )
    } else {
        ratio(
            r - 5.0,
            [
                6.657_904_643_501_103,
                5.463_784_911_164_114,
                1.784_826_539_917_291_3,
                2.965_605_718_285_049e-1,
                2.653_218_952_657_612_4e-2,
                1.242_660_947_388_078_4e-3,
                2.711_555_568_743_487_6e-5,
                2.010_334_399_292_288_1e-7,
            ],
            [
                5.998_322_065_558_88e-1,
                1.369_298_809_227_358e-1,
                1.487_536_129_085_061_5e-2,
                7.868_691_311_456_133e-4,
                1.846_318_317_510_054_7e-5,
                1.421_511_758_316_446e-7,
                2.044_263_103_389_939_8e-15,
            ],
        )
    };
    if q < 0.0 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Key;

    #[test]
    fn quantiles_match_published_values() {
        for (p, z) in [
            (0.5, 0.0),
            (0.975, 1.959_963_984_540_054),
            (0.841_344_746_068_542_9, 1.0),
            (0.001, -3.090_232_306_167_813_5),
            (1e-20, -9.262_340_089_798_408),
        ] {
            assert!((normal_quantile(p) - z).abs() < 1e-12, "{p}: {}", normal_quantile(p));
        }
    }

    #[test]
    fn slices_are_filled_as_the_generator_fills_them() {
        let mut random = Key([5; 32]).frame(9);
        let mut generator = random.generator.clone();
        // From any place in a block, and over more than one group; numbers are drawn in between.
        for length in (0..3000).step_by(7).chain([1024, 1024, 2048, 511, 512, 513, 70_001]) {
            let (mut bytes, mut expected) = (vec![0; length], vec![0; length]);
            random.fill(&mut bytes);
            generator.fill_bytes(&mut expected);
            assert_eq!(bytes, expected, "{length}");
            assert_eq!(random.next_u32(), generator.next_u32(), "after {length}");
            if length % 3 == 0 {
                assert_eq!(random.next_u64(), generator.next_u64(), "after {length}");
            }
        }
    }

    #[test]
    fn below_is_unbiased_and_stays_below() {
        let mut random = Key([1; 32]).sequence();
        let mut counts = [0u32; 7];
        for _ in 0..70_000 {
            counts[random.below(7) as usize] += 1;
        }
        assert!(counts.iter().all(|&c| (9_600..10_400).contains(&c)), "{counts:?}");
        assert_eq!(random.below(1), 0);
        assert_eq!(random.below(0), 0);
    }

    #[test]
    fn normal_has_the_moments_of_a_normal_distribution() {
        let mut random = Key([2; 32]).sequence();
        let draws: Vec<f64> = (0..100_000).map(|_| random.normal()).collect();
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        let variance = draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / draws.len() as f64;
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.02, "{mean} {variance}");
    }
}
