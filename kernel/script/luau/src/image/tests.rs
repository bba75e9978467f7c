//! Every operation against the kernel that it stands for, and what it refuses.

use pdk_sdk::ops::elastic::elastic;
use pdk_sdk::ops::false_color::{Sums, false_color};
use pdk_sdk::ops::jpeg::ChannelOrder;
use pdk_sdk::ops::noise::Impulses;
use pdk_sdk::ops::perspective::{Perspective, warp_perspective};
use pdk_sdk::ops::poisson::PoissonTable;
use pdk_sdk::ops::warp::{Affine, warp_affine};
use pdk_sdk::ops::zoom::{Enlargement, zoom_blur};
use pdk_sdk::ops::{
    Frame, FrameBuf, FrameMut, average, blend, canny, color, draw, equalise, gaussian, hsv, jpeg, low_pass,
    mask, noise, phase, point, poisson, posterize, resample, resize, scatter, sharpen, unsharp,
    white_balance,
};
use pdk_sdk::perturbation::Context;
use pdk_sdk::seed::{Key, Random};

use super::operations;
use crate::limits::Limits;
use crate::perturbation::LuaPerturbation;
use crate::perturbation::tests::{apply_error, body, key, make as make_perturbation, picture, run, same};

/// What a case does in Rust: from the frame, with the random numbers of the frame.
type Kernel = fn(Frame<'_>, FrameMut<'_>, &mut Random);

/// A second image that a script can make: the frame in other colours.
fn other(src: Frame<'_>) -> FrameBuf {
    let mut other = src.to_buf();
    point::scale_about(src, other.as_mut(), 127.5, -1.0);
    other
}

/// What `other` is in a script.
const OTHER: &str = "local other = image:copy() other:contrast(-1)";

