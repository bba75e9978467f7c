//! How keys come from seeds.

use pdk_ops::Key;

/// Derives the key of one component instance in one scenario of one run. The name, the instance and the scenario are
/// part of the key, so that no two of them ever see the same numbers.
pub fn key(run_seed: u64, component: &str, instance: u64, scenario: u64) -> Key {
    let mut hasher = blake3::Hasher::new_derive_key("pdk component key, version 1");
    hasher.update(&run_seed.to_le_bytes());
    hasher.update(&(component.len() as u64).to_le_bytes());
    hasher.update(component.as_bytes());
    hasher.update(&instance.to_le_bytes());
    hasher.update(&scenario.to_le_bytes());
    Key(*hasher.finalize().as_bytes())
}

/// The key of one frame, for a user who wants everything drawn anew for every frame.
pub fn of_frame(key: &Key, frame_index: u64) -> Key {
    let mut hasher = blake3::Hasher::new_keyed(&key.0);
    hasher.update(&frame_index.to_le_bytes());
    Key(*hasher.finalize().as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_the_key_counts() {
        let base = key(1, "fog", 0, 0);
        assert_eq!(base, key(1, "fog", 0, 0));
        for other in [key(2, "fog", 0, 0), key(1, "rain", 0, 0), key(1, "fog", 1, 0), key(1, "fog", 0, 1)] {
            assert_ne!(base, other);
        }
    }
}
