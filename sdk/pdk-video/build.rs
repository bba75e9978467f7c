//! Says at build time that OpenH264, which this crate builds on, is compiled without assembly where nasm is missing: its own
//! build does not.

use std::env;

fn main() {
    // Not where the PATH changes, which it does from shell to shell: OpenH264's build does not look again either.
    println!("cargo::rerun-if-changed=build.rs");
    let target = env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
    let path = env::var_os("PATH").unwrap_or_default();
    let found = env::split_paths(&path).any(|folder| folder.join("nasm").is_file());
    if target == "x86_64" && !found {
        println!(
            "cargo::warning=nasm is not on the PATH, so OpenH264 is built without assembly: videos and the first use of a clip \
             take longer; to change that, install nasm, then `cargo clean --release -p openh264-sys2 -p pdk-video` and build again"
        );
    }
}
