//! How keys come from seeds.

use pdk_ops::Key;

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
