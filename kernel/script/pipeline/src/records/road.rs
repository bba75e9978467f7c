//! Making roads.

use pdk_lua::ApiRecord;

use super::field::field;

/// What `pdk.road` takes.
pub const ROAD_REQUEST: ApiRecord = ApiRecord {
    name: "RoadRequest",
    doc: "What `pdk.road` takes: `angles` for a given road, `turns` and `mean_curvature` for an informed one, neither for a \
          random one.",
    fields: &[
        field("angles", "{ number }?", "Degrees turned at each node, positive to the right."),
        field(
            "segment",
            "(number | { number })?",
            "Metres from node to node, or one number for each angle if angles are given. The default is 25.",
        ),
        field("seed", "number?", "The seed of the draws. The default is the run's seed."),
        field(
            "limit",
            "number?",
            "Largest angle in degrees. The default is 35 for random roads and 60 for informed ones.",
        ),
        field("turns", "number?", "Nodes at which the road turns by at least 25 degrees, 0 to 8."),
        field("mean_curvature", "number?", "The mean curvature in 1/m that the road should come near."),
        field(
            "width",
            "number?",
            "Metres from edge to edge. The road may not cross itself. The default is 8.",
        ),
        field(
            "smallest_radius",
            "number?",
            "Metres; a road with a tighter bend is not valid. The default is 8.5, which a car can drive.",
        ),
        field("attempts", "number?", "How many roads are drawn until one is valid. The default is 1."),
    ],
};

pub(super) const ROAD: ApiRecord = ApiRecord {
    name: "Road",
    doc: "What `pdk.road` returns.",
    fields: &[
        field("waypoints", "string", "The waypoints as `x,y,z@x,y,z`, y up, in metres."),
        field(
            "road",
            "{ angles: { number }, segment: number | { number } }",
            "The same in short: the `road` of a scenario, for simulators that take angles.",
        ),
        field("angles", "{ number }", "Degrees turned at each node."),
        field("turns", "number", "Nodes at which it turns by at least 25 degrees."),
        field("mean_curvature", "number", "Mean curvature over its nodes in 1/m."),
        field("length", "number", "Its length in metres."),
    ],
};
