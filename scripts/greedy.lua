-- The level at which each perturbation makes a driver fail every other time, found with few drives.
--
--   pdk run greedy
--   pdk run greedy --set perturbations=gaussian_noise,dirty_lens --set roads=10 --set seed=7
--   pdk run greedy --set search=climb --set levels=0,1,2,3,4 --set conditions=hard
--
-- On each road the levels are halved: first the highest, since most perturbations never make a driver fail, then halfway between
-- what it survived and what it failed. With search=climb all levels are driven from the lowest until the driver fails. The interval
-- comes from how roads differ, so it takes at least four of them. A perturbation that draws at random is driven several times on
-- each road. An error of a component says nothing about the driver: it ends the search on that road.
--
-- Roads that the driver does not manage with a clear view are left out. greedy.json in the record holds what the table shows, and
-- every drive.

local study = require("@pdk/study")

local settings = pdk.settings({
	simulator = "lane",
	conditions = "", -- of lane: easy, standard or hard; nothing: the simulator as it is
	driver = "dave2",
	perturbations = {}, -- none: the default set
	levels = { 0, 1, 2, 3, 4 }, -- the search goes from the first to the last, a climb takes each
	level_scale = "", -- the scale that they are on; none: the published one. What does not reach all levels is left out
	search = "bisect", -- or "climb"
	resolution = 0.25, -- how close a bisection comes
	roads = 8, -- how many random roads; fewer make intervals too narrow
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	segment = 0, -- length of its segments in metres; 0: what the conditions' speed calls for
	attempts = 1000, -- draws until a road is valid
	repeats = 3, -- how often a perturbation that draws at random is driven on each road
	duration = 60, -- seconds of simulation time
	failure = {}, -- what counts as a failure: see FailureCriteria
	confidence = 0.95, -- of the intervals
	images_every = 10, -- every how many frames the record keeps an image; 0 for none
})

local names, levels = study.checked(settings, { "roads", "attempts", "repeats" })
if settings.search ~= "bisect" and settings.search ~= "climb" then
	error(`search is {settings.search}, but has to be bisect or climb`, 0)
end
if settings.resolution <= 0 then
	error(`resolution is {settings.resolution}, but has to be above 0`, 0)
end
settings = study.in_conditions(settings, settings.conditions)
local driven, left_out = study.roads(settings, 1, settings.driver)
if #driven == 0 then
	error(study.nothing_managed(settings, "the driver", left_out), 0)
end

-- The level that a searcher drives next; nothing if it knows enough.
local function next_level(searcher): number?
	local trials = searcher.trials
	if settings.search == "bisect" and #levels > 1 then
		return pdk.next_level(trials, { lowest = levels[1], highest = levels[#levels], resolution = settings.resolution })
	end
	local last = trials[#trials]
	return if last and last.failed then nil else levels[#trials + 1]
end

-- One searcher for each road, perturbation and repeat; those still under way are driven together, so that all cores work.
local searchers = {}
for _, place in driven do
	for _, name in names do
		for again = 1, study.repeats(settings, name) do
			table.insert(searchers, { road = place, perturbation = name, again = again, trials = {}, outcomes = {} })
		end
	end
end
study.warn_of_luck(settings)
study.search(settings, searchers, next_level)

local header = { "perturbation", "fails at", "interval", "drives", "unsafe", "stopped", "late", "time to failure s", "errors" }
local rows, results = {}, {}
for _, name in names do
	-- On each road a list for each repeat.
	local by_road, roads, times = {}, {}, {}
	local counted = { unsafe = 0, stopped = 0, late = 0, errors = 0 }
	for _, searcher in searchers do
		if searcher.perturbation ~= name then
			continue
		end
		if not by_road[searcher.road] then
			by_road[searcher.road] = {}
			table.insert(roads, by_road[searcher.road])
		end
		table.insert(by_road[searcher.road], searcher.trials)
		for _, outcome in searcher.outcomes do
			if not outcome.success then
				counted[outcome.verdict] += 1
				table.insert(times, outcome.time)
			end
		end
		counted.errors += if searcher.error then 1 else 0
	end
	local found = pdk.failing_level(roads, settings.confidence)
	local result = {
		perturbation = name,
		failing_level = found,
		unsafe = counted.unsafe,
		stopped = counted.stopped,
		late = counted.late,
		errors = counted.errors,
		median_time_to_failure = study.median(times),
	}
	table.insert(results, result)
	local at, interval = "unknown", ""
	if found then
		at, interval = study.shown(found, levels[#levels])
	end
	table.insert(rows, {
		name,
		at,
		interval,
		if found then found.drives else 0,
		result.unsafe,
		result.stopped,
		result.late,
		result.median_time_to_failure or "",
		result.errors,
	} :: { any })
end
pdk.table(header, rows)

local searches = {}
for _, searcher in searchers do
	local drives = {}
	for i, outcome in searcher.outcomes do
		table.insert(drives, {
			level = searcher.trials[i].level,
			success = outcome.success,
			cause = outcome.cause,
			verdict = outcome.verdict,
			time = outcome.time,
			-- Of a drive that was cut short it is not comparable.
			mean_cross_track_error = if outcome.success then outcome.mean_cross_track_error else nil,
		})
	end
	table.insert(searches, {
		perturbation = searcher.perturbation,
		road = searcher.road.number,
		["repeat"] = searcher.again - 1,
		drives = drives,
		error = searcher.error,
	})
end
local roads = {}
for _, place in driven do
	table.insert(roads, { number = place.number, road = place.road, nominal = place.nominal[1] })
end
pdk.save("greedy.json", {
	driver = settings.driver,
	confidence = settings.confidence,
	results = results,
	searches = searches,
	roads = roads,
	left_out = left_out,
})
