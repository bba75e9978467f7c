//! The starting points that `pdk new` writes.

use clap::ValueEnum;
use pdk_sdk::describe::Kind;

/// What a starting point is.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum What {
    /// A perturbation: one file in Lua, or with --rust a crate
    Perturbation,
    /// A mask: one file in Lua, or with --rust a crate
    Mask,
    /// A simulator: a crate in Rust
    Simulator,
    /// An adapter to a simulator that is a program of its own: a crate in Rust
    Adapter,
    /// A driver: a crate in Rust
    Driver,
    /// A saliency method: a crate in Rust
    Saliency,
    /// A search strategy: a crate in Rust
    Search,
    /// A reader of recorded datasets: a crate in Rust
    Dataset,
    /// A pipeline: one file in Lua
    Pipeline,
    /// A description of a network, beside its ONNX file: how frames become its tensors, and its outputs a control
    Network,
}

/// The crate of a plugin.
pub struct Crate {
    /// `src/lib.rs`.
    pub source: &'static str,
    /// `README.md`.
    pub readme: &'static str,
    /// What the component is called in its README.
    pub kind: &'static str,
    /// The commands in its README that try the component.
    pub attempt: &'static str,
}

/// The README of all plugins but adapters.
const README: &str = include_str!("../../../templates/README.md");

impl What {
    /// The kind of the component that is written; none for a pipeline and a description.
    pub fn kind(self) -> Option<Kind> {
        Some(match self {
            What::Perturbation => Kind::Perturbation,
            What::Mask => Kind::Mask,
            What::Simulator | What::Adapter => Kind::Simulator,
            What::Driver => Kind::Driver,
            What::Saliency => Kind::Saliency,
            What::Search => Kind::Search,
            What::Dataset => Kind::Dataset,
            What::Pipeline | What::Network => return None,
        })
    }

    /// The component as one file in Lua, with the command that tries it; none for what is written in Rust alone.
    pub fn script(self) -> Option<[&'static str; 2]> {
        match self {
            What::Perturbation => Some([
                include_str!("../../../templates/perturbation/perturbation.lua"),
                "pdk --plugins {{folder}} perturb IMAGE --with {{name}}@2 -o out.png",
            ]),
            What::Mask => Some([
                include_str!("../../../templates/mask/mask.lua"),
                r#"pdk --plugins {{folder}} perturb IMAGE --with '{{perturbation}},where={"mask":"{{name}}"}' -o out.png"#,
            ]),
            _ => None,
        }
    }

    /// The component as a crate in Rust; none for a pipeline.
    pub fn package(self) -> Option<Crate> {
        let package = |source, kind, attempt| Some(Crate { source, readme: README, kind, attempt });
        match self {
            What::Perturbation => package(
                include_str!("../../../templates/perturbation/lib.rs.txt"),
                "perturbation",
                "pdk --plugins target/release perturb IMAGE --with {{name}}@2 -o out.png",
            ),
            What::Mask => package(
                include_str!("../../../templates/mask/lib.rs.txt"),
                "mask",
                r#"pdk --plugins target/release perturb IMAGE --with '{{perturbation}},where={"mask":"{{name}}"}' -o out.png"#,
            ),
            What::Simulator => package(
                include_str!("../../../templates/simulator/lib.rs.txt"),
                "simulator",
                "pdk new pipeline try_{{name}}                 # then drive in it, with a clear view and perturbed\n\
                 pdk --plugins target/release run try_{{name}}.lua --set simulator={{name}}",
            ),
            What::Driver => package(
                include_str!("../../../templates/driver/lib.rs.txt"),
                "driver",
                "pdk new pipeline try_{{name}}                 # then drive it, with a clear view and perturbed\n\
                 pdk --plugins target/release run try_{{name}}.lua --set driver={{name}}",
            ),
            What::Saliency => package(
                include_str!("../../../templates/saliency/lib.rs.txt"),
                "saliency method",
                "pdk --plugins target/release saliency IMAGE --driver {{driver}} --with {{name}}",
            ),
            What::Search => package(
                include_str!("../../../templates/search/lib.rs.txt"),
                "search strategy",
                "pdk --plugins target/release run search --set strategy={{name}} --set evaluations=100",
            ),
            What::Dataset => package(
                include_str!("../../../templates/dataset/lib.rs.txt"),
                "dataset reader",
                r#"pdk --plugins target/release run offline --set model=MODEL.onnx --set 'dataset={"name":"{{name}}","path":"DIR"}'"#,
            ),
            What::Adapter => Some(Crate {
                source: include_str!("../../../templates/adapter/lib.rs.txt"),
                readme: include_str!("../../../templates/adapter/README.md"),
                kind: "adapter",
                attempt: "",
            }),
            What::Pipeline | What::Network => None,
        }
    }
}
