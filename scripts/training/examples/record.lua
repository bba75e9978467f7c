-- Drives that the pilot of docs/examples learns from, and the recordings beside it: a good driver on easy roads, at a small size.
--
--   pdk run scripts/training/examples/record.lua --out training-examples

local settings = pdk.settings({
	roads = 10,
	road_seed = 5001,
	images_every = 4,
	width = 160,
	height = 120,
})

local scenarios = {}
for number = 0, settings.roads - 1 do
	local seed = settings.road_seed + number
	table.insert(scenarios, { name = `road {number}`, road = pdk.road({ seed = seed, attempts = 1000 }).road, seed = seed })
end
pdk.drive({
	simulator = { name = "lane", width = settings.width, height = settings.height },
	driver = "lane_keeper",
	images_every = settings.images_every,
	scenarios = scenarios,
})
