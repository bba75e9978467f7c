-- What counts as a failure can be set for all scenarios or for one. It is a part of the scenario's id.

local fog = { { name = "fog_filter", level = 2 } }

pdk.show(pdk.drive({
	simulator = "lane",
	driver = "dave2",
	scenarios = {
		{ name = "2 m, the default of lane", perturbations = fog },
		{ name = "0.3 m", perturbations = fog, failure = { lane_departure = 0.3 } },
		{ name = "in 20 s", perturbations = fog, duration = 20 },
	},
}))
