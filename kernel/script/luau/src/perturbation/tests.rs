use std::path::PathBuf;
use std::time::{Duration, Instant};

use pdk_sdk::describe::{Geometry, Parameter, Temporal};
use pdk_sdk::ops::{FrameBuf, blend, color, draw, gaussian, noise, point};
use pdk_sdk::seed;
use pdk_sdk::serde_json::{Map, json};

use super::*;
use crate::image::operations;
use crate::random::RANDOM;

pub(crate) const SCRIPT: &str = "scripts/foo.lua";

pub(crate) fn key() -> Key {
    seed::key(7, "foo", 0)
}

/// A picture in which every pixel differs from its neighbours.
pub(crate) fn picture(width: usize, height: usize) -> FrameBuf {
    let mut data = vec![0; width * height * 3];
    key().sequence().fill(&mut data);
    FrameBuf::from_vec(data, width, height).unwrap()
}

pub(crate) fn make(source: &str, given: pdk_sdk::serde_json::Value) -> Result<LuaPerturbation> {
    let limits = Limits { memory_bytes: 64 << 20, time: Duration::from_millis(500), ..Limits::default() };
    let description = Machine::new(limits)?.declare(SCRIPT, source.as_bytes(), "foo")?.description;
    let config = Config::check(&description, given.as_object().unwrap_or(&Map::new()))?;
    LuaPerturbation::new(SCRIPT, source.as_bytes(), "foo", config, limits)
}

pub(crate) fn body(apply: &str) -> String {
    format!("return {{ doc = 'Test',\napply = function(image, cx)\n{apply}\nend }}")
}

pub(crate) fn run(perturbation: &mut LuaPerturbation, src: &FrameBuf, cx: &Context<'_>) -> Result<FrameBuf> {
    let mut dst = FrameBuf::new(src.width(), src.height());
    perturbation.apply(src.as_ref(), dst.as_mut(), cx)?;
    Ok(dst)
}

fn apply(source: &str) -> Result<FrameBuf> {
    let mut perturbation = make(source, json!({}))?;
    run(&mut perturbation, &picture(20, 10), &Context::new(2.0, 3, 0.1, &key()))
}

pub(crate) fn apply_error(source: &str) -> String {
    apply(&body(source)).expect_err(source).to_string()
}

fn declaration_error(source: &str) -> String {
    let error = make(source, json!({})).err().unwrap_or_else(|| panic!("accepted: {source}")).to_string();
    error.strip_prefix("scripts/foo.lua: ").unwrap_or_else(|| panic!("{error}")).to_owned()
}

/// The beginning of the description of a perturbation in a script, which notes no source file.
fn described(name: &str, doc: &str) -> Description {
    Description { defined_in: String::new(), ..Description::perturbation(name, doc) }
}

#[test]
fn a_declaration_becomes_a_description() {
    let source = "return { name = 'fog_bank', doc = 'Fog', family = 'weather', source = 'Doe (2020)', version = 3,
        temporal = 'dynamic', default = false, apply = function() end, parameters = {
            { name = 'strength', levels = { 0, 1, 2, 3, 4.5 }, doc = 'How much', min = 0, max = 9, unit = 'm' },
            { name = 'size', default = 3, type = 'integer', min = 1, doc = 'Size' },
            { name = 'ratio', default = 3, doc = 'Ratio' },
            { name = 'soft', default = true, doc = 'Soft' },
            { name = 'edge', options = { 'round', 'square' }, default = 'square', doc = 'Edge' },
            { name = 'label', default = 'x', doc = 'Label' },
        } }";
    let description = make(source, json!({})).unwrap().description().clone();
    let mut edge = Parameter::choice("edge", &["round", "square"], "Edge");
    edge.default = "square".into();
    let mut label = Parameter::text("label", "Label");
    label.default = "x".into();
    let expected = described("fog_bank", "Fog")
        .family("weather")
        .source("Doe (2020)")
        .version(3)
        .dynamic()
        .not_default()
        .parameter(
            Parameter::by_level("strength", [0.0, 1.0, 2.0, 3.0, 4.5], "How much").range(0.0, 9.0).unit("m"),
        )
        .parameter(Parameter::integer("size", 3, "Size").range(1.0, i64::MAX as f64))
        .parameter(Parameter::number("ratio", 3.0, "Ratio"))
        .parameter(Parameter::boolean("soft", true, "Soft"))
        .parameter(edge)
        .parameter(label);
    assert_eq!(description, expected);
    let short = make("return { doc = 'Fog', apply = function() end }", json!({})).unwrap();
    assert_eq!(short.description(), &described("foo", "Fog"));
    assert_eq!(short.description().temporal, Temporal::Static);
}