/// Calls of every operation, each with what it has to do.
fn cases() -> Vec<(&'static str, Kernel)> {
    vec![
        ("local copy = image:copy() image:fill(1, 2, 3) image:copy_from(copy)", |src, mut dst, _| {
            dst.copy_from(src)
        }),
        ("image:copy_from(image)", |src, mut dst, _| dst.copy_from(src)),
        ("image:copy_from(image:blank())", |_, mut dst, _| dst.rows_mut().for_each(|row| row.fill(0))),
        ("local b = image:blank(3, 2) assert(b.width == 3 and b.height == 2)", |src, mut dst, _| {
            dst.copy_from(src)
        }),
        ("image:copy_from(image:resized(5, 3):resized(image.width, image.height))", |src, dst, _| {
            let mut small = FrameBuf::new(5, 3);
            resize::resize_linear(src, small.as_mut());
            resize::resize_linear(small.as_ref(), dst);
        }),
        (
            "image:copy_from(image:resized(5, 3, 'area'):resized(image.width, image.height, 'nearest'))",
            |src, dst, _| {
                let mut small = FrameBuf::new(5, 3);
                resample::resize_area(src, small.as_mut(), &mut resample::Workspace::default());
                resample::resize_nearest(small.as_ref(), dst);
            },
        ),
        ("image:fill(3, 300, 7.5)", |_, mut dst, _| {
            dst.rows_mut()
                .flat_map(|row| row.chunks_exact_mut(3))
                .for_each(|p| p.copy_from_slice(&[3, 255, 8]));
        }),
        ("image:circle(4.5, 3, 2.5, 1, 2, 3)", |src, mut dst, _| {
            dst.copy_from(src);
            draw::fill_circle(dst, 4.5, 3.0, 2.5, [1, 2, 3]);
        }),
        ("image:rectangle(2, 1.4, 3, 4.6, 4, 5, 6)", |src, mut dst, _| {
            dst.copy_from(src);
            draw::fill_rectangle(dst, 2, 1, 3, 5, [4, 5, 6]);
        }),
        ("image:line(-3, 9, 18, -2, 7, 8, 9)", |src, mut dst, _| {
            dst.copy_from(src);
            draw::draw_line(dst, -3, 9, 18, -2, [7, 8, 9]);
        }),
        ("image:blend(other, 0.25) image:blend(image, 0.9)", |src, dst, _| {
            blend::blend(src, 0.75, other(src).as_ref(), dst);
        }),
        ("image:blend_through(other, image)", |src, dst, _| {
            mask::blend_through(src, other(src).as_ref(), src, dst);
        }),
        ("image:blend_through(other, other:resized(4, 2, 'nearest'))", |src, dst, _| {
            let (other, mut small, mut large) = (other(src), FrameBuf::new(4, 2), src.to_buf());
            resample::resize_nearest(other.as_ref(), small.as_mut());
            resize::resize_linear(small.as_ref(), large.as_mut());
            mask::blend_through(src, other.as_ref(), large.as_ref(), dst);
        }),
        ("image:tint(250, 120, 30, other)", |src, dst, _| {
            mask::tint(src, [250, 120, 30], other(src).as_ref(), dst, &mut Vec::new());
        }),
        ("image:grayscale()", |src, dst, _| color::grayscale(src, dst)),
        ("image:brightness(1.3)", |src, dst, _| point::scale_about(src, dst, 0.0, 1.3)),
        (
            "image:row_brightness(1, 1.7) image:row_brightness(2, 0.4) image:row_brightness(-1, 0)",
            |src, mut dst, _| {
                dst.copy_from(src);
                for (row, factor) in [(1, 1.7), (2, 0.4)] {
                    let Some(row) = dst.rows_mut().nth(row) else { continue };
                    row.iter_mut().for_each(|value| {
                        *value = (f64::from(*value) * factor + 0.5).floor().min(255.0) as u8
                    });
                }
            },
        ),
        ("image:contrast(0.7)", |src, dst, _| point::scale_about(src, dst, 127.5, 0.7)),
        (
            "local b = buffer.create(256) for i = 0, 255 do buffer.writeu8(b, i, 255 - i) end image:lookup(b)",
            |src, dst, _| {
                point::lookup(src, dst, &std::array::from_fn(|v| 255 - v as u8));
            },
        ),
        ("image:saturation(1.5)", |src, dst, _| hsv::scale_hsv(src, dst, 1.5, 1.0)),
        ("image:hue(-75)", |src, dst, _| hsv::turn_hue(src, dst, -75.0)),
        ("image:posterize(5)", |src, dst, _| posterize::posterize(src, dst, 5.0, 63.75)),
        ("image:equalise(3)", |src, dst, _| {
            equalise::equalise_value(src, dst, 3.0, &mut equalise::Workspace::default());
        }),
        ("image:white_balance(0.4)", |src, dst, _| white_balance::blend_with_grey_world(src, dst, 0.4)),
        ("image:white_balance()", |src, dst, _| white_balance::blend_with_grey_world(src, dst, 1.0)),
        ("image:false_color(3.5)", |src, dst, _| false_color(src, dst, 3.5, Sums::Means)),
        ("image:canny(100, 300, 0.3)", |src, dst, _| {
            canny::blend_with_edges(src, dst, 0.3, (100.0, 300.0), &mut canny::Workspace::default());
        }),
        ("image:canny(100, 300)", |src, dst, _| {
            canny::blend_with_edges(src, dst, 1.0, (100.0, 300.0), &mut canny::Workspace::default());
        }),
        ("image:jpeg(12)", |src, dst, _| {
            jpeg::jpeg(src, dst, 12.0, ChannelOrder::Rgb, &mut jpeg::Workspace::default());
        }),
        ("image:blur(7)", |src, dst, _| {
            gaussian::gaussian_blur(src, dst, 7, &mut gaussian::Workspace::default());
        }),
        ("image:low_pass(5)", |src, dst, _| {
            low_pass::low_pass(src, dst, 5, &mut low_pass::Workspace::default())
        }),
        ("image:defocus_blur(2.5)", |src, dst, _| {
            average::disc_blur(src, dst, 2.5, &mut average::Workspace::default());
        }),
        ("image:motion_blur(6, -2.5)", |src, dst, _| {
            average::line_blur(src, dst, 6.0, -2.5, &mut average::Workspace::default());
        }),
        ("image:zoom_blur(3.5, 0.05)", |src, dst, _| {
            let mut workspace = pdk_sdk::ops::zoom::Workspace::default();
            zoom_blur(src, dst, 3.5, 0.05, Enlargement::Exact, &mut workspace);
        }),
        ("image:glass_blur(2.5, random)", |src, dst, random| {
            let mut key = Key([0; 32]);
            random.fill(&mut key.0);
            scatter::scatter(src, dst, 2.5, key, &mut scatter::Workspace::default());
        }),
        ("image:sharpen(0.25)", |src, dst, _| {
            sharpen::sharpen(src, dst, 1.0, 0.75, &mut sharpen::Workspace::default());
        }),
        ("image:unsharp_mask(9)", |src, dst, _| {
            unsharp::unsharp_mask(src, dst, 9, &mut unsharp::Workspace::default());
        }),
        ("image:translate(2.25, -1)", |src, dst, _| {
            warp_affine(src, dst, &Affine::translation(2.25, -1.0), &mut Default::default());
        }),
        ("image:rotate(30)", |src, dst, _| {
            let (x, y) = ((src.width() as f64 - 1.0) / 2.0, (src.height() as f64 - 1.0) / 2.0);
            warp_affine(src, dst, &Affine::rotation(30.0, x, y), &mut Default::default());
        }),
        ("image:rotate(-10, 3, 4.5)", |src, dst, _| {
            warp_affine(src, dst, &Affine::rotation(-10.0, 3.0, 4.5), &mut Default::default());
        }),
        ("image:shear(0.3)", |src, dst, _| {
            warp_affine(src, dst, &Affine::shear(0.3), &mut Default::default())
        }),
        ("image:warp({ 1.1, 0.2, -3, 0.1, 0.9, 2 })", |src, dst, _| {
            warp_affine(src, dst, &Affine([1.1, 0.2, -3.0, 0.1, 0.9, 2.0]), &mut Default::default());
        }),
        (
            "local w, h = image.width, image.height image:perspective({ w / 8, h / 16, w, 0, w * 0.75, h, -w / 4, h * 1.25 })",
            |src, dst, _| {
                let (w, h) = (src.width() as f64, src.height() as f64);
                let corners = [[w / 8.0, h / 16.0], [w, 0.0], [w * 0.75, h], [-w / 4.0, h * 1.25]];
                let map = Perspective::of_corners(w, h, corners).unwrap();
                warp_perspective(src, dst, &map, &mut Default::default());
            },
        ),
        ("image:elastic(3, 1.5, random)", |src, dst, random| {
            elastic(src, dst, 3.0, 1.5, random, &mut Default::default());
        }),
        ("image:pixelate(0.3)", |src, dst, _| {
            let scaled = |length: usize| ((length as f64 * 0.3) as usize).max(1);
            let mut small = FrameBuf::new(scaled(src.width()), scaled(src.height()));
            resample::resize_area(src, small.as_mut(), &mut resample::Workspace::default());
            resample::resize_nearest(small.as_ref(), dst);
        }),
        ("image:gaussian_noise(0.1, random)", |src, dst, random| {
            noise::gaussian_noise(src, dst, 0.1, random)
        }),
        ("image:speckle_noise(0.2, random)", |src, dst, random| noise::speckle_noise(src, dst, 0.2, random)),
        ("image:poisson_noise(40, random)", |src, dst, random| {
            poisson::poisson_noise(src, dst, &PoissonTable::new(40.0), random);
        }),
        ("image:impulse_noise(0.1, random)", |src, dst, random| {
            noise::impulse_noise(src, dst, 0.1, Impulses::WholePixels, random);
        }),
        ("image:scramble_phase(0.3, random)", |src, dst, random| {
            phase::scramble_phase(src, dst, 0.3, random, &mut phase::Workspace::default());
        }),
    ]
}

