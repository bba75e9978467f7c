//! Streaks of rain, moving.

crate::published::moving! { DynamicRain: "dynamic_rain_filter", "rain", "streaks of rain", "a loop of 3 s", 4 }