#[test]
fn wrong_declarations_are_refused_with_the_field_and_the_remedy() {
    for (source, expected) in [
        (
            "return 1",
            "the script returns 1, but has to return a table, as in return { doc = \"...\", apply = function(image, cx) \
             ... end }",
        ),
        (
            "local x = 1",
            "the script returns nothing, but has to return a table, as in return { doc = \"...\", apply = \
             function(image, cx) ... end }",
        ),
        ("return { doc = 'x' }", "the perturbation has no `apply`; add apply = function(image, cx) ... end"),
        ("return { doc = 'x', apply = 1 }", "`apply` of the perturbation is 1, but has to be a function"),
        ("return { apply = print }", "the perturbation has no `doc`, which has to be a text"),
        ("return { doc = {}, apply = print }", "`doc` of the perturbation is a table, but has to be a text"),
        ("return { doc = 'a\\nb', apply = print }", "`doc` of the perturbation has to be one line of text"),
        (
            "return { doc = 'x', aply = print }",
            "the perturbation has an unknown field `aply`; did you mean `apply`?",
        ),
        (
            "return { doc = 'x', apply = print, speed = 1 }",
            "the perturbation has an unknown field `speed`; there are doc, apply, observe, actuate, mask, name, family, source, mathematics, \
             draws_per_sequence, draws_per_frame, history, divergence, grows_with, version, temporal, default, geometry, move_point, source_point, parameters",
        ),
        (
            "return { doc = 'x', apply = print, temporal = 'fast' }",
            "`temporal` of the perturbation is \"fast\", but has to be \"static\" or \"dynamic\"",
        ),
        (
            "return { doc = 'x', apply = print, name = 'Fog Bank' }",
            "the name of the perturbation: `Fog Bank` has to begin with a lower-case letter and consist of lower-case \
             letters, digits and underscores, 64 at most",
        ),
        (
            "return { doc = 'x', apply = print, version = 1.5 }",
            "`version` of the perturbation is 1.5, but has to be a whole number of at least 1",
        ),
        (
            "return { doc = 'x', apply = print, parameters = { strength = 1 } }",
            "`parameters` has to be a list, as in parameters = { { name = \"strength\", ... }, ... }",
        ),
        (
            "return { doc = 'x', apply = print, parameters = { 'strength' } }",
            "parameter 1 is \"strength\", but has to be a table, as in { name = \"strength\", doc = \"...\", default = \
             1 }",
        ),
    ] {
        assert_eq!(declaration_error(source), expected, "{source}");
    }
    for (parameter, expected) in [
        ("doc = 'x'", "parameter 1 has no `name`, which has to be a text"),
        ("name = 's', default = 1", "parameter `s` has no `doc`, which has to be a text"),
        ("name = 's', doc = 'x'", "parameter `s` needs a `default` or `levels`"),
        (
            "name = 's', doc = 'x', levels = { 1, 2 }",
            "`levels` of parameter `s` has to be a list of 5 numbers",
        ),
        (
            "name = 's', doc = 'x', levels = { 1, 2, 3, 4, 'x' }",
            "`levels` of parameter `s` has to be a list of 5 numbers",
        ),
        (
            "name = 's', doc = 'x', default = 1, levels = { 1, 2, 3, 4, 5 }",
            "parameter `s` has both `levels` and a `default`; keep one of the two",
        ),
        (
            "name = 's', doc = 'x', defualt = 1",
            "parameter `s` has an unknown field `defualt`; did you mean `default`?",
        ),
        (
            "name = 'time', doc = 'x', default = 1",
            "a parameter cannot be named `time`, because cx.time is taken; rename it",
        ),
        (
            "name = 'level', doc = 'x', default = 1",
            "a parameter cannot be named `level`, because in a pipeline `level` of a perturbation is something else; \
             rename it",
        ),
        (
            "name = 's', doc = 'x', default = 1, type = 'real'",
            "`type` of parameter `s` is \"real\", but has to be one of number, integer, boolean, choice, text",
        ),
        (
            "name = 's', doc = 'x', default = 'c', options = { 'a', 'b' }",
            "`default` of parameter `s` is \"c\", but has to be one of its `options`",
        ),
        (
            "name = 's', doc = 'x', default = 5, max = 4",
            "parameter `s`: the value 5 is not within its `min` and `max`",
        ),
        (
            "name = 's', doc = 'x', default = true, max = 4",
            "parameter `s`: only numbers have `min` and `max`",
        ),
    ] {
        let source = format!("return {{ doc = 'x', apply = print, parameters = {{ {{ {parameter} }} }} }}");
        assert_eq!(declaration_error(&source), expected, "{source}");
    }
    let twice = "local p = { name = 's', doc = 'x', default = 1 } return { doc = 'x', apply = print, parameters = { p, p } }";
    assert_eq!(declaration_error(twice), "there are two parameters named `s`");
    let hostile =
        "return setmetatable({ doc = 'x', apply = print }, { __index = error, __iter = error, __len = error,
        __pairs = error, __tostring = error, __metatable = 1 })";
    assert!(make(hostile, json!({})).is_ok());
}

