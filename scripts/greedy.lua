-- The lowest level at which each perturbation makes a driver fail. An error of a component says nothing about the driver: it ends
-- the climb without a failing level.
--
--   pdk run scripts/greedy.lua
--   pdk run scripts/greedy.lua --set perturbations=gaussian_noise,dirty_lens --set roads=3 --seed 7
--   pdk run scripts/greedy.lua --set method=bisection --set repeats=5
--
-- With `method=levels` all climb level by level until they fail. With `method=bisection` the levels lie between the first and the last
-- of `levels`, and the interval in which the driver begins to fail is halved until it is as short as `precision`: far fewer drives
-- than all levels that far apart. That takes for granted that whoever fails at a level fails above it, which holds for most
-- perturbations; where it does not, some level at which failing begins is found, maybe not the lowest. With `repeats` each level is
-- driven so often, each time under new luck, and it fails where at least half of the drives do: so bisection finds the lowest level
-- at which the driver fails with a probability of 1/2.
--
-- Roads that the driver does not manage with a clear view are left out. greedy.json in the record holds what the table
-- shows.

local study = require("@pdk/study")

local settings = pdk.settings({
	simulator = "lane",
	driver = "dave2",
	perturbations = {}, -- none: the default set
	method = "levels", -- or "bisection"
	levels = { 0, 1, 2, 3, 4 },
	precision = 0.25, -- with bisection: how far apart levels are in the end
	repeats = 1, -- how often each level is driven
	z = 1.96, -- standard deviations of the interval of a probability: 1.96 for 95 %
	roads = 1, -- how many random roads
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	attempts = 1000, -- draws until a road is valid
	duration = 40, -- seconds of simulation time
	images_every = 10, -- every how many frames the record keeps an image; 0 for none
})

local names, levels = study.checked(settings, { "roads", "attempts", "repeats" })
if settings.method ~= "levels" and settings.method ~= "bisection" then
	error(`method is {settings.method}, but has to be levels or bisection`, 0)
end
if settings.precision <= 0 then
	error(`precision is {settings.precision}, but has to be more than 0`, 0)
end
local driven, left_out = study.roads(settings)
if #driven == 0 then
	error("the driver managed no road without perturbation, so there is nothing to climb on", 0)
end

-- The level that a climber drives next; nothing where it has come to its end.
local function next_level(climber): number?
	local low, high = levels[1], levels[#levels]
	if climber.cause == "error" then
		return nil
	elseif settings.method == "levels" then
		return if climber.first_failing_level then nil else levels[#climber.driven + 1]
	elseif not climber.highest_passing_level and not climber.first_failing_level then
		return high
	elseif not climber.first_failing_level or climber.first_failing_level <= low then
		return nil
	elseif not climber.highest_passing_level then
		return low
	elseif climber.first_failing_level - climber.highest_passing_level <= settings.precision then
		return nil
	end
	return (climber.highest_passing_level + climber.first_failing_level) / 2
end

-- What a climber learns from the drives at a level.
local function learn(climber, level: number, outcomes)
	local failures, metres, cause = 0, 0, nil
	for _, outcome in outcomes do
		if outcome.cause == "error" then
			climber.cause, climber.error = "error", outcome.error
			return
		end
		metres += outcome.mean_cross_track_error / #outcomes
		if not outcome.success then
			failures += 1
			cause = cause or outcome.cause
		end
	end
	table.insert(climber.driven, { level = level, metres = metres, failures = failures, drives = #outcomes })
	if 2 * failures >= #outcomes then
		climber.first_failing_level, climber.cause = level, cause
		climber.failed_share = failures / #outcomes
		climber.failed_share_low, climber.failed_share_high = study.wilson(failures, #outcomes, settings.z)
	else
		climber.highest_passing_level = level
	end
end

-- One climber for each road and perturbation; those still in the race are driven together, so that all cores work.
local climbers = {}
for _, place in driven do
	for _, name in names do
		table.insert(climbers, { road = place.number, map = place.road, perturbation = name, driven = {} })
	end
end
while true do
	local scenarios, racing = {}, {}
	for _, climber in climbers do
		local level = next_level(climber)
		if level then
			table.insert(racing, { climber = climber, level = level })
			for number = 1, settings.repeats do
				local again = if settings.repeats > 1 then `, repeat {number}` else ""
				table.insert(scenarios, {
					name = `{climber.perturbation}@{level}, road {climber.road}{again}`,
					road = climber.map,
					["repeat"] = number - 1, -- luck of its own for each
					perturbations = { { name = climber.perturbation, level = level } },
				})
			end
		end
	end
	if #racing == 0 then
		break
	end
	local outcomes = study.drive(settings, scenarios)
	for place, racer in racing do
		local last = place * settings.repeats
		learn(racer.climber, racer.level, table.move(outcomes, last - settings.repeats + 1, last, 1, {}))
	end
end

local detailed = settings.method == "bisection" or settings.repeats > 1
local header = { "perturbation", "road", "fails at", "cause" }
if detailed then
	table.insert(header, "probability")
	table.insert(header, "drives")
end
if settings.method == "levels" then
	for _, level in levels do
		table.insert(header, `|XTE| m @{level}`)
	end
end
local rows = {}
for _, climber in climbers do
	local drives = 0
	for _, reached in climber.driven do
		drives += reached.drives
	end
	local row: { any } = {
		climber.perturbation,
		climber.road,
		climber.first_failing_level or (if climber.error then "unknown" else "never"),
		(string.gsub(climber.cause or "", "_", " ")),
	}
	if detailed then
		local share, low, high = climber.failed_share, climber.failed_share_low, climber.failed_share_high
		table.insert(row, if share then string.format("%.2f (%.2f to %.2f)", share, low, high) else "")
		table.insert(row, drives)
	end
	if settings.method == "levels" then
		for i in levels do
			local reached = climber.driven[i]
			table.insert(row, if reached then reached.metres else "")
		end
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
