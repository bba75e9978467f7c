-- Which perturbations degrade a driver most: perturbations x levels x random roads, ranked.
--
--   pdk run study
--   pdk run study --set perturbations=gaussian_noise,dirty_lens --set levels=0,2,4 --set roads=4
--   pdk run study --set against=dave2_augmented
--
-- The ranking goes by the share of scenarios that failed, then by how much the mean |XTE| of those that did not grew over that
-- of the same road with a clear view. Roads are the unit: intervals come from how roads differ, and perturbations that cannot be
-- told from the first of their group share its number. A perturbation that draws at random is driven several times at each level on
-- each road. Roads that a driver does not manage with a clear view are left out. ranking.json in the record holds what the tables
-- show, and failures by level and by road. With `against` another driver is driven too, and compared road by road.

local study = require("@pdk/study")

local settings = pdk.settings({
	simulator = "lane",
	driver = "dave2",
	against = "", -- another driver to compare with; none where it is empty
	perturbations = {}, -- none: the default set
	levels = { 0, 1, 2, 3, 4 },
	roads = 10, -- how many random roads
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	segment = 25, -- length of its segments in metres: 37.5 and 50 match the speeds of the conditions standard and hard of lane
	attempts = 1000, -- draws until a road is valid
	repeats = 3, -- how often a perturbation that draws at random is driven at each level on each road
	duration = 30, -- seconds of simulation time
	failure = {}, -- what counts as a failure: see FailureCriteria
	confidence = 0.95, -- of the intervals
	images_every = 0, -- every how many frames the record keeps an image; 0 for none
})

local names, levels = study.checked(settings, { "roads", "attempts", "repeats" })
local drivers: { any } = { settings.driver }
if settings.against ~= "" then
	table.insert(drivers, settings.against)
end
local most = 1
for _, name in names do
	most = math.max(most, study.repeats(settings, name))
end
local driven, left_out = study.roads(settings, most, drivers)
if #driven == 0 then
	error("no road was managed without perturbation, so there is nothing to compare with", 0)
end

-- Counts of drives that say something about the driver.
local function counts()
	return { scenarios = 0, failures = 0, unsafe = 0, stopped = 0, times = {} }
end
local function count(into, outcome)
	into.scenarios += 1
	if not outcome.success then
		into.failures += 1
		into[outcome.verdict] += 1
		table.insert(into.times, outcome.time)
	end
end

-- Whether drives failed, in a list for each road, and the same with the level.
local function lists()
	local made = {}
	for i in driven do
		made[i] = {}
	end
	return made
end

-- Drives all perturbations with a driver, and returns what came of each by its name.
local function measured(driver)
	local scenarios, of, by_name = {}, {}, {}
	for _, name in names do
		local entry = { all = counts(), errors = 0, by_level = {}, trials = lists(), failed = lists(), increases = lists() }
		by_name[name] = entry
		for _, level in levels do
			entry.by_level[level] = { counted = counts(), failed = lists() }
			for place, road in driven do
				for again = 1, study.repeats(settings, name) do
					table.insert(scenarios, {
						name = study.called(`{name}@{level}`, road.number, again),
						road = road.road,
						["repeat"] = again - 1, -- luck of its own for each
						perturbations = { { name = name, level = level } },
					})
					table.insert(of, { entry = entry, level = level, place = place, nominal = road.nominal[again] })
				end
			end
		end
	end
	for i, outcome in study.drive(settings, scenarios, driver) do
		local entry, level, place = of[i].entry, of[i].level, of[i].place
		if outcome.cause == "error" then
			-- A component failed, which says nothing about the driver.
			entry.errors += 1
			continue
		end
		local failed = not outcome.success
		count(entry.all, outcome)
		count(entry.by_level[level].counted, outcome)
		table.insert(entry.by_level[level].failed[place], failed)
		table.insert(entry.failed[place], failed)
		table.insert(entry.trials[place], { level = level, failed = failed })
		if not failed then
			table.insert(entry.increases[place], outcome.mean_cross_track_error - of[i].nominal)
		end
	end
	return by_name
end

