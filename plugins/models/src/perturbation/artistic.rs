//! The perturbation `artistic`.

super::painter::painter! {
    Artistic: "artistic", 1, "98caf1702b6a576bb006ce9adc85a9a90a9b4e91ca9c4eb886a8d010f8ad7be3",
    "Repaints the frame in one of six styles of art, by a network",
    "Dumoulin et al., A Learned Representation for Artistic Style, 2017", super::painter::STYLES
}
