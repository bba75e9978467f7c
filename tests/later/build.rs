//! The package of a type is part of its layout, which hosts compare, and this one stands for pdk-abi.

fn main() {
    println!("cargo::rustc-env=CARGO_PKG_NAME=pdk-abi");
}