local by_name = measured(settings.driver)
local entries, not_driven = {}, {}
for _, name in names do
	local found = by_name[name]
	if found.all.scenarios == 0 then
		table.insert(not_driven, name)
		continue
	end
	local share = pdk.failed_share(found.failed, settings.confidence)
	local increases = {}
	for _, on_road in found.increases do
		if #on_road > 0 then
			table.insert(increases, study.mean(on_road))
		end
	end
	local increase = pdk.mean(increases, settings.confidence)
	local by_level = {}
	for _, level in levels do
		local at = found.by_level[level]
		local estimate = pdk.failed_share(at.failed, settings.confidence)
		table.insert(by_level, {
			level = level,
			scenarios = at.counted.scenarios,
			failures = at.counted.failures,
			unsafe = at.counted.unsafe,
			stopped = at.counted.stopped,
			failed_share = estimate and estimate.value,
			failed_share_low = estimate and estimate.low,
			failed_share_high = estimate and estimate.high,
			median_time_to_failure = study.median(at.counted.times),
		})
	end
	local by_road = {}
	for i, failed in found.failed do
		local failures = 0
		for _, one in failed do
			failures += if one then 1 else 0
		end
		table.insert(by_road, { road = driven[i].number, scenarios = #failed, failures = failures })
	end
	table.insert(entries, {
		perturbation = name,
		scenarios = found.all.scenarios,
		failures = found.all.failures,
		unsafe = found.all.unsafe,
		stopped = found.all.stopped,
		errors = found.errors,
		failed_share = share.value,
		failed_share_low = share.low,
		failed_share_high = share.high,
		failing_level = pdk.failing_level(found.trials, settings.confidence),
		median_time_to_failure = study.median(found.all.times),
		mean_cross_track_error_increase = increase and increase.value,
		mean_cross_track_error_increase_low = increase and increase.low,
		mean_cross_track_error_increase_high = increase and increase.high,
		by_level = by_level,
		by_road = by_road,
	})
end
table.sort(entries, function(a, b)
	if a.failed_share ~= b.failed_share then
		return a.failed_share > b.failed_share
	end
	-- Where nothing came to the end, there is no mean.
	local of_a = a.mean_cross_track_error_increase or math.huge
	local of_b = b.mean_cross_track_error_increase or math.huge
	if of_a ~= of_b then
		return of_a > of_b
	end
	return a.perturbation < b.perturbation
end)
local in_order = {}
for _, entry in entries do
	table.insert(in_order, study.shares(by_name[entry.perturbation].failed))
end
local groups = pdk.groups(in_order, settings.confidence)

local percent = string.format("%g %%", 100 * settings.confidence)
local header = { "rank", "group", "perturbation", "failed", "share", percent, "unsafe", "stopped", "fails at", percent, "time to failure s", "|XTE| increase m" }
local rows = {}
for rank, entry in entries do
	entry.rank = rank
	entry.group = groups[rank]
	local at, interval = study.shown(entry.failing_level, levels[#levels])
	table.insert(rows, {
		rank,
		entry.group,
		entry.perturbation,
		`{entry.failures} of {entry.scenarios}`,
		entry.failed_share,
		string.format("%.3f to %.3f", entry.failed_share_low, entry.failed_share_high),
		entry.unsafe,
		entry.stopped,
		at,
		interval,
		entry.median_time_to_failure or "",
		entry.mean_cross_track_error_increase or "",
	} :: { any })
end
pdk.table(header, rows)
if #not_driven > 0 then
	print(`Not ranked, because a component failed in every scenario: {table.concat(not_driven, ", ")}`)
end

local totals, by_level = {}, {}
for i, level in levels do
	local scenarios, failures, unsafe, stopped, failed = 0, 0, 0, 0, lists()
	for _, entry in entries do
		local at = entry.by_level[i]
		scenarios += at.scenarios
		failures += at.failures
		unsafe += at.unsafe
		stopped += at.stopped
		for place, on_road in by_name[entry.perturbation].by_level[level].failed do
			for _, one in on_road do
				table.insert(failed[place], one)
			end
		end
	end
	local share = pdk.failed_share(failed, settings.confidence)
	if share then
		table.insert(totals, { level, `{failures} of {scenarios}`, unsafe, stopped, share.value, string.format("%.3f to %.3f", share.low, share.high) } :: { any })
		table.insert(by_level, { level = level, scenarios = scenarios, failures = failures, unsafe = unsafe, stopped = stopped, failed_share = share.value, failed_share_low = share.low, failed_share_high = share.high })
	end
end
if #totals > 0 then
	pdk.table({ "level", "failed", "unsafe", "stopped", "share", percent }, totals)
end

-- The share that failed with this driver less that with the other, road by road.
local comparison = nil
if settings.against ~= "" then
	local other = measured(settings.against)
	local shown = {}
	comparison = {}
	for _, entry in entries do
		local paired = pdk.compare(study.shares(by_name[entry.perturbation].failed), study.shares(other[entry.perturbation].failed), settings.confidence)
		if paired then
			table.insert(comparison, { perturbation = entry.perturbation, paired = paired })
			local difference = paired.difference
			table.insert(shown, {
				entry.perturbation,
				difference.value,
				string.format("%.3f to %.3f", difference.low, difference.high),
				paired.effect_size,
				paired.p,
				paired.roads,
			} :: { any })
		end
	end
	print(`Failed share of the driver less that of {settings.against}, road by road`)
	pdk.table({ "perturbation", "difference", percent, "effect size", "p", "roads" }, shown)
end

local roads = {}
for _, place in driven do
	table.insert(roads, {
		road = place.number,
		seed = place.seed,
		angles = place.angles,
		nominal_mean_cross_track_error = place.nominal[1],
	})
end
pdk.save("ranking.json", {
	simulator = settings.simulator,
	driver = settings.driver,
	against = if settings.against ~= "" then settings.against else nil,
	ranking = entries,
	by_level = by_level,
	comparison = comparison,
	confidence = settings.confidence,
	roads = roads,
	left_out = left_out,
	not_driven = not_driven,
})