#[test]
fn what_a_script_says_of_itself_reaches_the_description() {
    let source = "return { doc = 'Fog', mathematics = 'v + s', draws_per_sequence = 'where it is', draws_per_frame =
        'noise', divergence = { 'It is thicker.', 'It is grey.' }, grows_with = { s = { 1, 2, 3, 4, 5 }, soft = false },
        apply = function() end, parameters = {
            { name = 's', levels = { 2, 1, 3, 4, 5 }, doc = 'How much' }, { name = 'soft', default = true, doc = 'Soft' },
        } }";
    let description = make(source, json!({})).unwrap().description().clone();
    let expected = described("foo", "Fog")
        .mathematics("v + s")
        .drawn_per_sequence("where it is")
        .drawn_per_frame("noise")
        .divergence("It is thicker.")
        .divergence("It is grey.")
        .parameter(Parameter::by_level("s", [2.0, 1.0, 3.0, 4.0, 5.0], "How much"))
        .parameter(Parameter::boolean("soft", true, "Soft"))
        .grows_with(json!({ "s": [1.0, 2.0, 3.0, 4.0, 5.0], "soft": false }));
    assert_eq!(description, expected);
    let one = make("return { doc = 'x', divergence = 'It is grey.', apply = print }", json!({})).unwrap();
    assert_eq!(one.description().divergences, ["It is grey."]);

    for (fields, expected) in [
        ("mathematics = 3", "`mathematics` of the perturbation is 3, but has to be a text"),
        ("draws_per_frame = 'a\\nb'", "`draws_per_frame` of the perturbation has to be one line of text"),
        ("divergence = 3", "`divergence` of the perturbation is 3, but has to be a text or a list of texts"),
        ("divergence = { '' }", "`divergence` 1 of the perturbation has to be one line of text"),
        ("grows_with = { z = 1 }", "`grows_with` names no parameter with `z`; there is only s"),
        ("grows_with = { s = 9 }", "`grows_with`: perturbation `foo`: parameter `s` is 9.0, but has to be"),
        ("grows_with = { s = { 1 } }", "`s` in `grows_with` has to be a list of 5 numbers"),
        (
            "grows_with = { s = print }",
            "`s` in `grows_with` is a function, but has to be a value of that parameter",
        ),
    ] {
        let source = format!(
            "return {{ doc = 'x', apply = print, {fields},
            parameters = {{ {{ name = 's', doc = 'x', default = 1, max = 5 }} }} }}"
        );
        let error = declaration_error(&source);
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn a_broken_file_is_named() {
    let missing = Source::read(std::path::Path::new("no/such/file.lua")).err().unwrap().to_string();
    assert!(missing.starts_with("no/such/file.lua: "), "{missing}");
    assert_eq!(make("error('at once')", json!({})).err().unwrap().to_string(), "scripts/foo.lua:1: at once");
}

#[test]
fn the_context_has_all_that_a_plugin_sees() {
    let source = "return { doc = 'x', apply = function(image, cx)
        assert(cx.intensity == 1.5 and cx.frame_index == 3 and cx.time == 0.25)
        assert(cx.strength == 25 and cx.size == 4 and cx.soft == false and cx.edge == 'square' and cx.label == 'x')
        assert(image.width == 20 and image.height == 10 and buffer.len(image.pixels) == 600)
    end, parameters = {
        { name = 'strength', levels = { 0, 20, 30, 40, 50 }, doc = 'x' },
        { name = 'size', default = 3, type = 'integer', doc = 'x' },
        { name = 'soft', default = true, doc = 'x' },
        { name = 'edge', options = { 'round', 'square' }, doc = 'x' },
        { name = 'label', default = 'x', doc = 'x' },
    } }";
    let mut perturbation = make(source, json!({ "size": 4, "soft": false, "edge": "square" })).unwrap();
    let src = picture(20, 10);
    assert_eq!(run(&mut perturbation, &src, &Context::new(1.5, 3, 0.25, &key())).unwrap(), src);
    let mut fixed = make(
        &source.replace("cx.strength == 25", "cx.strength == 7"),
        json!({
            "strength": 7, "size": 4, "soft": false, "edge": "square"
        }),
    )
    .unwrap();
    run(&mut fixed, &src, &Context::new(1.5, 3, 0.25, &key())).unwrap();
}

