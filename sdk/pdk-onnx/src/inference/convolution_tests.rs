//! Convolutions against their definition, on each kind of processor, where lanes are outputs and where they are places.

use super::Program;
use super::lanes::{Level, has_wide_lanes, limited, multiply_add};
use super::wide;
use crate::graph::Graph;
use crate::tensor::Tensor;
use crate::testing::Setting::{Float, Int, Ints};
use crate::testing::{Sketch, numbers};

/// Channels, height and width of an image; filters, channels, height and width of a kernel; strides, dilations, padding and groups.
type Case = ([usize; 3], [usize; 4], [usize; 2], [usize; 2], [usize; 4], usize);

const CASES: &[Case] = &[
    // The first two layers of DAVE-2, with fewer rows.
    ([3, 9, 200], [24, 3, 5, 5], [2, 2], [1, 1], [0; 4], 1),
    ([24, 7, 98], [36, 24, 5, 5], [2, 2], [1, 1], [0; 4], 1),
    // An odd width, with an even and an odd padding, and more behind than before.
    ([2, 8, 67], [9, 2, 3, 3], [2, 2], [1, 1], [1, 1, 0, 2], 1),
    ([2, 8, 66], [9, 2, 3, 4], [1, 2], [2, 2], [0, 2, 1, 3], 1),
    // Strides of one and three, groups, and rows of a single register.
    ([3, 5, 33], [9, 3, 3, 3], [1, 1], [1, 1], [1; 4], 1),
    ([2, 5, 100], [9, 2, 3, 3], [3, 3], [1, 1], [1; 4], 1),
    ([4, 6, 65], [18, 2, 2, 3], [2, 2], [1, 1], [0, 0, 0, 0], 2),
    ([3, 4, 16], [9, 3, 1, 1], [1, 1], [1, 1], [0; 4], 1),
    // Few outputs, with a stride of two.
    ([3, 6, 41], [5, 3, 3, 3], [2, 2], [1, 1], [1; 4], 1),
    // Registers that outputs fill, and narrow rows.
    ([3, 6, 50], [32, 3, 3, 3], [2, 2], [1, 1], [1; 4], 1),
    ([3, 9, 15], [36, 3, 3, 3], [1, 1], [1, 1], [1; 4], 1),
];

/// What the definition says, with zeros for what lies around the image.
fn defined(case: &Case, x: &[f32], w: &[f32], bias: &[f32], [rows, columns]: [usize; 2]) -> Vec<f32> {
    let &([channels, height, width], [filters, depth, kernel_h, kernel_w], strides, dilations, pads, group) =
        case;
    assert_eq!(channels, depth * group);
    let mut result = Vec::new();
    for filter in 0..filters {
        let first = filter / (filters / group) * depth;
        for place in 0..rows * columns {
            let mut sum = bias[filter];
            for tap in 0..depth * kernel_h * kernel_w {
                let (channel, ky, kx) =
                    (tap / (kernel_h * kernel_w), tap / kernel_w % kernel_h, tap % kernel_w);
                let at = |place: usize, axis: usize, k: usize| {
                    (place * strides[axis] + k * dilations[axis]).checked_sub(pads[axis])
                };
                let y = at(place / columns, 0, ky).filter(|y| *y < height);
                let x_at = at(place % columns, 1, kx).filter(|x| *x < width);
                let pixel =
                    y.zip(x_at).map_or(0.0, |(y, at)| x[((first + channel) * height + y) * width + at]);
                sum = multiply_add(pixel, w[filter * depth * kernel_h * kernel_w + tap], sum);
            }
            result.push(sum);
        }
    }
    result
}

