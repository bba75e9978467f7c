//! Streaks of rain, standing still.

crate::published::still! { StaticRain: "static_rain_filter", "rain", "streaks of rain", 3 }
