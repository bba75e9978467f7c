//! `Gemm` and `MatMul`: the rows of the left matrix are the places of [`product`](super::product), the columns of the right one its
//! outputs.

use pdk_sdk::error::{Error, Result};

use super::buffer::{Buffer, Operation, single, singles};
use super::lanes::{Number, multiply_add};
use super::product::{self, Packed, Place};
use crate::operators::matmul;
use crate::site::Site;
use crate::tensor::{Tensor, elements, for_each_position};

/// `MatMul` and `Gemm`.
pub struct Product {
    matrices: Matrices,
    is_constant: bool,
    sum: Option<Sum>,
    /// Whether results below 0 become 0.
    is_cut: bool,
}

/// Products of matrices.
pub struct Matrices<N = f32> {
    rows: usize,
    inner: usize,
    columns: usize,
    /// How far apart rows and columns of the right matrix are.
    right: [usize; 2],
    /// Where the matrices of each product begin: left, and the number of the right one.
    stacks: Vec<(usize, usize)>,
    /// Where the right matrices begin.
    starts: Vec<usize>,
    taps: Vec<u32>,
    places: Vec<Place>,
    /// The right matrices; those that are computed are packed again for each frame.
    packed: Vec<Packed<N>>,
}

/// What `Gemm` does beside the product.
struct Sum {
    factor: f32,
    addend_factor: f32,
    /// The element of the addend for each of the result, if there is an addend.
    addend: Option<Vec<u32>>,
}

impl<N: Number> Matrices<N> {
    /// Products of stacks of matrices of these shapes, as `MatMul` has them. The right matrices are packed later.
    ///
    /// # Errors
    /// If they do not go together.
    pub fn stacks(left: &[usize], right: &[usize]) -> Result<Self> {
        let [a, b] = matmul::matrices(left, right)?;
        let shape = matmul::product_shape(&a, &b)?;
        let (rank, stack) = (shape.len(), &shape[..shape.len() - 2]);
        let (rows, inner, columns) = (shape[rank - 2], a[a.len() - 1], shape[rank - 1]);
        // The number of the matrix of a side that belongs to a place in the stack.
        let number = |side: &[usize], at: &[usize]| {
            let batch = &side[..side.len() - 2];
            let skipped = at.len() - batch.len();
            let dims = batch.iter().zip(&at[skipped..]);
            dims.fold(0, |index, (&dim, &at)| index * dim + if dim == 1 { 0 } else { at })
        };
        let mut stacks = Vec::new();
        for_each_position(stack, |at| stacks.push((number(&a, at) * rows * inner, number(&b, at))));
        let count: usize = b[..b.len() - 2].iter().product();
        let places = (0..rows).map(|row| place(row * inner, row * columns));
        let taps = (0..inner).map(offset).collect::<Result<_>>()?;
        elements(&[rows, columns])?;
        Ok(Self {
            rows,
            inner,
            columns,
            right: [columns, 1],
            stacks,
            starts: (0..count).map(|number| number * inner * columns).collect(),
            taps,
            places: places.collect::<Result<_>>()?,
            packed: Vec::new(),
        })
    }

    /// The same with what the sums of each column begin with.
    pub fn starting_with(mut self, start: &[N]) -> Self {
        let start = |output: usize| start.get(output).copied().unwrap_or_default();
        let empty = Packed::new(self.columns, self.inner, self.rows, |_, _| N::default(), start);
        self.packed = vec![empty; self.starts.len()];
        self
    }

    /// The number of results.
    pub fn results(&self) -> usize {
        self.stacks.len() * self.rows * self.columns
    }

    /// Packs the right matrices.
    pub fn pack(&mut self, values: &[N]) {
        for (packed, first) in self.packed.iter_mut().zip(&self.starts) {
            packed.fill(&values[*first..], self.right);
        }
    }

    /// Multiplies the left matrices with the right ones, which have been packed. If results are `cut`, those below 0 become 0.
    pub fn multiply(&self, left: &[N], cut: bool, result: &mut [N]) {
        for (&(first, number), into) in
            self.stacks.iter().zip(result.chunks_exact_mut((self.rows * self.columns).max(1)))
        {
            product::sum(&left[first..], &self.packed[number], &self.taps, &self.places, 1, cut, into);
        }
    }
}