#[test]
fn convolutions_are_those_of_the_definition_bit_for_bit_on_every_processor() {
    let mut with_wide_rows = 0;
    for (number, case) in CASES.iter().enumerate() {
        let &(image, kernel, strides, dilations, pads, group) = case;
        let sizes = [0, 1].map(|axis| {
            let reach = (kernel[axis + 2] - 1) * dilations[axis] + 1;
            (image[axis + 1] + pads[axis] + pads[axis + 2] - reach) / strides[axis] + 1
        });
        let draw = |seed: u64, count: usize| -> Vec<f64> {
            numbers(seed, count).iter().map(|value| f64::from(*value as f32)).collect()
        };
        let singles = |values: &[f64]| -> Vec<f32> { values.iter().map(|value| *value as f32).collect() };
        let x = draw(number as u64, image.iter().product());
        let (w, bias) = (draw(50, kernel.iter().product()), draw(51, kernel[0]));
        let expected = defined(case, &singles(&x), &singles(&w), &singles(&bias), sizes);
        with_wide_rows += usize::from(wide::is_faster(kernel[0] / group, sizes[1]));

        let mut s = Sketch::new(20);
        s.input("x", &[1, image[0], image[1], image[2]]);
        let weights = s.weights("w", Tensor::floats(&kernel, w));
        let bias = s.weights("b", Tensor::floats(&[kernel[0]], bias));
        let [strides, dilations] = [strides, dilations].map(|two| two.map(|value| value as i64));
        let pads = pads.map(|value| value as i64);
        let settings = [
            ("strides", Ints(&strides)),
            ("dilations", Ints(&dilations)),
            ("pads", Ints(&pads)),
            ("group", Int(group as i64)),
        ];
        s.node("Conv", &["x", &weights, &bias], "y", &settings);
        let graph = Graph::new(s.model(&["y"])).unwrap();
        for level in [Level::Portable, Level::Avx, Level::Avx512] {
            let found = limited(level, || {
                let mut program = Program::new(graph.clone()).unwrap();
                let mut outputs = [Vec::new()];
                program.run(&[singles(&x)], &mut outputs).unwrap();
                let [output] = outputs;
                output
            });
            let bits = |values: &[f32]| -> Vec<u32> { values.iter().map(|value| value.to_bits()).collect() };
            assert_eq!(bits(&found), bits(&expected), "{case:?}, {level:?}");
        }
    }
    assert_eq!(with_wide_rows, if has_wide_lanes() { 8 } else { 0 });
}

/// Channels, height and width of an image, and filters of a kernel: outputs as lanes, places as lanes, and places in wide registers.
const NOT_A_NUMBER: &[([usize; 3], usize)] = &[([3, 5, 6], 33), ([3, 6, 40], 2), ([3, 4, 66], 24)];

#[test]
fn relu_behind_a_convolution_or_a_product_keeps_what_is_not_a_number_on_every_processor() {
    let draw = |seed: u64, shape: &[usize]| Tensor::floats(shape, numbers(seed, shape.iter().product()));
    let mut graphs = Vec::new();
    for (image, filters) in NOT_A_NUMBER {
        let mut s = Sketch::new(20);
        s.input("x", &[1, image[0], image[1], image[2]]);
        let weights = s.weights("w", draw(1, &[*filters, image[0], 3, 3]));
        s.node("Conv", &["x", &weights], "sum", &[]);
        graphs.push((s, image.iter().product::<usize>()));
    }
    for (operator, rows) in [("MatMul", 2), ("MatMul", 5), ("Gemm", 5)] {
        let mut s = Sketch::new(20);
        s.input("x", &[rows, 30]);
        let weights = s.weights("w", draw(2, &[30, 37]));
        let settings: &[_] = if operator == "Gemm" { &[("alpha", Float(0.5))] } else { &[] };
        s.node(operator, &["x", &weights], "sum", settings);
        graphs.push((s, rows * 30));
    }
    for (number, (mut s, count)) in graphs.into_iter().enumerate() {
        s.node("Relu", &["sum"], "y", &[]);
        let mut x: Vec<f32> = numbers(3, count).iter().map(|value| *value as f32).collect();
        x[count / 2] = f32::NAN;
        let results = [Level::Portable, Level::Avx, Level::Avx512].map(|level| {
            let run = |outputs: &[&str]| {
                let mut program = Program::new(Graph::new(s.model(outputs)).unwrap()).unwrap();
                let mut results = vec![Vec::new(); outputs.len()];
                program.run(std::slice::from_ref(&x), &mut results).unwrap();
                results
            };
            limited(level, || [run(&["y"]), run(&["y", "sum"])])
        });
        for [together, apart] in results {
            let bits = |values: &[f32]| -> Vec<u32> { values.iter().map(|value| value.to_bits()).collect() };
            let cut = |sum: &f32| if *sum <= 0.0 { 0.0 } else { *sum };
            let expected: Vec<f32> = apart[1].iter().map(cut).collect();
            assert!(expected.iter().any(|value| value.is_nan()), "{number}");
            assert!(expected.contains(&0.0) && expected.iter().any(|value| *value > 0.0));
            assert_eq!(bits(&apart[0]), bits(&expected), "{number}");
            assert_eq!(bits(&together[0]), bits(&expected), "{number}");
        }
    }
}
