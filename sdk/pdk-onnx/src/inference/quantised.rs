//! Convolutions and products of matrices of 8-bit integers: `QLinearConv`, `ConvInteger`, `QLinearMatMul` and `MatMulInteger`.
//!
//! Zero points are taken off first, which leaves integers of at most 9 bits. Two of them are a factor of [`integers`](super::integers). Their
//! sums are exact, and become 8-bit integers or floats by one multiplication.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Constants, Operation, WHOLE, single, singles};
use super::convolution::Convolution;
use super::integers::paired;
use super::lanes::{Lanes, Work, dispatch_wide};
use super::matrix::Matrices;
use super::quantisation::Range;
use crate::operators::matmul;
use crate::site::Site;
use crate::tensor::{Element, Tensor, elements};

/// Whether the sum of this many products and any of these terms fits 32 bits, whatever the factors.
fn fits(products: usize, terms: &[i32]) -> bool {
    let most = terms.iter().map(|term| u64::from(term.unsigned_abs())).max().unwrap_or(0);
    (products as u64).saturating_mul(255 * 255).saturating_add(most) <= i32::MAX as u64
}

/// A convolution or a product of matrices.
pub struct Quantised {
    sums: Sums,
    left: Left,
    right: Option<Right>,
    finish: Finish,
    /// The factors of the left side, of the right one if it is computed, and the sums; and how many there are while the graph runs.
    pairs: Vec<i32>,
    right_pairs: Vec<i32>,
    results: Vec<i32>,
    counts: [usize; 3],
}

enum Sums {
    Convolution(Convolution<i32>),
    Matrices(Matrices<i32>),
}

/// The left side: an image, or the left matrices.
pub struct Left {
    /// The number of channels whose sum is computed, or of columns.
    pub depth: usize,
    /// The elements of a channel; 1 for matrices.
    pub plane: usize,
    /// The number of elements.
    pub count: usize,
    pub zero: Zero,
}

/// A zero point.
#[derive(Debug, Clone, Copy)]
pub enum Zero {
    Known(f32),
    /// The input that has it.
    Input(usize),
}

/// Right matrices that are computed.
pub struct Right {
    /// The input.
    pub place: usize,
    pub zero: f32,
    pub rows: usize,
    pub columns: usize,
}

/// What becomes of sums.
pub struct Finish {
    pub to: To,
    /// The factor of each channel or column; a single one is for all.
    pub factors: Vec<f32>,
    /// What is added to the product with the factor, if anything is.
    pub terms: Vec<f32>,
    /// How many neighbouring sums share a factor: the elements of a channel, or 1 for columns.
    pub length: usize,
}

/// What they become.
#[derive(Debug, Clone, Copy)]
pub enum To {
    /// 32-bit integers. There are no factors.
    Sums,
    /// Integers of a range.
    Range(Range),
    /// Floats.
    Floats,
}

