//! `DepthToSpace` and `SpaceToDepth`: blocks of pixels become channels, and the reverse.

use pdk_sdk::error::{Error, Result};

use super::inputs::taken;
use super::operator::{Operator, Parts, Rule};
use super::positions::{index, strides};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::{Tensor, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("DepthToSpace", infer, evaluate, Rule::First(gradient)),
    Operator::new("SpaceToDepth", infer, evaluate, Rule::First(gradient)),
];

/// How elements move: the input's axes are parted, put into another order, and joined.
struct Plan {
    parted: [usize; 6],
    order: [usize; 6],
    output: Vec<usize>,
}

impl Plan {
    /// The parted axes in their new order.
    fn moved(&self) -> [usize; 6] {
        self.order.map(|axis| self.parted[axis])
    }
}

fn plan(site: &Site<'_>) -> Result<Plan> {
    let shape = site.shape(0)?;
    let block = usize::try_from(site.int("blocksize", 0)).ok().filter(|&block| block > 0);
    let square = block.and_then(|block| block.checked_mul(block));
    let (&[n, c, h, w], Some(block), Some(square)) = (shape, block, square) else {
        return Err(Error::new(format!(
            "it needs a `blocksize` of at least 1 and an input of 4 axes, but has {}",
            shape_text(shape)
        )));
    };
    let unfit = || Error::new(format!("its blocks of {block} do not fit its input {}", shape_text(shape)));
    if site.node.op_type == "SpaceToDepth" {
        if h % block != 0 || w % block != 0 {
            return Err(unfit());
        }
        let depth = c.checked_mul(square).ok_or_else(unfit)?;
        return Ok(Plan {
            parted: [n, c, h / block, block, w / block, block],
            order: [0, 3, 5, 1, 2, 4],
            output: vec![n, depth, h / block, w / block],
        });
    }
    if c % square != 0 {
        return Err(unfit());
    }
    let depth = c / square;
    let (Some(height), Some(width)) = (h.checked_mul(block), w.checked_mul(block)) else {
        return Err(unfit());
    };
    let (parted, order) = match site.text("mode", "DCR") {
        "DCR" => ([n, block, block, depth, h, w], [0, 3, 4, 1, 5, 2]),
        "CRD" => ([n, depth, block, block, h, w], [0, 1, 4, 2, 5, 3]),
        mode => return Err(Error::new(format!("its `mode` `{mode}` is not known here"))),
    };
    Ok(Plan { parted, order, output: vec![n, depth, height, width] })
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![Fact::new(site.fact(0)?.element, plan(site)?.output)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (plan, input) = (plan(site)?, taken(site, inputs, 0)?);
    let from = strides(&plan.parted);
    let from = plan.order.map(|axis| from[axis]);
    let moved = Tensor::from_fn(input.element, &plan.moved(), |at| input.values[index(&from, at)])?;
    Ok(vec![Tensor { shape: plan.output, ..moved }])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let plan = plan(site)?;
    let mut back = [0; 6];
    for (place, &axis) in plan.order.iter().enumerate() {
        back[axis] = place;
    }
    let g = b.reshape(g, &plan.moved())?;
    let g = b.transpose(&g, &back)?;
    Ok(vec![(0, b.reshape(&g, site.shape(0)?)?)])
}

#[cfg(test)]
mod tests {
    use crate::testing::Setting::Int;
    use crate::testing::{check, computed};

    #[test]
    fn gradients_move_back() {
        for case in ["depth_to_space", "depth_to_space/crd", "space_to_depth"] {
            check(case);
        }
    }

    #[test]
    fn blocks_that_do_not_fit_are_errors() {
        for operator in ["DepthToSpace", "SpaceToDepth"] {
            for (shape, block) in [
                (&[1, 3, 3, 3][..], 2),
                (&[1, 4, 4, 4], 0),
                (&[1, 4, 4, 4], -2),
                (&[4, 4], 2),
                (&[1, 4, 4, 4], i64::MAX),
            ] {
                let result = computed(13, |s| {
                    let x = s.drawn(shape, -1.0, 1.0);
                    s.node(operator, &[&x], "y", &[("blocksize", Int(block))]);
                });
                assert!(result.is_err(), "{operator} {shape:?} {block}");
            }
        }
    }
}