impl Product {
    /// `MatMul`; `right` is its right side, if that is constant.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn stacks(site: &Site<'_>, right: Option<&Tensor>) -> Result<Self> {
        let matrices = Matrices::stacks(site.shape(0)?, site.shape(1)?)?.starting_with(&[]);
        Ok(Self { matrices, is_constant: false, sum: None, is_cut: false }.with(right))
    }

    /// `Gemm`; `right` and `addend` are given if they are constant.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn and_sum(site: &Site<'_>, right: Option<&Tensor>, addend: Option<&Tensor>) -> Result<Self> {
        let (a, shape) = (site.shape(0)?, site.output_shape()?);
        let (turned_a, turned_b) = (site.int("transA", 0) != 0, site.int("transB", 0) != 0);
        let (rows, inner, columns) = (shape[0], a[usize::from(!turned_a)], shape[1]);
        let (factor, addend_factor) = (site.float("alpha", 1.0) as f32, site.float("beta", 1.0) as f32);
        let from = |row: usize| if turned_a { row } else { row * inner };
        let places = (0..rows).map(|row| place(from(row), row * columns));
        let taps = (0..inner).map(|k| offset(if turned_a { k * rows } else { k })).collect::<Result<_>>()?;
        // A constant that is added to each row is what the sums begin with.
        let by_column = addend.filter(|addend| {
            right.is_some()
                && factor == 1.0
                && addend_factor == 1.0
                && matches!(addend.shape[..], [n] | [1, n] if n == columns)
        });
        let start = by_column.map(singles).unwrap_or_default();
        let later = site.optional(2).filter(|_| by_column.is_none());
        let addend = later.map(|_| -> Result<_> {
            let of = site.shape(2)?;
            let numbers = Tensor {
                element: site.fact(2)?.element,
                shape: of.to_vec(),
                values: (0..of.iter().product::<usize>()).map(|n| n as f64).collect(),
            };
            Ok(Tensor::from_fn(numbers.element, shape, |at| numbers.broadcast_at(at))?
                .values
                .iter()
                .map(|v| *v as u32)
                .collect())
        });
        let addend = addend.transpose()?;
        let sum = (factor != 1.0 || addend.is_some()).then_some(Sum { factor, addend_factor, addend });
        let matrices = Matrices {
            rows,
            inner,
            columns,
            right: if turned_b { [1, inner] } else { [columns, 1] },
            stacks: vec![(0, 0)],
            starts: vec![0],
            taps,
            places: places.collect::<Result<_>>()?,
            packed: Vec::new(),
        };
        Ok(Self { matrices: matrices.starting_with(&start), is_constant: false, sum, is_cut: false }
            .with(right))
    }

    /// The same with a constant right side, if it is.
    fn with(mut self, right: Option<&Tensor>) -> Self {
        if let Some(right) = right {
            self.matrices.pack(&singles(right));
            self.is_constant = true;
        }
        self
    }
}

fn offset(at: usize) -> Result<u32> {
    u32::try_from(at).map_err(|_| Error::new("its matrices are too large"))
}

fn place(from: usize, to: usize) -> Result<Place> {
    Ok(Place { from: offset(from)?, to: offset(to)? })
}

impl Operation for Product {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let left = single(inputs, 0)?;
        let result = outputs[0].single_mut()?;
        if !self.is_constant {
            self.matrices.pack(single(inputs, 1)?);
        }
        let Some(Sum { factor, addend_factor, addend }) = &self.sum else {
            self.matrices.multiply(left, self.is_cut, result);
            return Ok(());
        };
        self.matrices.multiply(left, false, result);
        match addend {
            None => result.iter_mut().for_each(|value| *value *= factor),
            Some(places) => {
                let addend = single(inputs, 2)?;
                for (value, place) in result.iter_mut().zip(places) {
                    *value = multiply_add(*factor, *value, addend_factor * addend[*place as usize]);
                }
            }
        }
        if self.is_cut {
            result.iter_mut().for_each(|value| *value = value.cut());
        }
        Ok(())
    }

    fn cut(&mut self) -> bool {
        self.is_cut = true;
        true
    }
}
