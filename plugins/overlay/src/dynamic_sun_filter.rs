//! Glare of a low sun, moving.

crate::published::moving! { DynamicSun: "dynamic_sun_filter", "sun", "glare of a low sun", "a loop of 4 s", 3 }
