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
//! | pack it | [`archive`], [`debian`], [`wheel`], [`sdist`] |
//! | make sure that the licences and sources of all dependencies are allowed | [`allowed`] |
//! | write what accompanies a release: notes, a bill of materials, checksums | [`release`], [`materials`] |
//!
//! `cargo run --release -p pdk-dist -- site` builds the site from the documents ([`site`], [`links`]).
//!
//! Everything is written below `target/pdk-dist`.

mod allowed;
mod archive;
mod check;
mod compile;
mod debian;
mod licences;
mod links;
mod materials;
mod project;
mod release;
mod sdist;
mod sdk;
mod site;
mod tree;
mod wheel;

use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use pdk_model::error::Result;

use crate::project::{Project, Target};

/// Makes an archive of pdk that can be unpacked anywhere, a Debian package and a Python package, in target/pdk-dist
#[derive(Parser)]
#[command(name = "pdk-dist", version, args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(subcommand)]
    step: Option<Step>,
    #[command(flatten)]
    packages: Packages,
}

/// Something else than packages.
#[derive(Subcommand)]
enum Step {
    /// Build the site from the documents, in target/pdk-dist/site/book; installs mdBook
    Site,
}

/// Which packages are made.
#[derive(Args)]
struct Packages {
    /// How the executable and the libraries are compiled
    #[arg(long, value_enum, default_value_t = Profile::Dist)]
    profile: Profile,
    /// The processor that packages are for; another one than this machine's needs its standard library of Rust
    #[arg(long, value_enum, default_value_t = Target::HERE)]
    target: Target,
    /// Make no Debian package
    #[arg(long)]
    no_package: bool,
    /// Make the Python package as well; needs maturin
    #[arg(long)]
    wheel: bool,
    /// Make the source distribution of the Python package as well; needs git
    #[arg(long)]
    sdist: bool,
    /// Make everything, and put it in target/pdk-dist/release-VERSION with notes, a bill of materials and checksums
    #[arg(long, conflicts_with = "no_package")]
    release: bool,
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
    match arguments.step {
        Some(Step::Site) => {
            let book = site::build(&Project::for_target(Target::HERE)?)?;
            println!("{}", book.join("index.html").display());
            Ok(())
        }
        None => pack(&arguments.packages),
    }
}

fn pack(arguments: &Packages) -> Result<()> {
    let project = Project::for_target(arguments.target)?;
    allowed::check(&project)?;
    // Before everything is compiled, which takes long.
    let notes = arguments.release.then(|| release::notes(&project, arguments.profile)).transpose()?;
    let compiled = compile::run(&project, arguments.profile)?;
    let tree = tree::lay_out(&project, &compiled, arguments.profile)?;
    let report = check::run(&project, &tree, arguments.profile)?;
    let mut made = vec![archive::pack(&project, &tree, arguments.profile)?];
    if !arguments.no_package {
        made.push(debian::pack(&project)?);
    }
    if arguments.wheel || arguments.release {
        made.push(wheel::pack(&project, &tree, arguments.profile)?);
    }
    if arguments.sdist || arguments.release {
        made.push(sdist::pack(&project)?);
    }
    println!("{report}");
    for file in &made {
        println!("{} ({} bytes)", file.display(), std::fs::metadata(file)?.len());
    }
    if let Some(notes) = notes {
        println!("{}", release::collect(&project, &made, &notes)?.display());
    }
    Ok(())
}