#[test]
fn misuse_is_refused_with_the_line_and_the_remedy() {
    for (source, expected) in [
        (
            "return cx.strenght",
            "cx has no field `strenght`; there are intensity, frame_index, time, history, period, frame_random, sequence_random",
        ),
        ("return cx.intensty", "cx has no field `intensty`; did you mean `intensity`?"),
        (
            "cx.count = 1",
            "cx has no field `count` and gets none, because a frame must not depend on those before it; use a local variable",
        ),
        ("image.blur(3)", "`blur` is called with a dot; call it with a colon, as in image:blur(...)"),
        ("image:blur('x')", "image:blur needs `kernel_size` to be a number, but it is a string"),
        ("image:blur()", "image:blur needs `kernel_size` to be a number, but it is missing"),
        ("image:blur(0/0)", "image:blur needs `kernel_size` to be a finite number, but it is NaN"),
        ("image:blur(5000)", "image:blur needs `kernel_size` to be from 1 to 1023, but it is 5000"),
        ("image:blend(1, 0.5)", "image:blend needs `other` to be an image, but it is a number"),
        (
            "image:blend(image:resized(3, 4), 0.5)",
            "image:blend needs two images of the same size, but they have 20x10 and 3x4 pixels; use image:resized",
        ),
        ("image:lookup({})", "image:lookup needs `values` to be a buffer of 256 bytes, but it is a table"),
        (
            "image:lookup(buffer.create(3))",
            "image:lookup needs `values` to be a buffer of 256 bytes, but it has 3",
        ),
        ("image:circle(1, 2, 3, 4, 5)", "image:circle needs `blue` to be a number, but it is missing"),
        (
            "image:gaussian_noise(1, 2)",
            "image:gaussian_noise needs `random` to be a stream such as cx.frame_random, but it is a number",
        ),
        (
            "cx.frame_random:integer(1, 2.5)",
            "random:integer needs `high` to be a whole number, but it is 2.5",
        ),
        ("cx.frame_random:uniform(1)", "random:uniform needs `high` to be a number, but it is missing"),
        (
            "cx.frame_random:fill_unit(3)",
            "random:fill_unit needs `numbers` to be a buffer, but it is a number",
        ),
        (
            "cx.frame_random:fill_unit(buffer.create(9))",
            "random:fill_unit writes numbers of 8 bytes, but the buffer has 9 bytes; make it with buffer.create(8 * \
             count)",
        ),
    ] {
        assert_eq!(apply_error(source), format!("scripts/foo.lua:3: {expected}"), "{source}");
    }
    assert_eq!(
        apply_error("return 1"),
        "scripts/foo.lua: `apply` returns a number, but has to change `image` in place and return nothing"
    );
    for source in [
        "image.width = 3",
        "image:nothing()",
        "image.pixels = 1",
        "setmetatable(cx, {})",
        "getmetatable(image).__index = nil",
        "cx.frame_random.unit(1)",
        "cx.frame_random:uniform('x')",
        "image:resized(1e9, 1)",
        "local t = {} while true do t[#t + 1] = image:copy() end",
        "while true do end",
        "image:blend(image:copy())",
    ] {
        let error = apply_error(source);
        assert!(error.starts_with("scripts/foo.lua:3: "), "{error}");
    }
}

#[test]
fn an_instance_goes_on_after_an_error() {
    let source = body(
        "if cx.frame_index == 0 then while true do end end
        if cx.frame_index == 1 then return string.rep('x', 1e9) end
        if cx.frame_index == 2 then error('x') end
        image:fill(1, 2, 3)",
    );
    let mut perturbation = make(&source, json!({})).unwrap();
    let src = picture(20, 10);
    for index in [0, 1, 2, 3, 1, 0, 3] {
        let result = run(&mut perturbation, &src, &Context::new(0.0, index, 0.0, &key()));
        assert_eq!(result.is_ok(), index == 3, "{result:?}");
    }
}

