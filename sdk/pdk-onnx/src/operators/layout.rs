//! Operators that leave the elements as they are: `Identity`, `Dropout`, `Reshape`, `Flatten`, `Squeeze`, `Unsqueeze`
//! and `Transpose`.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given, reshape_back, reshaped, same};
use crate::builder::Builder;
use crate::site::{Site, axes, axis};
use crate::tensor::{Element, Tensor, elements};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new(
        "Identity",
        same,
        |_, x| Ok(vec![given(x, 0)?.clone()]),
        Rule::First(|_, _, g| Ok(vec![(0, g.to_owned())])),
    ),
    Operator::new("Dropout", infer_dropout, evaluate_dropout, Rule::First(gradient_dropout)),
    Operator::new("Reshape", infer_reshape, reshaped, Rule::First(reshape_back)),
    Operator::new("Flatten", infer_flatten, reshaped, Rule::First(reshape_back)),
    Operator::new("Squeeze", infer_squeeze, reshaped, Rule::First(reshape_back)),
    Operator::new("Unsqueeze", infer_unsqueeze, reshaped, Rule::First(reshape_back)),
    Operator::new("Transpose", infer_transpose, evaluate_transpose, Rule::First(gradient_transpose)),
];

fn infer_dropout(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?.clone();
    let mask = Fact::new(Element::BOOL, fact.shape.clone());
    Ok(vec![fact, mask])
}

/// It leaves the values as they are, unless it is set to training.
fn check_dropout(site: &Site<'_>) -> Result<()> {
    if site.number_at(2, "")?.is_some_and(|training| training != 0.0) {
        return Err(Error::new(
            "it is set to training, in which it draws at random; export the model for inference",
        ));
    }
    Ok(())
}

fn evaluate_dropout(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    check_dropout(site)?;
    let x = given(inputs, 0)?;
    Ok(vec![x.clone(), Tensor::filled(Element::BOOL, &x.shape, 1.0)?])
}

fn gradient_dropout(site: &Site<'_>, _: &mut Builder, g: &str) -> Result<Parts> {
    check_dropout(site)?;
    Ok(vec![(0, g.to_owned())])
}

fn infer_reshape(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    let asked = site.constant(1)?.map(|shape| shape.to_ints()).unwrap_or_default();
    let keeps_zeros = site.int("allowzero", 0) != 0;
    let mut shape = Vec::with_capacity(asked.len());
    for (place, &dim) in asked.iter().enumerate() {
        shape.push(match dim {
            0 if !keeps_zeros => {
                *fact.shape.get(place).ok_or_else(|| Error::new("it copies an axis that does not exist"))?
            }
            -1 => 1,
            dim => {
                usize::try_from(dim).map_err(|_| Error::new(format!("its shape has the dimension {dim}")))?
            }
        });
    }
    let count = elements(&fact.shape)?;
    if let Some(open) = asked.iter().position(|&dim| dim == -1) {
        shape[open] = count / elements(&shape)?.max(1);
    }
    match elements(&shape)? == count {
        true => Ok(vec![Fact::new(fact.element, shape)]),
        false => Err(Error::new(format!("{count} elements do not have the shape {asked:?}"))),
    }
}

fn infer_flatten(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    let rank = fact.shape.len() as i64;
    let axis = site.int("axis", 1);
    let at = if axis < 0 { axis + rank } else { axis };
    let at = usize::try_from(at).ok().filter(|&at| at <= fact.shape.len());
    let at = at.ok_or_else(|| Error::new(format!("its axis {axis} is outside the {rank} axes")))?;
    let (rows, columns) = fact.shape.split_at(at);
    Ok(vec![Fact::new(fact.element, vec![rows.iter().product(), columns.iter().product()])])
}

fn infer_squeeze(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    let removed = match site.ints_at(1, "axes")? {
        Some(list) => axes(&list, fact.shape.len())?,
        None => (0..fact.shape.len()).filter(|&axis| fact.shape[axis] == 1).collect(),
    };
    if let Some(axis) = removed.iter().find(|&&axis| fact.shape[axis] != 1) {
        return Err(Error::new(format!("its axis {axis} has the length {}, not 1", fact.shape[*axis])));
    }
    let shape = (0..fact.shape.len()).filter(|axis| !removed.contains(axis)).map(|axis| fact.shape[axis]);
    Ok(vec![Fact::new(fact.element, shape.collect())])
}

fn infer_unsqueeze(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    let list = site.ints_at(1, "axes")?.unwrap_or_default();
    let mut added = axes(&list, fact.shape.len() + list.len())?;
    added.sort_unstable();
    let mut shape = fact.shape.clone();
    added.into_iter().for_each(|axis| shape.insert(axis, 1));
    Ok(vec![Fact::new(fact.element, shape)])
}

/// Which axis of the input each axis of the output is.
pub fn order(site: &Site<'_>) -> Result<Vec<usize>> {
    let rank = site.shape(0)?.len();
    let order = match site.ints("perm") {
        Some(order) => order.iter().map(|&each| axis(each, rank)).collect::<Result<Vec<_>>>()?,
        None => (0..rank).rev().collect(),
    };
    match order.len() == rank && (0..rank).all(|axis| order.contains(&axis)) {
        true => Ok(order),
        false => Err(Error::new(format!("its order {order:?} does not name each of {rank} axes once"))),
    }
}

fn infer_transpose(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    Ok(vec![Fact::new(fact.element, order(site)?.into_iter().map(|axis| fact.shape[axis]).collect())])
}

fn evaluate_transpose(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    let order = order(site)?;
    let shape: Vec<_> = order.iter().map(|&axis| input.shape[axis]).collect();
    let mut source = vec![0; order.len()];
    let turned = Tensor::from_fn(input.element, &shape, |at| {
        at.iter().zip(&order).for_each(|(&at, &axis)| source[axis] = at);
        input.broadcast_at(&source)
    });
    Ok(vec![turned?])
}

fn gradient_transpose(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let order = order(site)?;
    let back: Vec<_> =
        (0..order.len()).map(|axis| order.iter().position(|&at| at == axis).unwrap_or(axis)).collect();
    Ok(vec![(0, b.transpose(g, &back)?)])
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_take_the_shape_of_what_went_in() {
        for case in [
            "identity",
            "dropout",
            "reshape",
            "reshape/copied",
            "flatten",
            "flatten/axis",
            "squeeze",
            "squeeze/all",
            "unsqueeze",
            "transpose",
            "transpose/reversed",
        ] {
            check(case);
        }
    }
}
