//! Shapes, copies and mixtures.

use pdk_sdk::ops::{blend, draw, mask, resample, resize};

use super::argument::{Argument, LARGEST_SIDE};
use super::operation::{Operation, Work};

const RED: Argument = Argument::shade("red");
const GREEN: Argument = Argument::shade("green");
const BLUE: Argument = Argument::shade("blue");
const WIDTH: Argument = Argument::number("width", 1.0, LARGEST_SIDE, "width in pixels");
const HEIGHT: Argument = Argument::number("height", 1.0, LARGEST_SIDE, "height in pixels");
const MASK: Argument = Argument::mask("mask", "an image of any size, stretched over this one");

/// New images, and what is drawn on or mixed into one.
pub const OPERATIONS: &[Operation] = &[
    Operation {
        name: "copy",
        doc: "A new image with the same pixels.",
        arguments: &[],
        work: Work::Make(|src, mut dst, _, _| dst.copy_from(src)),
    },
    Operation {
        name: "blank",
        doc: "A new black image, as large as this one if no size is given.",
        arguments: &[WIDTH.optional(), HEIGHT.optional()],
        // New images are black.
        work: Work::Make(|_, _, _, _| {}),
    },
    Operation {
        name: "resized",
        doc: "A new image of another size. \"linear\" interpolates between the nearest pixels, \"nearest\" repeats or \
              leaves out pixels, \"area\" takes the mean of the area that a pixel covers.",
        arguments: &[
            WIDTH,
            HEIGHT,
            Argument::choice("method", &["linear", "nearest", "area"], "how; the default is \"linear\""),
        ],
        work: Work::Make(|src, dst, arguments, workspaces| match arguments.choice("method") {
            0 => resize::resize_linear(src, dst),
            1 => resample::resize_nearest(src, dst),
            _ => resample::resize_area(src, dst, &mut workspaces.resample),
        }),
    },
    Operation {
        name: "fill",
        doc: "Gives all pixels one colour.",
        arguments: &[RED, GREEN, BLUE],
        work: Work::Draw(|mut dst, arguments| {
            let rgb = arguments.rgb();
            for row in dst.rows_mut() {
                row.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&rgb));
            }
        }),
    },
    Operation {
        name: "copy_from",
        doc: "Takes over the pixels of another image of the same size.",
        arguments: &[Argument::image("other", "where they are taken from")],
        work: Work::Draw(|mut dst, arguments| {
            if let Some(other) = arguments.other("other") {
                dst.copy_from(other);
            }
        }),
    },
    Operation {
        name: "circle",
        doc: "Draws a filled circle: all pixels whose distance from (x, y) is at most the radius.",
        arguments: &[
            Argument::finite("x", "its middle, from the left"),
            Argument::finite("y", "its middle, from the top"),
            Argument::finite("radius", "its radius in pixels"),
            RED,
            GREEN,
            BLUE,
        ],
        work: Work::Draw(|dst, arguments| {
            let [x, y, radius] = ["x", "y", "radius"].map(|name| arguments.number(name));
            draw::fill_circle(dst, x, y, radius, arguments.rgb());
        }),
    },
    Operation {
        name: "rectangle",
        doc: "Draws a filled rectangle; place and size are rounded to whole pixels.",
        arguments: &[
            Argument::pixel("x", "its first column"),
            Argument::pixel("y", "its first row"),
            Argument::pixel("width", "its width; if it is not positive, nothing is drawn"),
            Argument::pixel("height", "its height; if it is not positive, nothing is drawn"),
            RED,
            GREEN,
            BLUE,
        ],
        work: Work::Draw(|dst, arguments| {
            let [x, y, width, height] = ["x", "y", "width", "height"].map(|name| arguments.pixel(name));
            draw::fill_rectangle(dst, x, y, width, height, arguments.rgb());
        }),
    },
    Operation {
        name: "line",
        doc: "Draws a line one pixel wide, both ends included, between the pixels that the coordinates round to.",
        arguments: &[
            Argument::pixel("x0", "one end, from the left"),
            Argument::pixel("y0", "one end, from the top"),
            Argument::pixel("x1", "the other end, from the left"),
            Argument::pixel("y1", "the other end, from the top"),
            RED,
            GREEN,
            BLUE,
        ],
        work: Work::Draw(|dst, arguments| {
            let [x0, y0, x1, y1] = ["x0", "y0", "x1", "y1"].map(|name| arguments.pixel(name));
            draw::draw_line(dst, x0, y0, x1, y1, arguments.rgb());
        }),
    },
    Operation {
        name: "blend",
        doc: "Mixes in another image of the same size: `1 - weight` of this one and `weight` of the other.",
        arguments: &[
            Argument::image("other", "what is mixed in"),
            Argument::number("weight", 0.0, 1.0, "its share"),
        ],
        work: Work::Change(|src, dst, arguments, _| {
            let other = arguments.other("other").unwrap_or(src);
            blend::blend(src, 1.0 - arguments.number("weight"), other, dst);
        }),
    },
    Operation {
        name: "blend_through",
        doc: "Mixes in another image of the same size where a mask says so, value by value: black leaves this image as it \
              is, white puts the other one in its place.",
        arguments: &[Argument::image("other", "what is mixed in"), MASK],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let (mask, _) = workspaces.mask_for(src, arguments.other("mask").unwrap_or(src));
            mask::blend_through(src, arguments.other("other").unwrap_or(src), mask, dst);
        }),
    },
    Operation {
        name: "tint",
        doc: "Mixes in a colour where a mask says so, value by value: black leaves the image as it is, white puts the \
              colour in its place.",
        arguments: &[RED, GREEN, BLUE, MASK],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let (mask, row) = workspaces.mask_for(src, arguments.other("mask").unwrap_or(src));
            mask::tint(src, arguments.rgb(), mask, dst, row);
        }),
    },
];