/// The same work in Rust and in Lua, from the same key.
pub(crate) fn same(lua: &str, rust: impl Fn(&mut FrameBuf, &Context<'_>)) {
    let mut perturbation = make(&body(lua), json!({})).unwrap();
    for (width, height) in [(20, 10), (1, 1), (37, 23), (20, 10)] {
        let src = picture(width, height);
        for index in [0, 1, u64::from(u32::MAX)] {
            let key = key();
            let cx = Context::new(2.0, index, 0.5, &key);
            let mut expected = src.clone();
            rust(&mut expected, &cx);
            let found = run(&mut perturbation, &src, &cx).unwrap();
            assert_eq!(found.data(), expected.data(), "{width}x{height} frame {index}: {lua}");
        }
    }
}

#[test]
fn lua_and_rust_give_the_same_bytes() {
    same("image:grayscale()", |image, _| {
        let src = image.clone();
        color::grayscale(src.as_ref(), image.as_mut());
    });
    // A pixel loop, with random numbers drawn one by one and in bulk.
    let rust_noise = |image: &mut FrameBuf, cx: &Context<'_>| {
        let (mut random, shift) = (cx.frame_random(), cx.sequence_random().between(-20, 20));
        let gain = libm::exp(-0.3 * cx.time);
        for value in image.as_mut().contiguous_mut().unwrap() {
            let noisy = f64::from(*value) * gain + 25.0 * random.normal() + f64::from(shift);
            *value = (noisy.clamp(0.0, 255.0) + 0.5).floor().min(255.0) as u8;
        }
    };
    same(
        "local pixels, random, shift = image.pixels, cx.frame_random, cx.sequence_random:integer(-20, 20)
        local gain = math.exp(-0.3 * cx.time)
        for i = 0, buffer.len(pixels) - 1 do
            local noisy = buffer.readu8(pixels, i) * gain + 25 * random:normal() + shift
            buffer.writeu8(pixels, i, math.min(math.floor(math.clamp(noisy, 0, 255) + 0.5), 255))
        end",
        rust_noise,
    );
    same(
        "local pixels, shift = image.pixels, cx.sequence_random:integer(-20, 20)
        local normals = buffer.create(8 * buffer.len(pixels))
        cx.frame_random:fill_normal(normals)
        local gain = math.exp(-0.3 * cx.time)
        for i = 0, buffer.len(pixels) - 1 do
            local noisy = buffer.readu8(pixels, i) * gain + 25 * buffer.readf64(normals, 8 * i) + shift
            buffer.writeu8(pixels, i, math.min(math.floor(math.clamp(noisy, 0, 255) + 0.5), 255))
        end",
        rust_noise,
    );
    same("image:gaussian_noise(0.1, cx.frame_random)", |image, cx| {
        let src = image.clone();
        noise::gaussian_noise(src.as_ref(), image.as_mut(), 0.1, &mut cx.frame_random());
    });
    same("image:blur(7) image:brightness(1.3) image:contrast(0.7)", |image, _| {
        let mut other = image.clone();
        gaussian::gaussian_blur(image.as_ref(), other.as_mut(), 7, &mut gaussian::Workspace::default());
        point::scale_about(other.as_ref(), image.as_mut(), 0.0, 1.3);
        other.clone_from(image);
        point::scale_about(other.as_ref(), image.as_mut(), 127.5, 0.7);
    });
    same(
        "local other = image:copy() other:fill(10, 20.5, 300) image:blend(other, 0.25) image:blend(image, 0.9)
        other:copy_from(image) image:fill(0, 0, 0) image:copy_from(other)",
        |image, _| {
            let (src, mut other) = (image.clone(), image.clone());
            other.as_mut().data_mut().chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&[10, 20, 255]));
            blend::blend(src.as_ref(), 0.75, other.as_ref(), image.as_mut());
        },
    );
    same(
        "local values = buffer.create(256) for i = 0, 255 do buffer.writeu8(values, i, 255 - i) end
        image:lookup(values) image:circle(4.5, 3, 2.5, 1, 2, 3) image:rectangle(2, 1, 3, 5, 4, 5, 6)
        image:line(-3, 9, 18, -2, 7, 8, 9)",
        |image, _| {
            image.as_mut().data_mut().iter_mut().for_each(|value| *value = 255 - *value);
            draw::fill_circle(image.as_mut(), 4.5, 3.0, 2.5, [1, 2, 3]);
            draw::fill_rectangle(image.as_mut(), 2, 1, 3, 5, [4, 5, 6]);
            draw::draw_line(image.as_mut(), -3, 9, 18, -2, [7, 8, 9]);
        },
    );
}