#[test]
fn every_operation_does_what_its_kernel_does() {
    for (call, kernel) in cases() {
        let rust = |image: &mut FrameBuf, cx: &Context<'_>| {
            let src = image.clone();
            kernel(src.as_ref(), image.as_mut(), &mut cx.frame_random());
        };
        same(&format!("{OTHER} local random = cx.frame_random {call}"), rust);
    }
}

#[test]
fn every_operation_is_tried() {
    let cases = cases();
    for operation in operations() {
        let call = format!("image:{}(", operation.name);
        assert!(cases.iter().any(|(source, _)| source.contains(&call)), "{call}");
    }
}

/// Two operations draw different numbers from one stream, and a stream goes on where the last one ended.
#[test]
fn operations_share_a_stream() {
    same(
        "image:gaussian_noise(0.1, cx.frame_random) image:gaussian_noise(0.1, cx.frame_random)",
        |image, cx| {
            let (mut random, mut src) = (cx.frame_random(), image.clone());
            noise::gaussian_noise(src.as_ref(), image.as_mut(), 0.1, &mut random);
            src.clone_from(image);
            noise::gaussian_noise(src.as_ref(), image.as_mut(), 0.1, &mut random);
        },
    );
}

#[test]
fn errors_name_the_operation_the_argument_and_what_is_allowed() {
    for (source, expected) in [
        ("image:defocus_blur(200)", "image:defocus_blur needs `radius` to be from 0 to 128, but it is 200"),
        ("image:jpeg(0)", "image:jpeg needs `quality` to be from 1 to 100, but it is 0"),
        ("image:motion_blur(3)", "image:motion_blur needs `down` to be a number, but it is missing"),
        ("image:hue('red')", "image:hue needs `degrees` to be a number, but it is a string"),
        (
            "image:elastic(3, 1)",
            "image:elastic needs `random` to be a stream such as cx.frame_random, but it is missing",
        ),
        ("image:tint(1, 2, 3, 4)", "image:tint needs `mask` to be an image, but it is a number"),
        (
            "image:blend_through(image:blank(2, 2), image)",
            "image:blend_through needs two images of the same size, but they have 20x10 and 2x2 pixels; use image:resized",
        ),
        ("image:warp({ 1, 2 })", "image:warp needs `map` to be a list of 6 numbers, but it has 2"),
        ("image:warp(1)", "image:warp needs `map` to be a list of 6 numbers, but it is a number"),
        (
            "image:warp({ 1, 2, 3, 4, 5, 'x' })",
            "image:warp needs `map[6]` to be a number, but it is a string",
        ),
        (
            "image:perspective({ 0, 0, 1, 1, 9, 0, 0, 9 })",
            "image:perspective needs `corners` to be the upper left, upper right, lower right and lower left corner of a \
             convex quadrilateral, { x, y, x, y, x, y, x, y }",
        ),
        (
            "image:resized(3, 3, 'cubic')",
            "image:resized needs `method` to be one of linear, nearest, area, but it is \"cubic\"",
        ),
        (
            "image:resized(3, 3, 1)",
            "image:resized needs `method` to be one of linear, nearest, area, but it is a number",
        ),
        ("image:resized(3)", "image:resized needs `height` to be a number, but it is missing"),
        ("image:blank(0)", "image:blank needs `width` to be from 1 to 16384, but it is 0"),
        ("image:blur(3, 4)", "image:blur takes (kernel_size), but is given more: 2 in all"),
        ("image:grayscale(0.5)", "image:grayscale takes (), but is given more: 1 in all"),
        ("image.rotate(3)", "`rotate` is called with a dot; call it with a colon, as in image:rotate(...)"),
    ] {
        assert_eq!(apply_error(source), format!("scripts/foo.lua:3: {expected}"), "{source}");
    }
}

