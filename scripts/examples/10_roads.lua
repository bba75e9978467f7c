-- Three ways to a road: angles that are given, angles at random, and a number of turns with a mean curvature.

local roads = {
	given = pdk.road({ angles = { 0, 15, -20, 10, 0 }, segment = 25 }),
	random = pdk.road({ seed = 3, limit = 25, attempts = 100 }),
	informed = pdk.road({ turns = 3, mean_curvature = 0.02, seed = 5, attempts = 200 }),
}

local rows, scenarios = {}, {}
for _, name in { "given", "random", "informed" } do
	local road = roads[name]
	table.insert(rows, { name, road.length, road.turns, road.mean_curvature })
	table.insert(scenarios, { name = name, road = road.road })
end
pdk.table({ "road", "length m", "turns", "mean curvature 1/m" }, rows)
pdk.show(pdk.drive({ simulator = "lane", driver = "dave2", scenarios = scenarios }))
