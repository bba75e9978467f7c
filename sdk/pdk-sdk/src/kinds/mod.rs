//! The kinds of component, a file each: the trait that authors implement, how its calls cross the boundary on both sides, and what the test
//! kit asks of its components.
//!
//! To add a kind, write its line and its table in `pdk-abi/src/functions.rs`, its file here, and its module below.

pub mod dataset;
pub mod driver;
pub mod mask;
pub mod perturbation;
pub mod predictor;
pub mod saliency;
pub mod search;
pub mod simulator;

use pdk_abi::each_kind;
use serde::{Deserialize, Serialize};

macro_rules! kinds {
    ($($(#[$does:meta])* $kind:ident $name:ident $plural:ident: $table:ident $table_ref:ident, $one:literal, $several:literal;)*) => {
        /// The kinds of component.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Kind {
            $($(#[$does])* $kind,)*
        }

        impl Kind {
            /// All kinds, in the order in which they are listed.
            pub const ALL: [Kind; [$(stringify!($kind)),*].len()] = [$(Kind::$kind),*];

            /// The name as it is written in lists and on the command line.
            pub fn name(self) -> &'static str {
                match self {
                    $(Kind::$kind => stringify!($name),)*
                }
            }

            /// A number of components of the kind, such as "6 simulators".
            pub fn counted(self, count: usize) -> String {
                let (one, several) = match self {
                    $(Kind::$kind => ($one, $several),)*
                };
                format!("{count} {}", if count == 1 { one } else { several })
            }
        }
    };
}

each_kind!(kinds);

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

macro_rules! traits {
    ($($(#[$does:meta])* $kind:ident $name:ident $plural:ident: $table:ident $table_ref:ident, $one:literal, $several:literal;)*) => {
        $(pub use super::$name::$kind;)*
    };
}

/// The trait of each kind, and what its functions take and return.
pub(crate) mod traits {
    pub use super::dataset::{Entry, Position};
    pub use super::driver::{Control, DriveContext};
    pub use super::perturbation::{Context, EarlierMaps, Way};
    pub use super::predictor::Output;
    pub use super::saliency::{HeatmapMut, MapContext};
    pub use super::search::{Candidate, Evaluated, Problem, Range, Space, Variable};
    pub use super::simulator::{Annotations, Camera, SavedNumber, Scenario, State};

    super::each_kind!(traits);
}
