//! What a product made of this kernel consists of. The kernel knows none of it: the executable says it once, at its start.

use std::path::PathBuf;
use std::sync::OnceLock;

use crate::catalog::BUILT_IN;

/// The parts of a product besides the kernel.
#[derive(Debug)]
pub struct Product {
    /// The built-in plugins. Each has its components in a library `pdk_NAME`, which has to be there.
    pub plugins: &'static [&'static str],
    /// The built-in perturbations that are scripts.
    pub perturbations: &'static [BuiltInScript],
    /// The pipelines that can be run by their name.
    pub pipelines: &'static [BuiltInScript],
    /// The scales of levels that perturbations know by their name.
    pub scales: &'static [BuiltInScript],
    /// The suites that a gate knows by their name.
    pub suites: &'static [BuiltInScript],
    /// What perturbations and simulators stand for in an operational design domain, as a table in TOML.
    pub domain: &'static str,
    /// The modules that pipelines can require.
    pub modules: &'static [BuiltInScript],
    /// The pipeline that a user begins with.
    pub first_pipeline: &'static str,
    /// The examples in the help of the command line.
    pub examples: &'static [Examples],
    /// Components that a command may use to try a new one: what stands in braces in its place, and the component.
    pub samples: &'static [(&'static str, &'static str)],
}

/// A verb of the command line with commands that use it, each with what it does.
pub type Examples = (&'static str, &'static [(&'static str, &'static str)]);

/// A script that is part of the product.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuiltInScript {
    /// Its name.
    pub name: &'static str,
    /// Its file in the repository.
    pub file: &'static str,
    /// Its text.
    pub source: &'static str,
}

impl BuiltInScript {
    /// What stands where other scripts have a path: its name with a prefix.
    pub fn path(&self) -> PathBuf {
        PathBuf::from(format!("{BUILT_IN}{}", self.name))
    }
}

/// A kernel alone.
static NOTHING: Product = Product {
    plugins: &[],
    perturbations: &[],
    pipelines: &[],
    scales: &[],
    suites: &[],
    domain: "",
    modules: &[],
    first_pipeline: "",
    examples: &[],
    samples: &[],
};

static PRODUCT: OnceLock<&Product> = OnceLock::new();

/// Says what the product consists of. The first call counts.
pub fn set(product: &'static Product) {
    PRODUCT.get_or_init(|| product);
}

/// What the product consists of; nothing if no product was set, as in the tests of the kernel.
pub fn get() -> &'static Product {
    PRODUCT.get().copied().unwrap_or(&NOTHING)
}

impl Product {
    /// The files of the libraries of its plugins, without their folder.
    pub fn libraries(&self) -> impl Iterator<Item = String> {
        self.plugins
            .iter()
            .map(|name| format!("{}pdk_{name}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX))
    }
}
