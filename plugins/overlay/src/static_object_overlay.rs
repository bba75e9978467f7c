//! Birds in flight above the horizon, standing still.

crate::published::still! { StaticObject: "static_object_overlay", "birds", "birds in flight above the horizon", 3 }