impl Quantised {
    /// A convolution with constant weights, as the node at the site has it, of an image with a kernel: filters, channels, and places. `zeros` has
    /// a number for each filter, or one. Nothing if a sum has too many products.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn convolution(
        site: &Site<'_>,
        image: &[usize],
        kernel: &Tensor,
        zeros: &[f32],
        bias: &[i32],
        zero: Zero,
        finish: Finish,
    ) -> Result<Option<Self>> {
        let &[filters, depth, ..] = kernel.shape.as_slice() else { return Ok(None) };
        let places = elements(&kernel.shape[2..])?;
        if !fits(depth.saturating_mul(places), bias) {
            return Ok(None);
        }
        let halved = depth.div_ceil(2);
        let mut convolution = Convolution::over(site, image, &kernel.shape, halved)?;
        let mut weights = vec![0; elements(&[filters, halved, places])?];
        let values = singles(kernel);
        let rows = weights.chunks_mut((halved * places).max(1));
        for (filter, (into, from)) in rows.zip(values.chunks((depth * places).max(1))).enumerate() {
            let zero = zeros[if zeros.len() == 1 { 0 } else { filter }];
            Pairs { from, zero, depth, plane: places, into }.compute();
        }
        convolution.pack(&weights, bias);
        let plane = image[2..].iter().product();
        let left = Left { depth, plane, count: elements(image)?, zero };
        Self::new(Sums::Convolution(convolution), left, None, finish).map(Some)
    }

    /// Products of stacks of matrices. The right ones are constant, with a zero point for each column or one for all, or computed. Nothing if
    /// a sum has too many products.
    ///
    /// # Errors
    /// If they do not go together.
    pub fn matrices(
        [left, right]: [&[usize]; 2],
        constant: Option<(&Tensor, &[f32])>,
        computed: (usize, f32),
        bias: &[i32],
        zero: Zero,
        finish: Finish,
    ) -> Result<Option<Self>> {
        let [mut a, mut b] = matmul::matrices(left, right)?;
        let (depth, columns) = (a[a.len() - 1], b[b.len() - 1]);
        if !fits(depth, bias) || depth == 0 {
            return Ok(None);
        }
        let (left_count, right_count) = (elements(&a)?, elements(&b)?);
        let halved = depth.div_ceil(2);
        let (last, row) = (a.len() - 1, b.len() - 2);
        (a[last], b[row]) = (halved, halved);
        let mut matrices = Matrices::stacks(&a, &b)?.starting_with(bias);
        let mut right = Right { place: computed.0, zero: computed.1, rows: depth, columns };
        if let Some((tensor, zeros)) = constant {
            let mut values = singles(tensor);
            let centred = values.iter_mut().zip(zeros.iter().cycle());
            centred.for_each(|(value, zero)| *value -= zero);
            right.zero = 0.0;
            let mut pairs = Vec::new();
            right.pair(&values, &mut pairs);
            matrices.pack(&pairs);
        }
        let mut quantised = Self::new(
            Sums::Matrices(matrices),
            Left { depth, plane: 1, count: left_count, zero },
            constant.is_none().then_some(right),
            finish,
        )?;
        if constant.is_none() {
            quantised.counts[1] = elements(&[right_count / depth, halved])?;
        }
        Ok(Some(quantised))
    }

    fn new(sums: Sums, left: Left, right: Option<Right>, finish: Finish) -> Result<Self> {
        // A channel or row of an odd number of elements has half a factor more.
        let groups = left.count / (left.depth * left.plane).max(1);
        let pairs = elements(&[groups, left.depth.div_ceil(2), left.plane])?;
        let results = match &sums {
            Sums::Convolution(convolution) => convolution.results(),
            Sums::Matrices(matrices) => matrices.results(),
        };
        let counts = [pairs, 0, results];
        let (pairs, right_pairs, results) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { sums, left, right, finish, pairs, right_pairs, results, counts })
    }

    /// The node of one of the operators, if its factors, zero points and weights are constant as far as they have to be.
    ///
    /// # Errors
    /// If it contradicts itself.
    pub fn of(site: &Site<'_>, constants: &Constants) -> Result<Option<Self>> {
        let is_convolution = matches!(site.node.op_type.as_str(), "QLinearConv" | "ConvInteger");
        let (places, is_scaled) = match site.node.op_type.as_str() {
            // The right side, and the zero points of the left and of the right one.
            "ConvInteger" | "MatMulInteger" => ([1, 2, 3], false),
            "QLinearConv" | "QLinearMatMul" => ([3, 2, 5], true),
            _ => return Ok(None),
        };
        let [right, left_zero, right_zero] = places;
        let known = |place: usize| constants.get(place).and_then(Option::as_deref);
        let one = |place: usize| match known(place) {
            Some(tensor) if tensor.values.len() == 1 => Some(tensor.values[0] as f32),
            _ => None,
        };
        let (element, right_element) = (site.fact(0)?.element, site.fact(right)?.element);
        let zero = match (site.optional(left_zero), one(left_zero)) {
            (None, _) => Zero::Known(0.0),
            (_, Some(zero)) if are_of(element, &[zero]) => Zero::Known(zero),
            (Some(_), None) => {
                let fact = site.fact(left_zero)?;
                if known(left_zero).is_some() || fact.element != element || elements(&fact.shape)? != 1 {
                    return Ok(None);
                }
                Zero::Input(left_zero)
            }
            _ => return Ok(None),
        };
        let zeros = match (site.optional(right_zero), known(right_zero)) {
            (None, _) => vec![0.0],
            (_, Some(zeros)) => singles(zeros),
            _ => return Ok(None),
        };
        if zeros.is_empty() || !are_of(right_element, &zeros) {
            return Ok(None);
        }
        let (left_shape, right_shape) = (site.shape(0)?, site.shape(right)?);
        let results = site.output_shape()?;
        // The number of factors that there may be, and how many neighbouring results share one.
        let (count, length) = match is_convolution {
            true => (right_shape[0], results[2..].iter().product()),
            false => (if right_shape.len() > 1 { right_shape[right_shape.len() - 1] } else { 1 }, 1),
        };
        let are_fitting = |found: usize| found == 1 || found == count;
        let (to, factors) = if is_scaled {
            let (Some(left_scale), Some(right_scales), Some(scale), Some(zero)) =
                (one(1), known(4), one(6), one(7))
            else {
                return Ok(None);
            };
            let Some(range) = Range::of(site.fact_of_output()?.element, zero) else { return Ok(None) };
            let factors = right_scales.values.iter().map(|right| left_scale * *right as f32 / scale);
            (To::Range(range), factors.collect())
        } else {
            (To::Sums, vec![1.0])
        };
        let bias = match (site.optional(8).filter(|_| site.node.op_type == "QLinearConv"), known(8)) {
            (None, _) => Vec::new(),
            (_, Some(bias)) if bias.element == Element::INT32 && bias.values.len() == count => {
                bias.values.iter().map(|&value| value as i32).collect()
            }
            _ => return Ok(None),
        };
        let finish = Finish { to, factors, terms: Vec::new(), length };
        let is_list = |shape: &[usize]| shape.len() <= 1;
        let lists = [right_zero, if is_scaled { 4 } else { right_zero }];
        let are_lists = lists.iter().all(|&place| known(place).is_none_or(|tensor| is_list(&tensor.shape)));
        if !are_fitting(zeros.len())
            || !are_fitting(finish.factors.len())
            || !are_lists
            || !finish.is_finite()
        {
            return Ok(None);
        }
        match (is_convolution, known(right)) {
            (true, Some(kernel)) => Self::convolution(site, left_shape, kernel, &zeros, &bias, zero, finish),
            (false, kernel) if kernel.is_some() || zeros.len() == 1 => Self::matrices(
                [left_shape, right_shape],
                kernel.map(|kernel| (kernel, zeros.as_slice())),
                (right, zeros[0]),
                &bias,
                zero,
                finish,
            ),
            _ => Ok(None),
        }
    }
}

