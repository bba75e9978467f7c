//! Binds calls of this library's own functions within the library, so that its mathematical functions (`src/mathematics.rs`) are
//! found there and not in the system's library, which the program has loaded before.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|system| system == "linux") {
        println!("cargo:rustc-cdylib-link-arg=-Wl,-Bsymbolic");
    }
}
