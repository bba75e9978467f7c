//! The package of a type is part of its layout, which hosts compare, and this one stands for pdk-abi. The functions of a plugin are those of
//! pdk-abi and two more.

use std::path::PathBuf;
use std::{env, fs};

const MORE: &str = "
    pub horn: unsafe extern \"C\" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<HornFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    pub forget: unsafe extern \"C\" fn(),
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rustc-env=CARGO_PKG_NAME=pdk-abi");
    let variable = |name| env::var_os(name).map(PathBuf::from).ok_or(name);
    let interface = variable("CARGO_MANIFEST_DIR")?.join("../../sdk/pdk-abi/src/functions.rs");
    println!("cargo::rerun-if-changed={}", interface.display());
    let interface = fs::read_to_string(interface)?;
    let behind = interface.split_once("pub struct Plugin {").map(|(_, behind)| behind);
    let functions = behind.and_then(|behind| behind.split_once("\n}\n")).ok_or("pdk-abi has no `Plugin`")?.0;
    let attributes = "#[repr(C)]\n#[derive(StableAbi)]\n#[sabi(kind(Prefix(prefix_ref = PluginRef, prefix_fields = PluginPrefix)))]";
    let plugin = format!("{attributes}\npub struct Plugin {{{functions}{MORE}}}\n");
    Ok(fs::write(variable("OUT_DIR")?.join("plugin.rs"), plugin)?)
}