#[test]
fn strides_and_changing_sizes_are_fine() {
    let mut perturbation = make(&body("image:fill(1, 2, 3)"), json!({})).unwrap();
    let data = [9u8; 64];
    let mut out = [0u8; 64];
    let src = Frame::with_stride(&data, 4, 3, 20).unwrap();
    let dst = FrameMut::with_stride(&mut out, 4, 3, 17).unwrap();
    perturbation.apply(src, dst, &Context::new(0.0, 0, 0.0, &key())).unwrap();
    assert_eq!(&out[..18], &[1, 2, 3, 1, 2, 3, 1, 2, 3, 1, 2, 3, 0, 0, 0, 0, 0, 1]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn large_images_fit_as_long_as_few_are_kept() {
    let limits = Limits { memory_bytes: 8 << 20, time: Duration::from_secs(10), ..Limits::default() };
    let make = |source: &str| {
        LuaPerturbation::new(SCRIPT, body(source).as_bytes(), "foo", Config::default(), limits).unwrap()
    };
    let mut copies = make("for i = 1, 300 do local copy = image:copy() copy:fill(i, 0, 0) end");
    let (large, small) = (FrameBuf::new(1000, 800), FrameBuf::new(10, 800));
    let key = key();
    let cx = Context::new(0.0, 0, 0.0, &key);
    for src in [&large, &small, &large, &small, &large] {
        assert_eq!(&run(&mut copies, src, &cx).unwrap(), src);
    }
    let mut keeps = make("local all = {} for i = 1, 300 do all[i] = image:copy() end");
    let error = run(&mut keeps, &large, &cx).unwrap_err().to_string();
    // Four images of 2.3 MiB do not count.
    assert!(error.starts_with("scripts/foo.lua:3: used more than 17.2 MiB of memory; keep less"), "{error}");
    // Frames much larger than the limit, and back to small ones.
    let huge = FrameBuf::new(4000, 3000);
    assert_eq!(run(&mut copies, &huge, &cx).unwrap(), huge);
    assert_eq!(run(&mut copies, &small, &cx).unwrap(), small);
    let mut hoards = make("all = all or {} if image.height > 1000 then all[1] = image:copy() end");
    run(&mut hoards, &huge, &cx).unwrap();
    let error = run(&mut hoards, &small, &cx).unwrap_err().to_string();
    assert!(error.starts_with("scripts/foo.lua: used more than 8.1 MiB of memory"), "{error}");
}

#[test]
fn large_frames_have_more_time_and_memory() {
    let limits = Limits { memory_bytes: 1000, time: Duration::from_secs(2), ..Limits::default() };
    assert_eq!(limits.for_frame(10, 10, 0), Limits { memory_bytes: 2200, ..limits });
    let large = limits.for_frame(2048, 1024, 0);
    assert_eq!(large, Limits { memory_bytes: 1000 + (24 << 20), time: Duration::from_secs(4), ..limits });
    let limits = Limits { time: Duration::MAX, ..limits };
    assert_eq!(limits.for_frame(usize::MAX, 9, 0).time, Duration::MAX);
}

/// Whatever a method is given, it works or refuses, and does not panic.
#[test]
fn random_arguments_are_accepted_or_refused() {
    const VALUES: &[&str] = &[
        "0",
        "1",
        "2",
        "-1",
        "0.5",
        "3.7",
        "7",
        "255",
        "1e3",
        "-1e3",
        "1e9",
        "-1e9",
        "2147483647",
        "-2147483648",
        "1e18",
        "-1e300",
        "1e308",
        "1/0",
        "-1/0",
        "0/0",
        "5e-324",
        "nil",
        "true",
        "'x'",
        "{}",
        "print",
        "image",
        "other",
        "image.pixels",
        "buffer.create(0)",
        "buffer.create(256)",
        "buffer.create(8)",
        "cx",
        "cx.frame_random",
        "image.blur",
        "{ 1, 0, 0, 0, 1, 0 }",
        "{ 0, 0, 20, 1, 18, 9, 1, 10 }",
        "'area'",
    ];
    let operations =
        operations().map(|operation| ("image", operation.name, operation.arguments.len() as u32));
    let draws = RANDOM.methods.iter().map(|method| ("cx.sequence_random", method.name, 2));
    let methods: Vec<_> = operations.chain(draws).collect();
    let mut random = key().sequence();
    let (mut accepted, mut refused) = (0, 0);
    for _ in 0..20 {
        let mut calls = String::new();
        for _ in 0..200 {
            let (object, method, count) = methods[random.below(methods.len() as u32) as usize];
            let mut arguments = vec![object];
            let count = if random.below(4) > 0 { count } else { random.below(9) };
            for _ in 0..count {
                // Mostly numbers, so that more than the check of types is tried, and streams, which often come last.
                if arguments.len() as u32 == count && random.below(3) == 0 {
                    arguments.push("cx.frame_random");
                    continue;
                }
                let among = if random.below(3) > 0 { 21 } else { VALUES.len() as u32 };
                arguments.push(VALUES[random.below(among) as usize]);
            }
            let arguments = arguments.join(", ");
            calls += &format!("function(image, cx, other) {object}.{method}({arguments}) end,\n");
        }
        let source = format!(
            "local calls = {{ {calls} }} return {{ doc = 'x', apply = function(image, cx)
            calls[cx.frame_index + 1](image, cx, image:resized(5, 9)) end }}"
        );
        let mut perturbation = make(&source, json!({})).unwrap();
        for index in 0..200 {
            match run(&mut perturbation, &picture(20, 10), &Context::new(2.0, index, 0.1, &key())) {
                Ok(_) => accepted += 1,
                Err(error) => {
                    let call = calls.lines().nth(index as usize).unwrap_or_default();
                    assert!(!error.to_string().contains("defect"), "{error}: {call}");
                    assert!(error.to_string().starts_with("scripts/foo.lua:"), "{error}: {call}");
                    refused += 1;
                }
            }
        }
    }
    assert!(accepted > 500 && refused > 500, "{accepted} accepted, {refused} refused");
}

