//! Blurs and what undoes them.

use pdk_sdk::ops::zoom::{Enlargement, MAX_STEP, zoom_blur};
use pdk_sdk::ops::{average, gaussian, low_pass, scatter, sharpen, unsharp};
use pdk_sdk::seed::Key;

use super::argument::Argument;
use super::operation::{Operation, Work};

/// A kernel's width; the largest is that of the largest blur.
const KERNEL_SIZE: Argument = Argument::number(
    "kernel_size",
    1.0,
    1023.0,
    "width of the kernel in pixels; an even one counts as the next odd one",
);

/// More would take longer than a script has, on a frame as large as it may be.
const MOST_ENLARGEMENTS: f64 = 128.0;

/// What makes an image less sharp, or sharper.
pub const OPERATIONS: &[Operation] = &[
    Operation {
        name: "blur",
        doc: "Gaussian blur. The standard deviation is 0.3 * ((kernel_size - 1) / 2 - 1) + 0.8 pixels.",
        arguments: &[KERNEL_SIZE],
        work: Work::Change(|src, dst, arguments, workspaces| {
            gaussian::gaussian_blur(
                src,
                dst,
                arguments.number("kernel_size") as usize,
                &mut workspaces.gaussian,
            );
        }),
    },
    Operation {
        name: "low_pass",
        doc: "Gaussian blur of the brightness (the value in 8-bit HSV) alone: hue and saturation stay sharp.",
        arguments: &[KERNEL_SIZE],
        work: Work::Change(|src, dst, arguments, workspaces| {
            low_pass::low_pass(src, dst, arguments.number("kernel_size") as usize, &mut workspaces.low_pass);
        }),
    },
    Operation {
        name: "defocus_blur",
        doc: "Replaces each pixel by the mean of the disc around it, as a lens out of focus does.",
        arguments: &[Argument::number("radius", 0.0, average::MAX_RADIUS, "radius of the disc in pixels")],
        work: Work::Change(|src, dst, arguments, workspaces| {
            average::disc_blur(src, dst, arguments.number("radius"), &mut workspaces.average);
        }),
    },
    Operation {
        name: "motion_blur",
        doc: "Replaces each pixel by the mean along the way that it moves, its own place in the middle.",
        arguments: &[
            Argument::number(
                "right",
                -average::MAX_LINE,
                average::MAX_LINE,
                "pixels that it moves to the right",
            ),
            Argument::number("down", -average::MAX_LINE, average::MAX_LINE, "pixels that it moves down"),
        ],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let (right, down) = (arguments.number("right"), arguments.number("down"));
            average::line_blur(src, dst, right, down, &mut workspaces.average);
        }),
    },
    Operation {
        name: "zoom_blur",
        doc: "The mean of the image and of its enlargements by 1, 1 + step, 1 + 2 step and so on about the middle.",
        arguments: &[
            Argument::number(
                "count",
                0.0,
                MOST_ENLARGEMENTS,
                "how many enlargements; a fraction is the weight of the last",
            ),
            Argument::number("step", 0.0, MAX_STEP, "difference between the factors of one and the next"),
        ],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let (count, step) = (arguments.number("count"), arguments.number("step"));
            zoom_blur(src, dst, count, step, Enlargement::Exact, &mut workspaces.zoom);
        }),
    },
    Operation {
        name: "glass_blur",
        doc: "Gives each pixel the colour of a random one nearby, as frosted glass does.",
        arguments: &[
            Argument::number("distance", 0.0, 1000.0, "how far away it may be in each direction, in pixels"),
            Argument::random(),
        ],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let distance = arguments.number("distance");
            let mut key = Key([0; 32]);
            arguments.random().fill(&mut key.0);
            scatter::scatter(src, dst, distance, key, &mut workspaces.scatter);
        }),
    },
    Operation {
        name: "sharpen",
        doc: "Sharpens with the 3x3 Laplacian (eight neighbours): adds to each pixel `amount` times its difference from its neighbours.",
        arguments: &[Argument::number("amount", 0.0, 1.0, "0 leaves the image as it is")],
        work: Work::Change(|src, dst, arguments, workspaces| {
            // The kernel sums to 1 and so keeps the brightness.
            sharpen::sharpen(src, dst, 1.0, 1.0 - arguments.number("amount"), &mut workspaces.sharpen);
        }),
    },
    Operation {
        name: "unsharp_mask",
        doc: "Twice the image less its Gaussian blur: edges and small parts stand out.",
        arguments: &[Argument::number(
            "kernel_size",
            1.0,
            301.0,
            "width of the blur's kernel in pixels; an even one counts as the next odd one",
        )],
        work: Work::Change(|src, dst, arguments, workspaces| {
            unsharp::unsharp_mask(
                src,
                dst,
                arguments.number("kernel_size") as usize,
                &mut workspaces.unsharp,
            );
        }),
    },
];
