//! Makes what is shipped of pdk: an archive that can be unpacked anywhere, a Debian package, and a Python package.
//!
//! ```sh
//! cargo run --release -p pdk-dist
//! ```
//!
//! | step | module |
//! |---|---|
//! | compile the executable and the libraries, for distributions of the last years | [`compile`] |
//! | lay out a tree as it lies below `/usr`: with them, the SDK's source ([`sdk`]), licences ([`licences`]), completions, manual | [`tree`] |
//! | make sure that what is in the tree works, and say which glibc it needs | [`check`] |
//! | pack it | [`archive`], [`debian`], [`wheel`] |
//!
//! Everything is written below `target/pdk-dist`.

mod archive;
mod check;
mod compile;
mod debian;
mod licences;
mod project;
mod sdk;
mod tree;
mod wheel;

use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use pdk_model::error::Result;

use crate::project::Project;

/// Makes an archive of pdk that can be unpacked anywhere, a Debian package and a Python package, in target/pdk-dist
#[derive(Parser)]
#[command(name = "pdk-dist", version)]
struct Arguments {
    /// How the executable and the libraries are compiled
    #[arg(long, value_enum, default_value_t = Profile::Dist)]
    profile: Profile,
    /// Make no Debian package
    #[arg(long)]
    no_package: bool,
    /// Make the Python package as well; needs maturin
    #[arg(long)]
    wheel: bool,
}

/// How the executable and the libraries are compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Profile {
    /// To be shipped: small, and for distributions of the last years; needs nasm, cargo-zigbuild and zig
    Dist,
    /// As `cargo build --release` does, for machines like this one: to try the archive without compiling anything twice
    Release,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("pdk-dist: error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let project = Project::here()?;
    let compiled = compile::run(&project, arguments.profile)?;
    let tree = tree::lay_out(&project, &compiled, arguments.profile)?;
    let report = check::run(&project, &tree, arguments.profile)?;
    let mut made = vec![archive::pack(&project, &tree)?];
    if !arguments.no_package {
        made.push(debian::pack(&project)?);
    }
    if arguments.wheel {
        made.push(wheel::pack(&project, &tree, arguments.profile)?);
    }
    println!("{report}");
    for file in made {
        println!("{} ({} bytes)", file.display(), std::fs::metadata(&file)?.len());
    }
    Ok(())
}
