//! Positions in tensors: what operators that move single elements have in common.

use pdk_sdk::error::{Error, Result};

/// The distance between neighbours along each axis. It has no meaning if there are no elements.
pub fn strides(shape: &[usize]) -> Vec<usize> {
    let mut strides = vec![1usize; shape.len()];
    for axis in (1..shape.len()).rev() {
        strides[axis - 1] = strides[axis].wrapping_mul(shape[axis]);
    }
    strides
}

/// The place of an element among all.
pub fn index(strides: &[usize], at: &[usize]) -> usize {
    strides.iter().zip(at).map(|(stride, at)| stride * at).sum()
}

/// An index as counted from the start.
pub fn counted(index: f64, length: usize) -> Result<usize> {
    let number = index as i64;
    let counted = if number < 0 { number.saturating_add(length as i64) } else { number };
    usize::try_from(counted)
        .ok()
        .filter(|&place| place < length)
        .ok_or_else(|| Error::new(format!("its index {index} is outside the {length} elements")))
}

/// Lengths that are not negative.
pub fn lengths(list: &[i64], what: &str) -> Result<Vec<usize>> {
    let lengths = list.iter().map(|&length| usize::try_from(length)).collect::<Result<Vec<_>, _>>();
    lengths.map_err(|_| Error::new(format!("its {what} {list:?} cannot be negative")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_outside_is_an_error() {
        assert_eq!(counted(-1.0, 3).unwrap(), 2);
        for index in [3.0, -4.0, f64::MAX, f64::MIN] {
            assert!(counted(index, 3).is_err());
        }
        assert!(counted(0.0, 0).is_err());
    }
}
