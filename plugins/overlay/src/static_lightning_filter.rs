//! Bolts of lightning, standing still.

crate::published::still! { StaticLightning: "static_lightning_filter", "lightning", "bolts of lightning", 3 }
