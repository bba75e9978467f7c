//! Plugin files before they are loaded, and what plugins say of themselves.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_components::check_description;
use pdk_components::elf;
use pdk_sdk::config::Config;
use pdk_sdk::describe::Description;
use serde_json::Map;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| pdk_fuzz::folder("plugin").join("plugin.so"));

fuzz_target!(|data: &[u8]| {
    if let Ok(description) = serde_json::from_slice::<Description>(data) {
        if check_description(&description).is_ok() {
            let _ = Config::check(&description, &Map::new());
        }
        return;
    }
    std::fs::write(&*FILE, data).expect("a file");
    if let Ok(Some((needed, has))) = elf::missing_part(&FILE) {
        assert!(needed > has && has == data.len() as u64);
    }
});
