//! The perturbation `rainy`.

super::painter::painter! {
    Rainy: "rainy", 2, "1fa75ed596b9d0ba7e7c99acd95f7b28f743a2100aa826354b97e150f42c6504",
    "Repaints a dry day as a rainy one, with thick air and a wet road, by a network",
    "Johnson et al., Perceptual Losses for Real-Time Style Transfer and Super-Resolution, 2016"
}
