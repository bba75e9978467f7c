//! The network `dave2_temporal`.

super::trained::network! {
    Dave2Temporal: "dave2_temporal", "8c07da59a3d687533850959ae599489c2c5416ca33fd87681261aee5c9f592ac",
    "Drives with a network that learned from images of `lane`, and remembers what it saw 0.3 and 0.6 seconds before",
    super::trained::DAVE2
}
