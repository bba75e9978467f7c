-- Records what the networks that repaint learn from: short drives on the same roads in different weather, frame by frame the same places.
--
--   pdk run scripts/training/repaint/drives.lua --out drives
--
-- Each road is driven by day, under clouds, at night and in the rain. Rain is the simulator's wet road under clouds, a film of water that
-- mirrors the sky, and thick air. The drive by day has a second picture of each frame, which is as bright as its places are far away:
-- black, behind white fog.

local settings = pdk.settings({
	road_seed = 5001, -- of the first road; the others follow
	roads = 16, -- for each of the conditions
	duration = 0.8, -- seconds of each drive
	images_every = 1,
})

-- How long the segments of a road are in metres, and the speed in metres per second.
local known = {
	easy = { segment = 25, speed = 8 },
	standard = { segment = 37.5, speed = 11 },
	hard = { segment = 50, speed = 14 },
}
local markings = { "dashed", "solid", "worn" }

local distance = {
	{ name = "night_by_illuminance", illuminance = 0, beam = "off" },
	{ name = "fog_by_visibility", visibility = 100, air = 255, depth = "simulator" },
}
local rain = {
	{ name = "wet_road", film = 1.2, puddles = 0, beside = 4.5, depth = "simulator" },
	{ name = "fog_by_visibility", visibility = 260, air = 165, depth = "simulator" },
}

local scenarios = {}
for step, conditions in { "easy", "standard", "hard" } do
	for number = 1, settings.roads do
		local seed = settings.road_seed + 100 * (step - 1) + number - 1
		local these = known[conditions]
		local road = pdk.road({ seed = seed, limit = 40, segment = these.segment, attempts = 1000 }).road
		local function drive(weather, changes)
			local simulator = {
				name = "lane",
				conditions = conditions,
				light = weather,
				markings = markings[seed % 3 + 1],
				width = 320,
				height = 160,
				initial_speed = these.speed,
				straight_ends = 0,
				crests = 0, -- so that the camera is where the state says
				oncoming = 20,
				autopilot = true,
				autopilot_swing = 1,
				-- Two of three roads have a vehicle ahead.
				vehicle_ahead = if number % 3 == 0 then 0 else 6 + 5 * (number % 5),
				vehicle_ahead_speed = these.speed,
			}
			for name, value in changes.simulator or {} do
				simulator[name] = value
			end
			table.insert(scenarios, {
				name = `{conditions} {seed} {changes.name or weather}`,
				simulator = simulator,
				road = road,
				seed = seed,
				perturbations = changes.perturbations,
			})
		end
		local clean = { sensor_noise = 0, auto_exposure = 0 }
		drive("day", { perturbations = distance })
		drive("overcast", {})
		drive("night", { simulator = clean })
		drive("overcast", {
			name = "rain",
			simulator = if conditions == "easy" then clean else { sensor_noise = 0, wetness = 0.7 },
			perturbations = rain,
		})
	end
end
pdk.drive({
	driver = "lane_keeper", -- not heeded
	duration = settings.duration,
	images_every = settings.images_every,
	scenarios = scenarios,
})
