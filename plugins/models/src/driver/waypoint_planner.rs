//! The network `waypoint_planner`.

super::trained::network! {
    WaypointPlanner: "waypoint_planner", "3e7647f15e01c26ac7e319b9e4fe81e3db6f2406aa2a47ca48187fd7d4c816ea",
    "Drives by pure pursuit of waypoints, which a residual network plans that learned from images of `lane`",
    "He et al., Deep Residual Learning for Image Recognition, 2016; Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, 1992"
}
