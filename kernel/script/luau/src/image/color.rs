//! Colours and tones, and what compression and edge detection make of an image.

use pdk_sdk::ops::false_color::{Sums, false_color};
use pdk_sdk::ops::jpeg::ChannelOrder;
use pdk_sdk::ops::{canny, color, equalise, hsv, jpeg, point, posterize, white_balance};

use super::argument::Argument;
use super::operation::{Operation, Work};

const WEIGHT: Argument = Argument::number("weight", 0.0, 1.0, "share of the result; the default is 1");
/// The largest magnitude of a gradient.
const STEEPEST: f64 = 2040.0;

/// What changes each pixel by itself or looks at the whole image's tones.
pub const OPERATIONS: &[Operation] = &[
    Operation {
        name: "grayscale",
        doc: "Replaces each pixel by its grey, weighted as in ITU-R BT.601.",
        arguments: &[],
        work: Work::Change(|src, dst, _, _| color::grayscale(src, dst)),
    },
    Operation {
        name: "brightness",
        doc: "Multiplies each value by `factor`, rounded and clipped to 0 to 255.",
        arguments: &[Argument::finite("factor", "1 leaves the image as it is")],
        work: Work::Change(|src, dst, arguments, _| {
            point::scale_about(src, dst, 0.0, arguments.number("factor"));
        }),
    },
    Operation {
        name: "row_brightness",
        doc: "Multiplies each value of a row by `factor`, rounded half up and clipped to 0 to 255. A row that is not in the image changes nothing.",
        arguments: &[
            Argument::pixel("row", "the row, counted from 0 at the top"),
            Argument::finite("factor", "1 leaves the row as it is"),
        ],
        work: Work::Draw(|mut dst, arguments| {
            let (row, factor) = (arguments.pixel("row"), arguments.number("factor"));
            let Some(row) = usize::try_from(row).ok().and_then(|row| dst.rows_mut().nth(row)) else { return };
            point::scale_in_place(row, factor);
        }),
    },
    Operation {
        name: "contrast",
        doc: "Multiplies the distance of each value from middle grey, 127.5, by `factor`, rounded and clipped to 0 to 255.",
        arguments: &[Argument::finite("factor", "1 leaves the image as it is")],
        work: Work::Change(|src, dst, arguments, _| {
            point::scale_about(src, dst, 127.5, arguments.number("factor"));
        }),
    },
    Operation {
        name: "lookup",
        doc: "Replaces each value `v` by the byte at `v` in a buffer.",
        arguments: &[Argument::bytes("values", "256 bytes")],
        work: Work::Change(|src, dst, arguments, _| point::lookup(src, dst, arguments.bytes("values"))),
    },
    Operation {
        name: "saturation",
        doc: "Multiplies the saturation in 8-bit HSV by `factor`, clipped to 255, its fraction dropped.",
        arguments: &[Argument::number("factor", 0.0, 255.0, "1 leaves the image as it is but for rounding")],
        work: Work::Change(|src, dst, arguments, _| {
            hsv::scale_hsv(src, dst, arguments.number("factor"), 1.0);
        }),
    },
    Operation {
        name: "hue",
        doc: "Turns the hue in 8-bit HSV, which has steps of two degrees: 120 makes red green, green blue and blue red.",
        arguments: &[Argument::finite("degrees", "the angle on the circle of hues")],
        work: Work::Change(|src, dst, arguments, _| hsv::turn_hue(src, dst, arguments.number("degrees"))),
    },
    Operation {
        name: "posterize",
        doc: "Leaves this many tones of each channel, evenly spaced from 0 to 255.",
        arguments: &[Argument::number(
            "tones",
            2.0,
            256.0,
            "how many; a fraction makes the last step smaller",
        )],
        work: Work::Change(|src, dst, arguments, _| {
            let tones = arguments.number("tones");
            posterize::posterize(src, dst, tones, 255.0 / (tones - 1.0));
        }),
    },
    Operation {
        name: "equalise",
        doc: "Equalises the histogram of the brightness (the value in 8-bit HSV) in 8x8 tiles, under a limit of contrast \
              (CLAHE).",
        arguments: &[Argument::number(
            "limit",
            0.0,
            256.0,
            "largest share of a value in a tile, as a multiple of its share in a flat histogram",
        )],
        work: Work::Change(|src, dst, arguments, workspaces| {
            equalise::equalise_value(src, dst, arguments.number("limit"), &mut workspaces.equalise);
        }),
    },
    Operation {
        name: "white_balance",
        doc: "Mixes in a grey-world correction, which gives all three channels the same mean.",
        arguments: &[WEIGHT.optional()],
        work: Work::Change(|src, dst, arguments, _| {
            white_balance::blend_with_grey_world(src, dst, arguments.given("weight").unwrap_or(1.0));
        }),
    },
    Operation {
        name: "false_color",
        doc: "Gives false colours: 0 is green, blue, red; 1 is green, red, blue; 2 is blue, green, red; 3 is inverted; 4 is \
              the means of red and green, of green and blue, of blue and red. In between two of them are blended.",
        arguments: &[Argument::number("effect", 0.0, 4.0, "which")],
        work: Work::Change(|src, dst, arguments, _| {
            false_color(src, dst, arguments.number("effect"), Sums::Means);
        }),
    },
    Operation {
        name: "canny",
        doc: "Mixes in the edges after Canny, red on black.",
        arguments: &[
            Argument::number(
                "low",
                0.0,
                STEEPEST,
                "gradient (Sobel, |dx| + |dy|) above which a pixel continues an edge",
            ),
            Argument::number("high", 0.0, STEEPEST, "gradient above which a pixel starts an edge"),
            WEIGHT.optional(),
        ],
        work: Work::Change(|src, dst, arguments, workspaces| {
            let thresholds = (arguments.number("low"), arguments.number("high"));
            let weight = arguments.given("weight").unwrap_or(1.0);
            canny::blend_with_edges(src, dst, weight, thresholds, &mut workspaces.canny);
        }),
    },
    Operation {
        name: "jpeg",
        doc: "Compresses and decompresses the image as baseline JPEG with chroma at half the resolution.",
        arguments: &[Argument::number("quality", 1.0, 100.0, "as in the usual encoders; 100 is best")],
        work: Work::Change(|src, dst, arguments, workspaces| {
            jpeg::jpeg(src, dst, arguments.number("quality"), ChannelOrder::Rgb, &mut workspaces.jpeg);
        }),
    },
];
