-- The lowest level at which each perturbation makes a driver fail: all climb level by level until they fail. An error of a
-- component says nothing about the driver: it ends the climb without a failing level.
--
--   pdk run greedy
--   pdk run greedy --set perturbations=gaussian_noise,dirty_lens --set roads=3 --seed 7
--
-- Roads that the driver does not manage with a clear view are left out. greedy.json in the record holds what the table
-- shows.

local study = require("@pdk/study")

local settings = pdk.settings({
	simulator = "lane",
	driver = "dave2",
	perturbations = {}, -- none: the default set
	levels = { 0, 1, 2, 3, 4 },
	roads = 1, -- how many random roads
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	attempts = 1000, -- draws until a road is valid
	duration = 40, -- seconds of simulation time
	images_every = 10, -- every how many frames the record keeps an image; 0 for none
})

local names, levels = study.checked(settings, { "roads", "attempts" })
local driven, left_out = study.roads(settings)
if #driven == 0 then
	error("the driver managed no road without perturbation, so there is nothing to climb on", 0)
end

-- One climber for each road and perturbation; those still in the race are driven together, so that all cores work.
local climbers = {}
for _, place in driven do
	for _, name in names do
		table.insert(climbers, { road = place.number, map = place.road, perturbation = name, mean_cross_track_error = {} })
	end
end
local racing = climbers
for _, level in levels do
	if #racing == 0 then
		break
	end
	local scenarios = {}
	for _, climber in racing do
		table.insert(scenarios, {
			name = `{climber.perturbation}@{level}, road {climber.road}`,
			road = climber.map,
			perturbations = { { name = climber.perturbation, level = level } },
		})
	end
	local still = {}
	for i, outcome in study.drive(settings, scenarios) do
		local climber = racing[i]
		table.insert(climber.mean_cross_track_error, { level = level, metres = outcome.mean_cross_track_error })
		if outcome.success then
			table.insert(still, climber)
		elseif outcome.cause == "error" then
			climber.cause = "error"
			climber.error = outcome.error
		else
			climber.first_failing_level = level
			climber.cause = outcome.cause
		end
	end
	racing = still
end

local header = { "perturbation", "road", "fails at", "cause" }
for _, level in levels do
	table.insert(header, `|XTE| m @{level}`)
end
local rows = {}
for _, climber in climbers do
	local row: { any } = { climber.perturbation, climber.road, climber.first_failing_level or (if climber.error then "unknown" else "never"), (string.gsub(climber.cause or "", "_", " ")) }
	for i in levels do
		local reached = climber.mean_cross_track_error[i]
		table.insert(row, if reached then reached.metres else "")
	end
	table.insert(rows, row)
	climber.map = nil
end
pdk.table(header, rows)
local roads = {}
for _, place in driven do
	table.insert(roads, { number = place.number, road = place.road, nominal = place.mean_cross_track_error })
end
pdk.save("greedy.json", { results = climbers, roads = roads, left_out = left_out })
