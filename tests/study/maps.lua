-- Frames on which maps.py compares saliency methods: one of each of many roads, in three lights, all but the first after five seconds in which
-- the simulator's own autopilot swings about the middle of the lane. The record has an image of the first drive and three of each other one, so
-- that every third image is the last one of a drive.
--
--   pdk run tests/study/maps.lua --set conditions=standard --out frames

local settings = pdk.settings({
	conditions = "easy",
	roads = 31,
})

local known = {
	easy = { segment = 25, speed = 7, seed = 1001 },
	standard = { segment = 37.5, speed = 11, seed = 2001 },
	hard = { segment = 50, speed = 14, seed = 3001 },
}
local these = known[settings.conditions]
local lights = { "day", "overcast", "dusk" }
local swings = { 0.2, 0.4, 0.6, 0.8, 1.0, 1.2 } -- metres

local scenarios = {}
for number = 0, settings.roads do
	local seed = these.seed + number
	table.insert(scenarios, {
		name = `road {seed}`,
		seed = seed,
		simulator = {
			name = "lane",
			conditions = settings.conditions,
			light = lights[seed % 3 + 1],
			width = 320,
			height = 160,
			initial_speed = these.speed,
			autopilot = true,
			autopilot_swing = swings[seed % #swings + 1],
		},
		road = pdk.road({ seed = seed, limit = 30, segment = these.segment, attempts = 1000 }).road,
	})
end
local last = table.remove(scenarios)
pdk.drive({ driver = "lane_keeper", duration = 0.04, images_every = 50, scenarios = { last } })
pdk.drive({ driver = "lane_keeper", duration = 5.1, images_every = 50, scenarios = scenarios })
