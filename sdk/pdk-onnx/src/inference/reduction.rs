//! Reductions over any axes: sums and means, functions of them, and the greatest and least elements.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use super::lanes::{Lanes, Work, dispatch};
use super::sums::{PARTS, add, beyond, extreme, joined};
use crate::operators::reduce;
use crate::site::Site;
use crate::tensor::for_each_position;

/// What is computed of each group of elements.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Sum,
    Mean,
    Sizes,
    Squares,
    Length,
    Greatest,
    Least,
}

/// A reduction.
pub struct Reduction {
    kind: Kind,
    /// Where groups begin; if elements of one group do not lie side by side, where this many neighbouring groups do.
    groups: Vec<u32>,
    /// Where elements of a group lie beside its beginning.
    members: Vec<u32>,
    /// The elements that lie side by side: of one group, or of as many groups.
    length: usize,
    is_side_by_side: bool,
    /// The elements of a group.
    count: usize,
    sums: Vec<f64>,
}

impl Reduction {
    /// The reduction of a node; nothing if it is another, or has no elements.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn new(site: &Site<'_>) -> Result<Option<Self>> {
        let kind = match site.node.op_type.as_str() {
            "ReduceSum" => Kind::Sum,
            "ReduceMean" | "GlobalAveragePool" => Kind::Mean,
            "ReduceL1" => Kind::Sizes,
            "ReduceSumSquare" => Kind::Squares,
            "ReduceL2" => Kind::Length,
            "ReduceMax" | "GlobalMaxPool" => Kind::Greatest,
            "ReduceMin" => Kind::Least,
            _ => return Ok(None),
        };
        let kept = match site.node.op_type.starts_with("Global") {
            true => reduce::pooled(site)?,
            false => reduce::kept(site)?,
        };
        let shape = site.shape(0)?;
        if shape.contains(&0) {
            return Ok(None);
        }
        // The axes that are longer than 1, each with how far apart its elements are; neighbours that are both reduced, or both kept, are one.
        let mut axes: Vec<(usize, usize, bool)> = Vec::new();
        for (&length, &kept) in shape.iter().zip(&kept).filter(|(length, _)| **length > 1) {
            axes.iter_mut().for_each(|(_, apart, _)| *apart *= length);
            match axes.last_mut() {
                Some((before, apart, is_reduced)) if *is_reduced == (kept == 1) => {
                    *before *= length;
                    *apart = 1;
                }
                _ => axes.push((length, 1, kept == 1)),
            }
        }
        let (length, _, is_side_by_side) = axes.pop().unwrap_or((1, 1, true));
        let places = |reduced: bool| {
            let axes: Vec<_> = axes.iter().filter(|(.., is_reduced)| *is_reduced == reduced).collect();
            let lengths: Vec<usize> = axes.iter().map(|(length, ..)| *length).collect();
            let mut places = Vec::new();
            for_each_position(&lengths, |at| {
                let place: usize = at.iter().zip(&axes).map(|(at, (_, apart, _))| at * apart).sum();
                places.push(place as u32);
            });
            places
        };
        let (groups, members) = (places(false), places(true));
        let count = members.len() * if is_side_by_side { length } else { 1 };
        let sums = vec![0.0; if is_side_by_side { 0 } else { length }];
        Ok(Some(Self { kind, groups, members, length, is_side_by_side, count, sums }))
    }
}

impl Operation for Reduction {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        dispatch(Groups { of: self, input: single(inputs, 0)?, into: outputs[0].single_mut()? });
        Ok(())
    }
}

struct Groups<'a> {
    of: &'a mut Reduction,
    input: &'a [f32],
    into: &'a mut [f32],
}

impl Work for Groups<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        let count = self.of.count as f64;
        match self.of.kind {
            Kind::Sum => self.sums(|x| x, |sum| sum),
            Kind::Mean => self.sums(|x| x, |sum| sum / count),
            Kind::Sizes => self.sums(f64::abs, |sum| sum),
            Kind::Squares => self.sums(|x| x * x, |sum| sum),
            Kind::Length => self.sums(|x| x * x, f64::sqrt),
            Kind::Greatest => self.extremes::<true>(f32::NEG_INFINITY),
            Kind::Least => self.extremes::<false>(f32::INFINITY),
        }
    }
}

impl Groups<'_> {
    /// A function of the sums of a function.
    #[inline(always)]
    fn sums(self, of_each: impl Fn(f64) -> f64 + Copy, of_sum: impl Fn(f64) -> f64) {
        let Reduction { groups, members, length, is_side_by_side, sums, .. } = self.of;
        if *is_side_by_side {
            for (into, group) in self.into.iter_mut().zip(groups) {
                let mut parts = [0.0; PARTS];
                for member in members.iter() {
                    add(&mut parts, &self.input[(*group + member) as usize..][..*length], of_each);
                }
                *into = of_sum(joined(parts)) as f32;
            }
            return;
        }
        for (into, group) in self.into.chunks_exact_mut(*length).zip(groups) {
            sums.fill(0.0);
            for member in members.iter() {
                let row = &self.input[(*group + member) as usize..][..*length];
                for (sum, x) in sums.iter_mut().zip(row) {
                    *sum += of_each(f64::from(*x));
                }
            }
            for (into, sum) in into.iter_mut().zip(sums.iter()) {
                *into = of_sum(*sum) as f32;
            }
        }
    }

    /// The greatest or the least elements, which begin with `far`. Of 0 and -0, the first is chosen.
    #[inline(always)]
    fn extremes<const GREATEST: bool>(self, far: f32) {
        let Reduction { groups, members, length, is_side_by_side, .. } = self.of;
        if *is_side_by_side {
            for (into, group) in self.into.iter_mut().zip(groups) {
                let row = |member: &u32| &self.input[(*group + member) as usize..][..*length];
                let rows = members.iter().map(row);
                let found = rows.fold(far, |far, row| beyond::<GREATEST>(far, extreme::<GREATEST>(far, row)));
                let first = || members.iter().flat_map(row).copied().find(|x| *x == 0.0);
                *into = if found == 0.0 { first().unwrap_or(found) } else { found };
            }
            return;
        }
        for (into, group) in self.into.chunks_exact_mut(*length).zip(groups) {
            into.fill(far);
            for member in members.iter() {
                let row = &self.input[(*group + member) as usize..][..*length];
                for (far, x) in into.iter_mut().zip(row) {
                    *far = beyond::<GREATEST>(*far, *x);
                }
            }
        }
    }
}
