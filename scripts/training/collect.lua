-- Records what a network has to see to learn to drive: all conditions, every light and marking, many roads, places beside the
-- lane's middle and directions off its course, vehicles ahead at all distances. The simulator drives itself, by what only it knows, so
-- that it gets through where no driver can yet. Without perturbations, so that tests can say what the network makes of those; or through
-- some that made a network fail, to mend it.
--
--   pdk run collect --out training-data
--   python scripts/training/train.py training-data --out scripts/models --tub TUB

local settings = pdk.settings({
	conditions = { "easy", "standard", "hard" },
	markings = { "dashed", "solid", "worn" },
	roads = 2, -- for each condition, light, marking and situation
	road_seed = 1001, -- far from the seeds of the studies' roads
	limit = 40, -- largest angle of a road in degrees: a little more than in the studies
	duration = 24, -- seconds of simulation time
	images_every = 6,
	perturbations = {}, -- each drive goes through the next of these, at the next of the levels
	levels = { 1, 2, 3 },
	width = 320, -- of the recorded images
	height = 160,
})

-- The lights of each condition, the length of a road's segments in metres, and the speeds at which it is recorded in metres per
-- second, from slow to fast.
local known = {
	easy = { lights = { "day", "dusk", "overcast" }, segment = 25, speeds = { 5, 7, 8, 9 } },
	standard = { lights = { "day", "overcast", "dusk" }, segment = 37.5, speeds = { 6, 9, 12, 14 } },
	hard = { lights = { "day", "overcast", "dusk", "night" }, segment = 50, speeds = { 7, 11, 15, 18 } },
}

-- How far the vehicle swings about the middle of its lane in metres, which of the speeds it drives at, and whether one is ahead:
-- at how many seconds, and at which share of its own speed.
local situations = {
	{ swing = 0.4, speed = 3 },
	{ swing = 1.1, speed = 2 },
	{ swing = 1.5, speed = 3 },
	{ swing = 0.8, speed = 4 },
	{ swing = 0.6, speed = 2, ahead = 1.2, share = 1.0 },
	{ swing = 1.0, speed = 1, ahead = 4, share = 0.8 },
}

-- The perturbation of the next drive. They go round, and each light and marking begins elsewhere, so that every perturbation and level
-- meets all situations.
local drives = 0
local function through()
	local names, levels = settings.perturbations, settings.levels
	if #names == 0 then
		return nil
	end
	local name, level = names[drives % #names + 1], levels[drives // #names % #levels + 1]
	drives += 1
	return { { name = name, level = level } }
end

local scenarios = {}
local seed = settings.road_seed
for _, conditions in settings.conditions do
	local these = known[conditions]
	if not these then
		error(`conditions has "{conditions}", but there are only easy, standard and hard`, 0)
	end
	for _, light in these.lights do
		for _, markings in settings.markings do
			drives += 5
			for number, situation in situations do
				local speed = these.speeds[situation.speed]
				local simulator = {
					name = "lane",
					conditions = conditions,
					light = light,
					markings = markings,
					width = settings.width,
					height = settings.height,
					initial_speed = speed,
					autopilot = true,
					autopilot_swing = situation.swing,
					vehicle_ahead = if situation.ahead then 2 + situation.ahead * speed else 0,
					vehicle_ahead_speed = speed * (situation.share or 1),
				}
				for again = 1, settings.roads do
					local road = pdk.road({ seed = seed, limit = settings.limit, segment = these.segment, attempts = 1000 }).road
					-- Every third easy road goes up and down by two metres, with about 115 m from one crest to the next; the others
					-- have crests of their own.
					if conditions == "easy" and (number + again) % 3 == 0 then
						road.heights = {}
						for i in road.angles do
							road.heights[i] = 2 * (math.sin(1.36 * i + seed) - math.sin(seed))
						end
					end
					table.insert(scenarios, {
						name = `{conditions}, {light}, {markings}, road {seed}`,
						simulator = simulator,
						road = road,
						seed = seed,
						perturbations = through(),
					})
					seed += 1
				end
			end
		end
	end
end
pdk.drive({
	driver = "lane_keeper", -- not heeded
	duration = settings.duration,
	images_every = settings.images_every,
	scenarios = scenarios,
})
