//! The network `dave2_quantised`.

super::trained::network! {
    Dave2Quantised: "dave2_quantised", "8c5e6e9c71915aa80494e062f92cb57109f1033e2daef70de18a24a5853c7a81",
    "Drives with `dave2`, whose convolutions compute with integers of 8 bits",
    super::trained::DAVE2
}