impl Right {
    /// The factors of matrices, by pairs of rows.
    fn pair(&self, values: &[f32], into: &mut Vec<i32>) {
        let Self { rows, columns, zero, .. } = *self;
        let groups = values.len() / (rows * columns).max(1);
        into.resize(groups * rows.div_ceil(2) * columns, 0);
        Pairs { from: values, zero, depth: rows, plane: columns, into }.compute();
    }
}

impl Finish {
    /// Whether all factors and terms are finite: results of others would not be numbers.
    pub fn is_finite(&self) -> bool {
        self.factors.iter().chain(&self.terms).all(|number| number.is_finite())
    }
}

/// Elements as factors: those of neighbouring channels, at the same place.
struct Pairs<'a> {
    from: &'a [f32],
    zero: f32,
    depth: usize,
    plane: usize,
    into: &'a mut [i32],
}

impl Pairs<'_> {
    fn compute(self) {
        dispatch_wide(self);
    }
}

/// A whole number of at most 2^22 as an integer, without what conversions do about others.
#[inline(always)]
fn integer(value: f32) -> i32 {
    (value + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits()) as i32
}

impl Work for Pairs<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        let Self { from, zero, depth, plane, into } = self;
        if plane == 1 {
            // Neighbouring elements.
            for (row, into) in from.chunks(depth.max(1)).zip(into.chunks_mut(depth.div_ceil(2).max(1))) {
                let (twos, rest) = row.as_chunks::<2>();
                for (into, [a, b]) in into.iter_mut().zip(twos) {
                    *into = paired(integer(a - zero), integer(b - zero));
                }
                if let ([value], Some(last)) = (rest, into.last_mut()) {
                    *last = paired(integer(value - zero), 0);
                }
            }
            return;
        }
        let groups = from.chunks((depth * plane).max(1));
        let halves = into.chunks_mut((depth.div_ceil(2) * plane).max(1));
        for (group, into) in groups.zip(halves) {
            for (two, into) in group.chunks(2 * plane).zip(into.chunks_mut(plane)) {
                let (first, second) = two.split_at(plane);
                if second.is_empty() {
                    into.iter_mut().zip(first).for_each(|(into, a)| *into = paired(integer(a - zero), 0));
                } else {
                    for (into, (a, b)) in into.iter_mut().zip(first.iter().zip(second)) {
                        *into = paired(integer(a - zero), integer(b - zero));
                    }
                }
            }
        }
    }
}

