-- Records what a network has to see to learn to drive: every light and marking, many roads, places beside the lane's
-- middle and directions off its course, vehicles ahead at all distances. No perturbation: what the network makes of those
-- is what tests are for.
--
--   pdk run collect --out training-data
--   python scripts/training/train.py training-data scripts/models

local settings = pdk.settings({
	lights = { "day", "dusk", "overcast" },
	markings = { "dashed", "solid", "worn" },
	roads = 4, -- for each light, marking and situation
	road_seed = 1001, -- far from the seeds of the studies' roads
	limit = 40, -- largest angle of a road in degrees: a little more than in the studies
	duration = 24, -- seconds of simulation time
	images_every = 6,
})

-- How the recording driver drives and whether it has a vehicle ahead: metres and metres per second.
local situations = {
	{ target_speed = 8, wander = 0.4 },
	{ target_speed = 7, wander = 1.2 },
	{ target_speed = 9, wander = 1.7 },
	{ target_speed = 7, wander = 0.8, vehicle_ahead = 16, vehicle_ahead_speed = 6 },
	{ target_speed = 6, wander = 0.6, vehicle_ahead = 6, vehicle_ahead_speed = 6.5 },
	{ target_speed = 5, wander = 1.2, vehicle_ahead = 30, vehicle_ahead_speed = 4 },
}

local seed = settings.road_seed
for _, light in settings.lights do
	for _, markings in settings.markings do
		for _, situation in situations do
			local scenarios = {}
			for number = 1, settings.roads do
				local road = pdk.road({ seed = seed, limit = settings.limit, attempts = 1000 }).road
				-- Every third road goes up and down by two metres, with about 115 m from one crest to the next.
				if number % 3 == 0 then
					road.heights = {}
					for i in road.angles do
						road.heights[i] = 2 * (math.sin(1.36 * i + seed) - math.sin(seed))
					end
				end
				table.insert(scenarios, { name = `{light}, {markings}, road {seed}`, road = road, seed = seed })
				seed += 1
			end
			pdk.drive({
				simulator = {
					name = "lane",
					light = light,
					markings = markings,
					initial_speed = situation.target_speed,
					vehicle_ahead = situation.vehicle_ahead or 0,
					vehicle_ahead_speed = situation.vehicle_ahead_speed or 6,
				},
				driver = {
					name = "lane_keeper",
					target_speed = situation.target_speed,
					wander = situation.wander,
					lateral_acceleration = 6,
				},
				duration = settings.duration,
				images_every = settings.images_every,
				scenarios = scenarios,
			})
		end
	end
end
