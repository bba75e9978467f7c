//! The perturbation `night`.

super::painter::painter! {
    Night: "night", "9e5b8e1273b3a3d5baeb3631a6f925876a12a16e9c8d01d3e69d344552f51b27",
    "Repaints a day as a night, by a network",
    "Park et al., Contrastive Learning for Unpaired Image-to-Image Translation, 2020"
}
