-- What studies on random roads share: the settings that they check alike, and the nominal drives, which say on which roads the
-- driver can be tested at all.
--
--   local study = require("@pdk/study")

local study = {}

-- Each value once, in the order in which they come.
local function once<T>(values: { T }): { T }
	local kept, seen = {}, {}
	for _, value in values do
		if not seen[value] then
			seen[value] = true
			table.insert(kept, value)
		end
	end
	return kept
end

-- Refuses a setting that is not a whole number of at least 1, at the pipeline, which is this many callers away.
function study.count(settings, name: string, callers: number?)
	local count = settings[name]
	if count < 1 or count % 1 ~= 0 then
		error(`{name} is {count}, but has to be a whole number of at least 1`, (callers or 1) + 1)
	end
end

-- The perturbations and the levels of a study, each once and the levels in order. `counts` names the settings that have to be whole
-- numbers of at least 1. If no perturbations are set, it is the default set. They are checked before anything is driven.
function study.checked(settings, counts: { string }): ({ string }, { number })
	local names = once(settings.perturbations)
	if #names == 0 then
		names = pdk.perturbations()
	end
	local levels = once(settings.levels)
	table.sort(levels)
	for _, name in counts do
		study.count(settings, name, 2)
	end
	if #levels == 0 then
		error("levels is empty; name at least one from 0 to 4", 2)
	end
	for _, level in { levels[1], levels[#levels] } do
		if level < 0 or level > 4 then
			error(`levels has {level}, but intensities go from 0 to 4`, 2)
		end
	end
	for _, name in names do
		-- Says so where there is no such perturbation.
		pdk.draws(name)
	end
	names = study.reaching(names, levels, rawget(settings, "level_scale") or "")
	if settings.confidence <= 0 or settings.confidence >= 1 then
		error(`confidence is {settings.confidence}, but has to be between 0 and 1, such as 0.95`, 2)
	end
	return names, levels
end

-- The perturbations that reach all levels on a scale; the others are left out, because their shares could not be compared. With "" the
-- levels are the published ones, which all have.
function study.reaching(names: { string }, levels: { number }, level_scale: string): { string }
	if level_scale == "" then
		return names
	end
	local reaching, left_out = {}, {}
	for _, name in names do
		local reach = pdk.reach(name, level_scale)
		if reach and reach[1] <= levels[1] and reach[2] >= levels[#levels] then
			table.insert(reaching, name)
		else
			table.insert(left_out, name)
		end
	end
	if #left_out > 0 then
		print(`Left out, because {level_scale} does not have all of levels {levels[1]} to {levels[#levels]} for them: {table.concat(left_out, ", ")}`)
	end
	if #reaching == 0 then
		error(`no perturbation reaches levels {levels[1]} to {levels[#levels]} of {level_scale}; set other levels`, 3)
	end
	return reaching
end

-- How often a perturbation is driven at a level on a road: as often as `repeats` says where it draws anything at random, else once.
function study.repeats(settings, name: string): number
	return if pdk.draws(name) then settings.repeats else 1
end

-- What a drive is called in tables; the first of several has no number.
function study.called(what: string, road: number, again: number): string
	local name = `{what}, road {road}`
	return if again > 1 then `{name}, repeat {again}` else name
end

-- The length of a road's segments in metres that matches the speed at which drivers go in the conditions of `lane`.
local segments = { easy = 25, standard = 37.5, hard = 50 }

-- The simulator that is set, as a table with its name.
function study.simulator(settings): any
	return if type(settings.simulator) == "table" then settings.simulator else { name = settings.simulator }
end

-- The settings for some conditions of the simulator: as they are where it is left as it is, with "".
function study.in_conditions(settings, conditions: string)
	local these = table.clone(settings)
	if conditions ~= "" then
		local simulator = table.clone(study.simulator(settings))
		simulator.conditions = conditions
		these.simulator = simulator
	end
	if settings.segment == 0 then
		these.segment = segments[conditions] or segments.easy
	end
	return these
end

-- What a driver is called in tables: its name, or the file of its network.
function study.driver_name(driver): string
	return if type(driver) == "table" then driver.model or driver.name else driver
end

-- A perturbation at a level of the scale that is set; without one, of the published scale.
function study.applied(settings, name: string, level: number)
	local scale = rawget(settings, "level_scale") or ""
	return { name = name, level = level, level_scale = if scale ~= "" then scale else nil }
end

-- Drives scenarios with the simulator that is set and a driver.
function study.drive(settings, scenarios, driver)
	return pdk.drive({
		simulator = settings.simulator,
		driver = driver or settings.driver,
		duration = settings.duration,
		failure = settings.failure,
		images_every = settings.images_every,
		scenarios = scenarios,
	})
end

-- Searches on, each time at the level that `next_level` says, until it has none for any searcher; those still under way are driven
-- together, so that all cores work. A searcher has a `road` as `study.roads` gives it, a `perturbation` and the number of its repeat,
-- `again`; it gets its `trials` and their `outcomes`. An error of a component says nothing about the driver: it becomes the
-- searcher's `error` and ends it.
function study.search(settings, searchers, next_level, driver)
	while true do
		local scenarios, under_way = {}, {}
		for _, searcher in searchers do
			local level = if searcher.error then nil else next_level(searcher)
			if level then
				table.insert(under_way, { searcher = searcher, level = level })
				table.insert(scenarios, {
					name = study.called(`{searcher.perturbation}@{level}`, searcher.road.number, searcher.again),
					road = searcher.road.road,
					["repeat"] = searcher.again - 1,
					perturbations = { study.applied(settings, searcher.perturbation, level) },
				})
			end
		end
		if #scenarios == 0 then
			return
		end
		for i, outcome in study.drive(settings, scenarios, driver) do
			local searcher = under_way[i].searcher
			if outcome.cause == "error" then
				searcher.error = outcome.error
				continue
			end
			table.insert(searcher.trials, { level = under_way[i].level, failed = not outcome.success })
			table.insert(searcher.outcomes, outcome)
		end
	end
end

-- Says how far a bisection may be off in a simulator that may end drives under the same draws differently. `lane` does not.
function study.warn_of_luck(settings)
	local simulator = study.simulator(settings).name
	if rawget(settings, "search") == "bisect" and simulator ~= "lane" then
		print(
			`If each drive in {simulator} has luck of its own, the levels that bisection finds are off by up to a quarter of a level; `
				.. "the pipeline study with search=all drives all levels"
		)
	end
end

-- A driver and where it drives, as sentences have it.
local function place(settings, driver): string
	local conditions = study.simulator(settings).conditions
	return study.driver_name(driver) .. if conditions then ` in {conditions}` else ""
end

-- Makes the random roads that are set and drives each with a clear view, `repeats` times, with a driver. Returns those that it
-- manages every time, each with its number, seed, angles and road, and with each drive's outcome, its mean |XTE| and whether a wheel was
-- over the line; and the number of each other road with what ended the drive there.
function study.roads(settings, repeats: number, driver)
	local roads, scenarios, of = {}, {}, {}
	for number = 1, settings.roads do
		local seed = settings.road_seed + number - 1
		local made = pdk.road({ seed = seed, limit = settings.limit, segment = settings.segment, attempts = settings.attempts })
		table.insert(roads, { number = number, seed = seed, angles = made.angles, road = made.road, nominal = {}, outcomes = {}, over_line = {} })
	end
	for again = 1, repeats do
		for _, road in roads do
			table.insert(scenarios, { name = study.called("nominal", road.number, again), road = road.road, ["repeat"] = again - 1 })
			table.insert(of, road)
		end
	end
	local outcomes = study.drive(settings, scenarios, driver)
	local broken, causes = {}, {}
	for i, outcome in outcomes do
		local road = of[i]
		if outcome.error then
			table.insert(broken, outcome.error)
		end
		if outcome.success then
			table.insert(road.nominal, outcome.mean_cross_track_error)
			table.insert(road.outcomes, outcome)
			table.insert(road.over_line, outcome.measures.over_line_seconds > 0)
		else
			causes[road.number] = causes[road.number] or outcome.cause
		end
	end
	-- That is not the driver's doing.
	if #broken == #outcomes and #broken > 0 then
		error(broken[1], 0)
	end
	local driven, left_out, told = {}, {}, {}
	for _, road in roads do
		local cause = causes[road.number]
		if cause then
			table.insert(left_out, { road = road.number, cause = cause })
			table.insert(told, `{road.number} ({cause})`)
		else
			table.insert(driven, road)
		end
	end
	if #told > 0 then
		print(
			`{place(settings, driver)} fails {#told} of {#roads} roads without any perturbation, so they are left out: `
				.. `road {table.concat(told, ", ")}`
		)
	end
	return driven, left_out
end

-- The message if no driver managed any road: what ended the drives, and what to do.
function study.nothing_managed(settings, who: string, left_out): string
	local late = #left_out > 0
	for _, road in left_out do
		late = late and road.cause == "time_out"
	end
	local remedy = if late then `raise duration, which is {settings.duration} s` else `set another driver, or a smaller limit than {settings.limit} degrees, which makes the roads easier`
	return `{who} managed no road without perturbation, so there is nothing to test on; {remedy}`
end

-- The values that are known, of some that are false where they are not.
function study.known(values): { number }
	local known = {}
	for _, value in values do
		if value then
			table.insert(known, value)
		end
	end
	return known
end

-- The mean of some numbers; nothing if there are none.
function study.mean(values: { number }): number?
	local sum = 0
	for _, value in values do
		sum += value
	end
	return if #values > 0 then sum / #values else nil
end

-- The share of drives that failed on each road, of lists that say of each drive whether it failed; false where nothing says it.
function study.shares(failed): { number | false }
	local by_road = {}
	for place, drives in failed do
		local ones = {}
		for _, one in drives do
			table.insert(ones, if one then 1 else 0)
		end
		by_road[place] = study.mean(ones) or false
	end
	return by_road
end

-- The one in the middle of some numbers, the mean of two where they are even; nothing if there are none.
function study.median(values: { number }): number?
	local sorted = table.clone(values)
	table.sort(sorted)
	local half = #sorted // 2
	if #sorted == 0 then
		return nil
	end
	return if #sorted % 2 == 1 then sorted[half + 1] else (sorted[half] + sorted[half + 1]) / 2
end

-- A failing level with its interval, as tables have it.
function study.shown(found, highest: number): (string, string)
	local function end_of(level: number?): string
		return if level then string.format("%.2f", level) else `above {highest}`
	end
	local interval = if found.low then `{end_of(found.low)} to {end_of(found.high)}` else end_of(nil)
	return if found.level then end_of(found.level) else "never", interval
end

return study
