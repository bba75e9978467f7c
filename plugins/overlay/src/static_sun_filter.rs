//! Glare of a low sun, standing still.

crate::published::still! { StaticSun: "static_sun_filter", "sun", "glare of a low sun", 2 }
