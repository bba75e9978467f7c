//! Perturbations of the affine family.
