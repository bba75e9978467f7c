//! From seeds to keys, and from a key to the streams that numbers are drawn from.
//!
//! A [`Key`] names one component instance in one scenario of one run. From it come any number of ChaCha streams:
//! one for what is drawn once per sequence and one for every frame. Streams never overlap, and drawing from one
//! has no effect on another, so a frame's random numbers are the same whether it is computed alone, in order, or
//! on another thread.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::stream::Random;

/// The stream that belongs to the sequence as a whole; frames use their own index.
const SEQUENCE_STREAM: u64 = u64::MAX;

/// The origin of all random numbers of one component instance in one scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(transparent)]
pub struct Key(pub [u8; 32]);

impl Key {
    /// The stream for what is drawn once per sequence: where drops sit, which way a blur points.
    pub fn sequence(&self) -> Random {
        self.stream(SEQUENCE_STREAM)
    }

    /// The stream for what is drawn anew for every frame, such as sensor noise.
    pub fn frame(&self, index: u64) -> Random {
        self.stream(index)
    }

    fn stream(&self, stream: u64) -> Random {
        let mut generator = ChaCha8Rng::from_seed(self.0);
        generator.set_stream(stream);
        Random::new(generator)
    }
}

/// Derives the key of one component instance in one scenario: from the scenario's seed, the component's name, and how many
/// of the same name come before it in the chain. So no two instances see the same numbers, and the same scenario draws the
/// same ones whatever else is driven beside it.
pub fn key(seed: u64, component: &str, instance: u64) -> Key {
    let mut hasher = blake3::Hasher::new_derive_key("pdk component key, version 2");
    hasher.update(&seed.to_le_bytes());
    hasher.update(&(component.len() as u64).to_le_bytes());
    hasher.update(component.as_bytes());
    hasher.update(&instance.to_le_bytes());
    Key(*hasher.finalize().as_bytes())
}

/// The key of one frame, for a user who wants everything drawn anew for every frame.
pub fn of_frame(key: &Key, frame_index: u64) -> Key {
    let mut hasher = blake3::Hasher::new_keyed(&key.0);
    hasher.update(&frame_index.to_le_bytes());
    Key(*hasher.finalize().as_bytes())
}

/// The seed of a scenario that names none: it follows from the run's seed, the road as canonical JSON (`pdk_model::canonical`) and the
/// repeat alone, so that drives with and without perturbations meet the same world. It has at most 53 bits, which Lua and JSON numbers keep.
pub fn of_scenario(run_seed: u64, road: &str, repeat: u64) -> u64 {
    let mut hasher = blake3::Hasher::new_derive_key("pdk scenario seed, version 1");
    hasher.update(&run_seed.to_le_bytes());
    hasher.update(&(road.len() as u64).to_le_bytes());
    hasher.update(road.as_bytes());
    hasher.update(&repeat.to_le_bytes());
    let mut first = [0; 8];
    first.copy_from_slice(&hasher.finalize().as_bytes()[..8]);
    u64::from_le_bytes(first) >> (64 - 53)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_the_key_counts() {
        let base = key(1, "fog", 0);
        assert_eq!(base, key(1, "fog", 0));
        for other in [key(2, "fog", 0), key(1, "rain", 0), key(1, "fog", 1)] {
            assert_ne!(base, other);
        }
    }

    #[test]
    fn streams_are_independent_of_each_other_and_of_order() {
        let key = Key([7; 32]);
        let mut late = key.frame(9);
        let expected = late.next_u64();
        let mut earlier = key.frame(8);
        (0..100).for_each(|_| {
            earlier.next_u64();
        });
        assert_eq!(key.frame(9).next_u64(), expected);
        assert_ne!(key.sequence().next_u64(), expected);
        assert_ne!(key.frame(8).next_u64(), expected);
    }

    #[test]
    fn known_answer_pins_the_generator() {
        // The first bytes of ChaCha8 under a key of zeros. A change here breaks every recorded run.
        assert_eq!(Key([0; 32]).frame(0).next_u64(), 0xd640_5f89_2fef_003e);
    }
}
