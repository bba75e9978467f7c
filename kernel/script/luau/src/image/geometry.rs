//! What moves pixels: maps of the plane, elastic distortion, blocks.

use pdk_sdk::ops::elastic::{MAX_DISPLACEMENT, elastic};
use pdk_sdk::ops::perspective::{Perspective, warp_perspective};
use pdk_sdk::ops::resample;
use pdk_sdk::ops::warp::{Affine, warp_affine};

use super::argument::{Argument, pairs};
use super::operation::{Operation, Work};

/// What gives pixels another place.
pub const OPERATIONS: &[Operation] = &[
    Operation {
        name: "translate",
        doc: "Moves the image over black, interpolated linearly.",
        arguments: &[
            Argument::finite("right", "pixels to the right"),
            Argument::finite("down", "pixels down"),
        ],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let map = Affine::translation(arguments.number("right"), arguments.number("down"));
            warp_affine(src, dst, &map, &mut workspaces.warp);
        }),
    },
    Operation {
        name: "rotate",
        doc: "Turns the image counter-clockwise over black, interpolated linearly, about its middle or about (x, y).",
        arguments: &[
            Argument::finite("degrees", "the angle; a negative one turns clockwise"),
            Argument::finite("x", "what it turns about, from the left").optional(),
            Argument::finite("y", "what it turns about, from the top").optional(),
        ],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let middle = |length: usize| (length as f64 - 1.0) / 2.0;
            let x = arguments.given("x").unwrap_or(middle(src.width()));
            let y = arguments.given("y").unwrap_or(middle(src.height()));
            let map = Affine::rotation(arguments.number("degrees"), x, y);
            warp_affine(src, dst, &map, &mut workspaces.warp);
        }),
    },
    Operation {
        name: "shear",
        doc: "Moves each row to the right by `factor` times its distance from the first, over black.",
        arguments: &[Argument::finite("factor", "0 leaves the image as it is")],
        work: Work::Change(|src, dst, arguments, workspaces| {
            warp_affine(src, dst, &Affine::shear(arguments.number("factor")), &mut workspaces.warp);
        }),
    },
    Operation {
        name: "warp",
        doc: "Moves each pixel from (x, y) to (a x + b y + c, d x + e y + f) over black, interpolated linearly. A map that \
              leaves no area gives a black image.",
        arguments: &[Argument::numbers("map", 6, "{ a, b, c, d, e, f }")],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let [a, b, c, d, e, f, _, _] = arguments.numbers("map");
            warp_affine(src, dst, &Affine([a, b, c, d, e, f]), &mut workspaces.warp);
        }),
    },
    Operation {
        name: "perspective",
        doc: "Moves the four corners of the image to other places, over black, interpolated linearly: the image as a flat \
              picture that is seen from elsewhere.",
        arguments: &[Argument::corners(
            "corners",
            "{ x, y, x, y, x, y, x, y } of the upper left, upper right, lower right and lower left corner; those of the \
             image itself are { 0, 0, width, 0, width, height, 0, height }",
        )],
        work: Work::Change(|src, mut dst, arguments, workspaces| {
            let (width, height) = (src.width() as f64, src.height() as f64);
            match Perspective::of_corners(width, height, pairs(arguments.numbers("corners"))) {
                Some(map) => warp_perspective(src, dst, &map, &mut workspaces.perspective),
                // So thin that no area is left.
                None => dst.rows_mut().for_each(|row| row.fill(0)),
            }
        }),
    },
    Operation {
        name: "elastic",
        doc: "Takes each pixel from a random place nearby; displacements are smoothed with a Gaussian.",
        arguments: &[
            Argument::number(
                "alpha",
                0.0,
                MAX_DISPLACEMENT,
                "largest displacement before smoothing, in pixels",
            ),
            Argument::number(
                "sigma",
                0.1,
                20.0,
                "standard deviation of the Gaussian in pixels; the larger, the less is left of the displacements",
            ),
            Argument::random(),
        ],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let (alpha, sigma) = (arguments.number("alpha"), arguments.number("sigma"));
            elastic(src, dst, alpha, sigma, arguments.random(), &mut workspaces.elastic);
        }),
    },
    Operation {
        name: "pixelate",
        doc: "Shrinks the image to the means of areas and enlarges it again by repeating pixels: blocks.",
        arguments: &[Argument::number(
            "factor",
            0.001,
            1.0,
            "of width and height, which are rounded down to whole pixels",
        )],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let factor = arguments.number("factor");
            let scaled = |length: usize| ((length as f64 * factor) as usize).max(1);
            let small = &mut workspaces.small;
            small.resize(scaled(src.width()), scaled(src.height()));
            resample::resize_area(src, small.as_mut(), &mut workspaces.resample);
            resample::resize_nearest(small.as_ref(), dst);
        }),
    },
];
