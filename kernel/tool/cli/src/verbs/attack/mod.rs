//! `pdk attack`: trains a picture that makes a driver steer elsewhere: on recorded frames, or by the derivative of recorded drives.

mod artwork;
mod drives;
mod frames;
mod training;

use clap::Subcommand;
use pdk_sdk::camera::Mounting;
use pdk_sdk::error::Result;

use super::Global;
use super::saliency::shown::Shown;
use crate::supervised::Memory;

/// Arguments of `pdk attack`
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    kind: Kind,
}

#[derive(Subcommand)]
enum Kind {
    /// Train a patch that lies on the road, on recorded frames
    Patch(Box<frames::Patch>),
    /// Train a change of the whole frame, on recorded frames
    Universal(Box<frames::Universal>),
    /// Train the picture that recorded drives show, by the derivative of the drives
    Drives(drives::Arguments),
}

/// Where the driver is to steer.
#[derive(Debug, Clone, Copy, PartialEq, clap::ValueEnum)]
enum Goal {
    Left,
    Right,
}

impl Goal {
    /// The side in the sign of steering and of errors: -1 is left.
    fn side(self) -> f64 {
        match self {
            Self::Left => -1.0,
            Self::Right => 1.0,
        }
    }

    /// As on the command line.
    fn text(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

impl Arguments {
    /// How much memory the verb may take.
    pub fn memory(&self) -> Memory {
        match &self.kind {
            Kind::Patch(patch) => patch.arguments.memory,
            Kind::Universal(universal) => universal.arguments.memory,
            Kind::Drives(arguments) => arguments.memory,
        }
    }
}

/// Trains a picture.
pub fn run(global: &Global, Arguments { kind }: &Arguments) -> Result<()> {
    match kind {
        Kind::Patch(arguments) => frames::patch(global, arguments),
        Kind::Universal(arguments) => frames::universal(global, arguments),
        Kind::Drives(arguments) => drives::run(global, arguments),
    }
}
