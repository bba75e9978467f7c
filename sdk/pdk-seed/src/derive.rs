//! How keys come from seeds.

use crate::Key;

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

/// The seed of a scenario that names none: it follows from the run's seed, the road as canonical JSON and the repeat alone, so that
/// drives with and without perturbations meet the same world. It has at most 53 bits, which Lua and JSON numbers keep.
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
}