#[test]
fn an_instance_can_move_between_threads() {
    fn sendable<T: Send>(value: T) -> T {
        value
    }
    let mut perturbation = sendable(make(&body("image:grayscale()"), json!({})).unwrap());
    let src = picture(20, 10);
    let here = run(&mut perturbation, &src, &Context::new(0.0, 0, 0.0, &key())).unwrap();
    let there = std::thread::spawn(move || {
        run(&mut perturbation, &picture(20, 10), &Context::new(0.0, 0, 0.0, &key())).unwrap()
    });
    assert_eq!(there.join().unwrap(), here);
}

/// The root of the repository.
fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).ancestors().nth(3).map(PathBuf::from).unwrap()
}

fn shipped() -> impl Iterator<Item = Source<'static>> {
    pdk_product::PRODUCT.perturbations.iter().map(|script| Source::of(Script::BuiltIn(script)).unwrap())
}

#[test]
fn shipped_perturbations_keep_their_promises() {
    for source in shipped() {
        let description = description(&source).unwrap();
        let config = Config::check(&description, &Map::new()).unwrap();
        let make = || open(&source, &config).unwrap();
        let (src, key) = (picture(64, 48), key());
        let apply = |perturbation: &mut dyn Perturbation, intensity, frame, key: &Key| {
            let mut dst = FrameBuf::new(64, 48);
            let cx = Context::new(intensity, frame, frame as f64 / 30.0, key);
            perturbation.apply(src.as_ref(), dst.as_mut(), &cx).unwrap();
            dst
        };
        for (width, height) in [(1, 1), (2, 5), (7, 1)] {
            let mut dst = FrameBuf::new(width, height);
            let cx = Context::new(4.0, 0, 0.0, &key);
            make().apply(self::picture(width, height).as_ref(), dst.as_mut(), &cx).unwrap();
        }
        let mut first = make();
        let late = apply(&mut first, 4.0, 10, &key);
        let early = apply(&mut first, 4.0, 0, &key);
        // Any frame can be computed on its own and again.
        assert_eq!(apply(&mut make(), 4.0, 10, &key), late, "{}", source.stem);
        assert_eq!(apply(&mut first, 4.0, 10, &key), late, "{}", source.stem);
        assert_eq!(early != late, description.temporal == Temporal::Dynamic, "{}", source.stem);
        assert_ne!(apply(&mut first, 4.0, 10, &seed::key(8, "foo", 0)), late, "{}", source.stem);
        // Stronger means further from the original.
        let distance = |intensity| {
            let frame = apply(&mut make(), intensity, 5, &key);
            src.data().iter().zip(frame.data()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>()
        };
        let distances: Vec<_> = (0..5).map(|level| distance(f64::from(level))).collect();
        assert!(distances[0] > 0 && distances.is_sorted(), "{}: {distances:?}", source.stem);
    }
}

/// Writes each shipped perturbation on a real picture to the folder `PDK_TEST_OUT`, to be looked at.
#[test]
fn shipped_perturbations_on_a_real_picture() {
    let data = std::env::var_os("PDK_TEST_DATA").map_or(root().join("../shared"), PathBuf::from);
    let Ok(picture) = image::open(data.join("data/road/solidWhiteCurve.jpg")) else {
        eprintln!(
            "skipped: there is no data/road/solidWhiteCurve.jpg in {}; set PDK_TEST_DATA",
            data.display()
        );
        return;
    };
    let picture = image::imageops::thumbnail(&picture.to_rgb8(), 480, 270);
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let src = FrameBuf::from_vec(picture.into_raw(), width, height).unwrap();
    for source in shipped() {
        let description = description(&source).unwrap();
        let mut perturbation = open(&source, &Config::check(&description, &Map::new()).unwrap()).unwrap();
        // Levels from left to right, frames from top to bottom.
        let mut sheet = image::RgbImage::new(3 * width as u32, 2 * height as u32);
        for (row, frame) in [0u64, 4].into_iter().enumerate() {
            for (column, level) in [0.0, 2.0, 4.0].into_iter().enumerate() {
                let mut dst = FrameBuf::new(width, height);
                let key = key();
                let cx = Context::new(level, frame, frame as f64 / 30.0, &key);
                perturbation.apply(src.as_ref(), dst.as_mut(), &cx).unwrap();
                assert_ne!(dst, src);
                let tile = image::RgbImage::from_raw(width as u32, height as u32, dst.into_vec()).unwrap();
                image::imageops::replace(&mut sheet, &tile, (column * width) as i64, (row * height) as i64);
            }
        }
        if let Some(folder) = std::env::var_os("PDK_TEST_OUT") {
            let file = PathBuf::from(folder).join(format!("{}.png", description.name));
            sheet.save(file).unwrap();
        }
    }
}

/// Prints what a frame of 320x240 and one of 1280x720 cost; run with `--ignored --nocapture` to see it.
#[test]
#[ignore = "a measurement, which checks nothing"]
fn the_cost_of_a_frame() {
    let frames = [(320, 240), (1280, 720)]
        .map(|(width, height)| (picture(width, height), FrameBuf::new(width, height)));
    let key = key();
    let loops = "local p = image.pixels for i = 0, buffer.len(p) - 1 do buffer.writeu8(p, i, 255 - buffer.readu8(p, i)) end";
    let draws = "local r = cx.frame_random for i = 1, 10000 do r:unit() end";
    let bulk = "local b = buffer.create(80000) cx.frame_random:fill_unit(b)";
    let sines = "local s = 0 for i = 1, 10000 do s += math.sin(i) end";
    let mut cases: Vec<(String, Box<dyn Perturbation>)> = Vec::new();
    for (name, source) in [
        ("empty", ""),
        ("every byte", loops),
        ("10000 draws", draws),
        ("10000 draws at once", bulk),
        ("10000 sines", sines),
    ] {
        cases.push((name.to_owned(), Box::new(make(&body(source), json!({})).unwrap())));
    }
    for source in shipped() {
        let config = Config::check(&description(&source).unwrap(), &Map::new()).unwrap();
        cases.push((source.stem.to_owned(), Box::new(open(&source, &config).unwrap())));
    }
    for (name, mut perturbation) in cases {
        for (src, mut dst) in frames.clone() {
            let mut times: Vec<_> = (0..60)
                .map(|frame| {
                    let start = Instant::now();
                    let cx = Context::new(2.0, frame, 0.0, &key);
                    perturbation.apply(src.as_ref(), dst.as_mut(), &cx).unwrap();
                    start.elapsed()
                })
                .collect();
            times.sort();
            eprintln!(
                "{name} at {}x{}: median {:?}, fastest {:?}",
                src.width(),
                src.height(),
                times[30],
                times[0]
            );
        }
    }
}

#[test]
fn a_script_says_where_points_go() {
    let source = "return { doc = 'Mirror', parameters = { { name = 'by', default = 3, doc = 'Shift' } },
        apply = function() end,
        move_point = function(x, y, width, height, cx) return width - 1 - x + cx.by, y end,
        source_point = function(x, y, width, height, cx) if y > 5 then return nil end return width - 1 - x + cx.by, y end }";
    let mut script = make(source, json!({"by": 0.5})).unwrap();
    assert_eq!(script.description().geometry, Geometry::Moved);
    let key = key();
    let cx = Context::new(2.0, 0, 0.0, &key);
    let mut points = [[0.0, 1.0], [4.25, 9.0]];
    script.move_points(&mut points, Way::ToPerturbed, [20, 10], &cx).unwrap();
    assert_eq!(points, [[19.5, 1.0], [15.25, 9.0]]);
    script.move_points(&mut points, Way::ToSource, [20, 10], &cx).unwrap();
    assert_eq!(points[0], [0.0, 1.0]);
    assert!(points[1][0].is_nan() && points[1][1].is_nan());

    let mut wrong = |script: &mut LuaPerturbation, way| {
        script.move_points(&mut points, way, [20, 10], &cx).unwrap_err().to_string()
    };
    let one_way = "return { doc = 'x', apply = function() end, move_point = function(x, y) return x end }";
    let mut one_way = make(one_way, json!({})).unwrap();
    let error = wrong(&mut one_way, Way::ToPerturbed);
    assert!(error.contains("`move_point`") && error.contains("it returns number and nil"), "{error}");
    assert!(wrong(&mut one_way, Way::ToSource).contains("add source_point = function"));
}

#[test]
fn what_a_script_says_of_its_geometry_is_checked() {
    let geometry = |fields: &str| {
        let source = format!("return {{ doc = 'x', apply = function() end, {fields} }}");
        make(&source, json!({})).map(|script| script.description().geometry)
    };
    assert_eq!(geometry("").unwrap(), Geometry::Undeclared);
    assert_eq!(geometry("geometry = 'kept'").unwrap(), Geometry::Kept);
    assert_eq!(geometry("geometry = 'altered'").unwrap(), Geometry::Altered);
    let wrong = |fields| geometry(fields).unwrap_err().to_string();
    assert!(wrong("geometry = 'moved'").contains("add move_point"));
    assert!(wrong("geometry = 'kept', move_point = function() end").contains("leave one out"));
    assert!(wrong("geometry = 'bent'").contains("\"kept\", \"moved\" or \"altered\""));
    assert!(wrong("source_point = function() end").contains("without `move_point`"));
    assert!(wrong("move_point = 3").contains("a function"));
}
