-- Two drivers on the same roads with the same random draws, compared road by road.

local settings = pdk.settings({ first = "dave2", second = "dave2_augmented", perturbation = "fog_filter", level = 4, roads = 6 })

local scenarios = {}
for seed = 1, settings.roads do
	local road = pdk.road({ seed = seed, attempts = 100 }).road
	for _, driver in { settings.first, settings.second } do
		table.insert(scenarios, {
			name = `{driver} on road {seed}`,
			driver = driver,
			road = road,
			perturbations = { { name = settings.perturbation, level = settings.level } },
		})
	end
end

local failed = { {}, {} }
for i, outcome in pdk.drive({ simulator = "lane", scenarios = scenarios }) do
	table.insert(failed[(i - 1) % 2 + 1], if outcome.success then 0 else 1)
end
local paired = pdk.compare(failed[1], failed[2])
assert(paired, "no road was driven by both")
pdk.table({ "difference in the share that failed", "95 %", "p" }, {
	{ paired.difference.value, string.format("%.2f to %.2f", paired.difference.low, paired.difference.high), paired.p },
})
