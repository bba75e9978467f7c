//! The perturbation `night`.

super::painter::painter! {
    Night: "night", 2, "d6cedb38b88f4690167382c7208d0a62ed43f04b1d134f9b7976f5d431658345",
    "Repaints a day as a night with headlights, by a network",
    "Johnson et al., Perceptual Losses for Real-Time Style Transfer and Super-Resolution, 2016"
}
