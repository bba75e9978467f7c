//! Perturbations of the graphic pattern family.