#[test]
fn types_and_documentation_come_from_the_table() {
    let of = |name: &str| operations().find(|operation| operation.name == name).unwrap();
    assert_eq!(
        of("resized").signature(),
        "(width: number, height: number, method: (\"linear\" | \"nearest\" | \"area\")?) -> Image"
    );
    assert_eq!(of("elastic").signature(), "(alpha: number, sigma: number, random: Random) -> ()");
    assert_eq!(of("warp").signature(), "(map: { number }) -> ()");
    assert_eq!(of("defocus_blur").paragraphs()[1], "@param radius -- radius of the disc in pixels, 0 to 128");
    for operation in operations() {
        assert!(operation.doc.ends_with('.'), "{}", operation.name);
        assert!(
            operation.arguments.iter().all(|a| !a.doc.is_empty() && !a.doc.ends_with('.')),
            "{}",
            operation.name
        );
    }
}

/// The longest operations on the largest image, which stay near the time that a script has.
#[test]
#[ignore = "long: .ci/run runs it"]
fn no_operation_goes_far_beyond_the_limit() {
    let make = "local large = image:blank(2048, 2048)";
    for call in [
        "large:blur(1023)",
        "large:low_pass(1023)",
        "large:zoom_blur(128, 0.0001)",
        "large:defocus_blur(128)",
        "large:motion_blur(256, 256)",
        "large:elastic(1000, 20, cx.frame_random)",
        "large:scramble_phase(1, cx.frame_random)",
        "large:poisson_noise(700, cx.frame_random)",
        "large:canny(0, 0)",
        "large:circle(0, 0, 1e300, 1, 2, 3)",
        "large:line(-1e300, -1e300, 1e300, 1e299, 1, 2, 3)",
        "large:resized(2048, 2048, 'area')",
        "cx.frame_random:fill_normal(buffer.create(1.5e8))",
    ] {
        let start = crate::watchdog::own_time();
        let mut perturbation =
            make_perturbation(&body(&format!("{make} {call}")), Default::default()).unwrap();
        let result = run(&mut perturbation, &picture(20, 10), &Context::new(2.0, 3, 0.1, &key()));
        let took = std::time::Duration::from_nanos(crate::watchdog::own_time() - start);
        assert!(took < std::time::Duration::from_secs(5), "{took:?}: {call}: {result:?}");
    }
}

#[test]
fn images_that_are_too_large_are_refused() {
    assert_eq!(
        apply_error("image:blank(4096, 2048)"),
        "scripts/foo.lua:3: image:blank makes an image of 4096x2048 pixels, but 4194304 pixels are allowed: 4 megapixels, or 4 \
         times the frame; make it smaller"
    );
    assert!(apply_error("image:zoom_blur(129, 0.1)").ends_with("to be from 0 to 128, but it is 129"));
    // Four times a large frame.
    let limits = Limits { memory_bytes: 1 << 30, ..Limits::default() };
    let source = body("image:resized(2 * image.width, 2 * image.height) image:copy()");
    let mut twice =
        LuaPerturbation::new("foo.lua", source.as_bytes(), "foo", Default::default(), limits).unwrap();
    let cx_key = key();
    run(&mut twice, &FrameBuf::new(2000, 1500), &Context::new(2.0, 3, 0.1, &cx_key)).unwrap();
}
