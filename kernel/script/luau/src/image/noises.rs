//! Noise. What is drawn for each value or pixel by itself comes from a stream that the script names.

use pdk_sdk::ops::noise::{self, Impulses};
use pdk_sdk::ops::{phase, poisson};

use super::argument::Argument;
use super::operation::{Operation, Work};

/// What adds or draws random values.
pub const OPERATIONS: &[Operation] = &[
    Operation {
        name: "gaussian_noise",
        doc: "Adds noise from the normal distribution to each value.",
        arguments: &[
            Argument::number(
                "sigma",
                0.0,
                100.0,
                "its standard deviation as a fraction of the range of values",
            ),
            Argument::random(),
        ],
        work: Work::Change(|src, dst, arguments, _| {
            let sigma = arguments.number("sigma");
            noise::gaussian_noise(src, dst, sigma, arguments.random());
        }),
    },
    Operation {
        name: "speckle_noise",
        doc: "Multiplies each value by a normal number with mean 1.",
        arguments: &[Argument::number("sigma", 0.0, 100.0, "its standard deviation"), Argument::random()],
        work: Work::Change(|src, dst, arguments, _| {
            let sigma = arguments.number("sigma");
            noise::speckle_noise(src, dst, sigma, arguments.random());
        }),
    },
    Operation {
        name: "poisson_noise",
        doc: "Replaces each value by a random photon count around it.",
        arguments: &[
            Argument::number("photons", 1.0, poisson::MAX_COUNT, "how many a white pixel counts on average"),
            Argument::random(),
        ],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let count = arguments.number("photons");
            let table = workspaces.poisson.get_or_insert_with(|| poisson::PoissonTable::new(count));
            table.set_count(count);
            poisson::poisson_noise(src, dst, table, arguments.random());
        }),
    },
    Operation {
        name: "impulse_noise",
        doc: "Makes random pixels white and as many black (salt and pepper).",
        arguments: &[
            Argument::number(
                "fraction",
                0.0,
                1.0,
                "share of the image that is drawn; a pixel may be drawn twice",
            ),
            Argument::random(),
        ],
        work: Work::Change(|src, dst, arguments, _| {
            let fraction = arguments.number("fraction");
            noise::impulse_noise(src, dst, fraction, Impulses::WholePixels, arguments.random());
        }),
    },
    Operation {
        name: "scramble_phase",
        doc: "Adds random angles of up to `strength` times 180 degrees to the phases of each channel's Fourier transform.",
        arguments: &[
            Argument::number("strength", 0.0, 1.0, "0 leaves the image as it is"),
            Argument::random(),
        ],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let strength = arguments.number("strength");
            phase::scramble_phase(src, dst, strength, arguments.random(), &mut workspaces.phase);
        }),
    },
];