/// Sums as results.
struct Results<'a> {
    sums: &'a [i32],
    finish: &'a Finish,
    range: Option<Range>,
    into: &'a mut [f32],
}

impl Results<'_> {
    /// One of them.
    #[inline(always)]
    fn result(range: Option<Range>, sum: i32, factor: f32, term: f32) -> f32 {
        let scaled = sum as f32 * factor + term;
        range.map_or(scaled, |range| range.nearest(scaled))
    }
}

impl Work for Results<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        let Self { sums, finish: Finish { factors, terms, length, .. }, range, into } = self;
        let count = factors.len().max(terms.len()).max(1);
        // -0 leaves every other number as it is.
        let of = |numbers: &[f32], at: usize, without: f32| match numbers {
            [] => without,
            [one] => *one,
            numbers => numbers[at],
        };
        if *length == 1 && count > 1 && factors.len() == count && terms.is_empty() {
            for (into, sums) in into.chunks_mut(count).zip(sums.chunks(count)) {
                for ((into, &sum), factor) in into.iter_mut().zip(sums).zip(factors) {
                    *into = Self::result(range, sum, *factor, -0.0);
                }
            }
            return;
        }
        let length = if count == 1 { sums.len().max(1) } else { (*length).max(1) };
        let rows = into.chunks_mut(length).zip(sums.chunks(length));
        for ((into, sums), at) in rows.zip((0..count).cycle()) {
            let (factor, term) = (of(factors, at, 1.0), of(terms, at, -0.0));
            into.iter_mut().zip(sums).for_each(|(into, &sum)| *into = Self::result(range, sum, factor, term));
        }
    }
}

impl Operation for Quantised {
    fn is_rounded(&self) -> bool {
        true
    }

    fn kept(&self) -> usize {
        let layout = match &self.sums {
            Sums::Convolution(convolution) => convolution.kept(),
            Sums::Matrices(_) => 0,
        };
        self.counts.iter().fold(layout, |all, count| all.saturating_add(*count))
    }

    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let Left { depth, plane, zero, .. } = self.left;
        let zero = match zero {
            Zero::Known(zero) => zero,
            Zero::Input(place) => single(inputs, place)?[0],
        };
        self.pairs.resize(self.counts[0], 0);
        self.results.resize(self.counts[2], 0);
        Pairs { from: single(inputs, 0)?, zero, depth, plane, into: &mut self.pairs }.compute();
        match &mut self.sums {
            Sums::Convolution(convolution) => convolution.convolve(&self.pairs, &mut self.results)?,
            Sums::Matrices(matrices) => {
                if let Some(right) = &self.right {
                    right.pair(single(inputs, right.place)?, &mut self.right_pairs);
                    matrices.pack(&self.right_pairs);
                }
                matrices.multiply(&self.pairs, false, &mut self.results);
            }
        }
        let range = match (self.finish.to, &mut outputs[0]) {
            (To::Sums, Buffer::Double(into)) => {
                into.iter_mut().zip(&self.results).for_each(|(into, sum)| *into = f64::from(*sum));
                return Ok(());
            }
            (To::Range(range), _) => Some(range),
            _ => None,
        };
        dispatch_wide(Results {
            sums: &self.results,
            finish: &self.finish,
            range,
            into: outputs[0].single_mut()?,
        });
        Ok(())
    }
}

/// Whether numbers are integers of a type. Others are not zero points, whatever the file says.
pub fn are_of(element: Element, values: &[f32]) -> bool {
    element.range().is_some_and(|(low, high)| {
        values.iter().all(|value| (low as f32..=high as f32).contains(value) && value.fract() == 0.0)
    })
}

/// Whether integers of a type have 8 bits.
pub fn is_byte(element: Element) -> bool {
    matches!(element, Element::UINT8 | Element::INT8)
}
