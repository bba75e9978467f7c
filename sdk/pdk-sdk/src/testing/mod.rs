//! The test kit: what every component has to hold, whatever it does. `pdk check` runs it on a finished plugin; an author
//! runs the same in unit tests:
//!
//! ```
//! # use pdk_sdk::prelude::*;
//! # struct Mirror;
//! # impl Component for Mirror {
//! #     fn description() -> Description { Description::perturbation("mirror", "Mirrors the frame") }
//! #     fn new(_: &Config) -> Result<Self> { Ok(Mirror) }
//! # }
//! # impl Perturbation for Mirror {
//! #     fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, _: &Context<'_>) -> Result<()> {
//! #         dst.copy_from(src);
//! #         Ok(())
//! #     }
//! # }
//! // In a test:
//! pdk_sdk::testing::perturbation::<Mirror>();
//! ```

pub(crate) mod sample;
pub(crate) mod signals;
mod trial;

use pdk_abi::each_kind;
use serde_json::{Map, Value};

use crate::abi::host::Instance;
use crate::component::Component;
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, Result};
use crate::kinds::Kind;
pub use sample::{Make, even_frame, sample_frame};
pub use trial::Trial;

macro_rules! on_kinds {
    ($($(#[$does:meta])* $kind:ident $name:ident $plural:ident: $table:ident $table_ref:ident, $one:literal, $several:literal;)*) => {
        $(
            #[doc = concat!("Runs [`check`](crate::", stringify!($name), "::check) on a type, in a test.")]
            ///
            /// # Panics
            /// If a check fails, with its sentence.
            pub fn $name<T: Component + crate::kinds::$name::$kind + 'static>() {
                let description = T::description();
                for_each_config(&description, |config| {
                    crate::kinds::$name::check(&description, config, &mut |config| Ok(Box::new(T::new(config)?)))
                });
            }
        )*

        /// Checks an instance of any kind: see `check` of its module, such as [`perturbation::check`](crate::perturbation::check).
        ///
        /// # Errors
        /// The first check that fails.
        pub fn check(
            description: &Description,
            config: &Config,
            make: &mut dyn FnMut(&Config) -> Result<Instance>,
        ) -> Result<()> {
            match description.kind {
                $(Kind::$kind => crate::kinds::$name::check(description, config, &mut |config| match make(config)? {
                    Instance::$kind(instance) => Ok(instance),
                    _ => Err(Error::new("the instance is of another kind than described")),
                }),)*
            }
        }
    };
}

each_kind!(on_kinds);

fn for_each_config(description: &Description, mut check: impl FnMut(&Config) -> Result<()>) {
    for config in configs(description) {
        if let Err(error) = config.and_then(|config| check(&config)) {
            panic!("{}: {error}", description.name);
        }
    }
}

/// The parameter values that a component is checked with: its examples, or its defaults where it has none.
pub fn configs(description: &Description) -> Vec<Result<Config>> {
    let defaults = Map::new();
    let examples: Vec<&Map<String, Value>> = match description.examples.is_empty() {
        true => vec![&defaults],
        false => description.examples.iter().collect(),
    };
    examples.into_iter().map(|example| Config::check(description, example)).collect()
}

#[cfg(test)]
mod tests {
    use pdk_ops::{Frame, FrameMut};

    use super::*;
    use crate::kinds::driver::Control;
    use crate::kinds::perturbation::{self, Context, Perturbation};
    use crate::kinds::simulator::{self, Camera, Scenario, Simulator, State};

    /// Breaks one rule, as told.
    struct Rogue(&'static str, u8);

    impl Perturbation for Rogue {
        fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, _: &Context<'_>) -> Result<()> {
            let width = src.width();
            for y in 0..src.height() {
                match self.0 {
                    "leaves a pixel" => {
                        dst.row_mut(y)[3.min(width * 3)..].copy_from_slice(&src.row(y)[3.min(width * 3)..])
                    }
                    _ => dst.row_mut(y).copy_from_slice(src.row(y)),
                }
            }
            match self.0 {
                "remembers" => {
                    self.1 += 1;
                    dst.row_mut(0)[0] = self.1;
                }
                "ignores the stride" => {
                    let len = (width * 3 * src.height()).min(dst.data().len());
                    dst.data_mut()[..len].fill(1);
                }
                _ => {}
            }
            Ok(())
        }
    }

    fn check(rule: &'static str) -> Result<()> {
        let description = Description::perturbation("rogue", "Breaks a rule");
        let mut make = |_: &Config| Ok(Box::new(Rogue(rule, 0)) as Box<dyn Perturbation>);
        perturbation::check(&description, &Config::default(), &mut make)
    }

    #[test]
    fn every_broken_rule_is_found() {
        assert!(check("keeps them all").is_ok());
        assert!(check("remembers").unwrap_err().to_string().contains("alone and after others"));
        assert!(check("leaves a pixel").unwrap_err().to_string().contains("has to be written"));
        assert!(check("ignores the stride").unwrap_err().to_string().contains("stride"));
    }

    /// A vehicle that moves a metre a step; breaks one rule, as told.
    struct Road(&'static str, State);

    impl Simulator for Road {
        fn camera(&self) -> Camera {
            Camera { width: 4, height: 3, rate: 20.0 }
        }

        fn reset(&mut self, _: &Scenario, _: u32) -> Result<State> {
            self.1 = State::default();
            Ok(if self.0 == "starts elsewhere" { State { speed: 1.0, ..self.1 } } else { self.1 })
        }

        fn frame(&mut self, mut into: FrameMut<'_>) -> Result<State> {
            into.rows_mut().for_each(|row| row.fill(7));
            Ok(if self.0 == "loses itself" { State { heading: f64::NAN, ..self.1 } } else { self.1 })
        }

        fn act(&mut self, _: Control) -> Result<State> {
            let before = self.1;
            self.1.time += if self.0 == "stands still" { 0.0 } else { 0.05 };
            Ok(if self.0 == "lags" { before } else { self.1 })
        }
    }

    #[test]
    fn every_broken_rule_of_a_simulator_is_found() {
        let check = |rule| {
            let mut make = |_: &Config| Ok(Box::new(Road(rule, State::default())) as Box<dyn Simulator>);
            let description = Description::simulator("road", "A road");
            simulator::check(&description, &Config::default(), &mut make).map_err(|error| error.to_string())
        };
        assert_eq!(check("keeps them all"), Ok(()));
        assert!(check("lags").unwrap_err().contains("not the one that act returned"));
        assert!(check("starts elsewhere").unwrap_err().contains("not the one that reset returned"));
        assert!(check("loses itself").unwrap_err().contains("its heading is NaN rad, but has to be from"));
        assert!(check("stands still").unwrap_err().contains("its time advances from 0.0 to 0.0 s"));
    }
}
