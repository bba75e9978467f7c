-- Which perturbations break drivers: perturbations x drivers x conditions x random roads, ranked.
--
--   pdk run study
--   pdk run study --set drivers=dave2 --set conditions=standard --set perturbations=gaussian_noise,dirty_lens
--   pdk run study --set search=all --set roads=10 --set repeats=1
--   pdk run study --set simulator=donkey --set conditions= --set 'drivers=[{"name":"onnx","model":"pilot.onnx"}]'
--
-- On each road the highest level is driven first. Where the driver survives it, the levels below count as survived too; where it
-- does not, levels are halved until it is known from which one on it fails. So most drives go where the answer is open. With
-- search=all every level is driven, which also finds levels that are worse than those above them.
--
-- The ranking goes by the share of levels at which drivers fail: the mean over roads, conditions and drivers. Roads are the unit, and
-- one that is driven in several conditions or by several drivers is one: intervals come from how roads differ. Perturbations that
-- cannot be told apart share the number of their group; all pairs are tested together (see pdk.groups). Drivers are compared road by
-- road. Roads that a driver does not manage with a clear view are left out for it.
-- An error of a component says nothing about a driver and is counted apart.
--
-- A second table helps to distinguish perturbations under which no driver fails. The closeness of a drive at the highest level is its
-- largest |XTE| divided by the one at which the vehicle has left its lane, or 1 if the drive failed. Intervals and groups are of roads too.
--
-- ranking.json in the record holds what the tables show and more: the share of failing levels on each road, from which groups can be
-- computed again (pdk.groups), failures by level, and the level from which on each driver fails in each of the conditions, with intervals.

local study = require("@pdk/study")
local tally = require("@pdk/tally")

local settings = pdk.settings({
	simulator = "lane",
	conditions = { "easy", "standard", "hard" }, -- of lane; none: the simulator as it is
	drivers = { "dave2", "dave2_augmented", "dave2_temporal", "dave2_tub" }, -- the others are compared with the first
	perturbations = {}, -- none: the default set
	levels = { 0, 1, 2, 3, 4 },
	level_scale = "", -- the scale that the levels are on; none: the published one. What does not reach all levels is left out
	search = "bisect", -- or "all"
	roads = 8, -- how many random roads in each of the conditions; fewer than 4 leave the failing level open
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	segment = 0, -- length of its segments in metres; 0: what the conditions' speed calls for
	attempts = 1000, -- draws until a road is valid
	repeats = 2, -- how often a perturbation that draws at random is driven on each road, each time with other luck
	duration = 60, -- seconds of simulation time; a drive in hard conditions takes 33 with a clear view
	failure = {}, -- what counts as a failure: see FailureCriteria
	confidence = 0.95, -- of the intervals
	images_every = 0, -- every how many frames the record keeps an image; 0 for none
})

local names, levels = study.checked(settings, { "roads", "attempts", "repeats" })
if settings.search ~= "bisect" and settings.search ~= "all" then
	error(`search is {settings.search}, but has to be bisect or all`, 0)
end
if #settings.drivers == 0 then
	error("drivers is empty; name at least one", 0)
end
local percent = string.format("%g %%", 100 * settings.confidence)
local highest = levels[#levels]
-- The |XTE| in metres at which a vehicle has left its lane, if it is known: 2 in `lane`.
local simulator = study.simulator(settings)
local lane_departure: number? = settings.failure.lane_departure or simulator.lane_departure or (if simulator.name == "lane" then 2 else nil)

local function interval(estimate): string
	return string.format("%.2f to %.2f", estimate.low, estimate.high)
end

-- How close levels are to each other at least.
local finest = math.huge
for i = 2, #levels do
	finest = math.min(finest, levels[i] - levels[i - 1])
end

-- The level that is driven next on a road; nothing if enough is known.
local function next_level(searcher): number?
	if settings.search == "all" or #levels == 1 then
		return levels[#searcher.trials + 1]
	end
	local next = pdk.next_level(searcher.trials, { lowest = levels[1], highest = levels[#levels], resolution = finest })
	if not next then
		return nil
	end
	-- Only levels of the study are driven: of those between what was survived and what was failed, the nearest.
	local survived, failed = -math.huge, math.huge
	for _, trial in searcher.trials do
		if trial.failed then
			failed = math.min(failed, trial.level)
		else
			survived = math.max(survived, trial.level)
		end
	end
	local nearest: number?
	for _, level in levels do
		if level > survived and level < failed and (not nearest or math.abs(level - next) < math.abs(nearest - next)) then
			nearest = level
		end
	end
	return nearest
end

study.warn_of_luck(settings)

-- Drives all perturbations with a driver in some conditions.
local function measured(place)
	local searchers = {}
	for _, name in names do
		for _, road in place.roads do
			for again = 1, study.repeats(settings, name) do
				table.insert(searchers, { perturbation = name, road = road, again = again, trials = {}, outcomes = {} })
			end
		end
	end
	study.search(place.settings, searchers, next_level, place.driver)
	return searchers
end

-- The simulator in each of the conditions, and the roads that each driver manages there.
local in_conditions: { any } = if #settings.conditions > 0 then settings.conditions else { "" }
local places, nominal_rows, left_out = {}, {}, {}
for _, conditions in in_conditions do
	local these = study.in_conditions(settings, conditions)
	for _, driver in settings.drivers do
		local roads, without = study.roads(these, 1, driver)
		local errors, over_line = {}, 0
		for _, road in roads do
			table.insert(errors, road.nominal[1])
			over_line += if road.over_line[1] then 1 else 0
		end
		for _, road in without do
			table.insert(left_out, { conditions = conditions, driver = study.driver_name(driver), road = road.road, cause = road.cause })
		end
		table.insert(places, { conditions = conditions, driver = driver, name = study.driver_name(driver), settings = these, roads = roads })
		local mean = study.mean(errors)
		table.insert(nominal_rows, { conditions, study.driver_name(driver), `{#roads} of {settings.roads}`, over_line, mean or "" } :: { any })
	end
end
print("With a clear view")
pdk.table({ "conditions", "driver", "roads managed", "wheel over the line", "mean |XTE| m" }, nominal_rows)
local managed = 0
for _, place in places do
	managed += #place.roads
end
if managed == 0 then
	error(study.nothing_managed(settings, "the drivers", left_out), 0)
end

for _, place in places do
	place.results = if #place.roads > 0 then tally.results(measured(place), names, levels, settings.roads, lane_departure) else nil
end

-- Of a perturbation in the places that a test picks: see `tally.pooled`.
local function pooled(name: string, picks)
	return tally.pooled(places, name, settings.roads, picks)
end

-- The level from which on drivers fail in the places that a test picks.
local function failing_level(name: string, picks)
	local _, trials = pooled(name, picks)
	return pdk.failing_level(trials, settings.confidence)
end

local entries, not_driven = {}, {}
for _, name in names do
	local shares, _, closeness = pooled(name, function() return true end)
	local share = pdk.mean_share(shares, settings.confidence)
	if not share then
		table.insert(not_driven, name)
		continue
	end
	local close = tally.mean_closeness(closeness, settings.confidence)
	local entry: { [string]: any } = {
		perturbation = name,
		shares = shares,
		failed_share = share.value,
		failed_share_low = share.low,
		failed_share_high = share.high,
		closeness_by_road = closeness,
		closeness = if close then close.value else nil,
		closeness_low = if close then close.low else nil,
		closeness_high = if close then close.high else nil,
		by_driver = {},
		by_conditions = {},
		cells = {},
	}
	local times, increases = {}, {}
	for _, place in places do
		local of = place.results and place.results[name]
		if not of then
			continue
		end
		table.move(of.times, 1, #of.times, #times + 1, times)
		table.move(of.increases, 1, #of.increases, #increases + 1, increases)
		local by_level = {}
		for i, level in levels do
			local here = study.known(of.by_level[i])
			table.insert(by_level, { level = level, roads = #here, failed_share = study.mean(here) })
		end
		local _, _, closeness_here = pooled(name, function(other) return other == place end)
		local cell: { [string]: any } = {
			conditions = place.conditions,
			driver = place.name,
			failing_level = failing_level(name, function(other) return other == place end),
			median_time_to_failure = study.median(of.times),
			mean_cross_track_error_increase = study.mean(of.increases),
			closeness = study.mean(study.known(closeness_here)),
			by_level = by_level,
		}
		for _, count in tally.counts do
			cell[count] = of[count]
			entry[count] = (entry[count] or 0) + of[count]
		end
		table.insert(entry.cells, cell)
	end
	for _, driver in settings.drivers do
		local found = failing_level(name, function(place) return place.driver == driver end)
		table.insert(entry.by_driver, { driver = study.driver_name(driver), failing_level = found })
	end
	for _, conditions in in_conditions do
		local found = failing_level(name, function(place) return place.conditions == conditions end)
		table.insert(entry.by_conditions, { conditions = conditions, failing_level = found })
	end
	entry.median_time_to_failure = study.median(times)
	entry.mean_cross_track_error_increase = study.mean(increases)
	table.insert(entries, entry)
end
table.sort(entries, function(a, b)
	if a.failed_share ~= b.failed_share then
		return a.failed_share > b.failed_share
	end
	-- Where nothing came to the end, there is no mean.
	local of_a, of_b = a.mean_cross_track_error_increase or math.huge, b.mean_cross_track_error_increase or math.huge
	if of_a ~= of_b then
		return of_a > of_b
	end
	return a.perturbation < b.perturbation
end)
local in_order = {}
for _, entry in entries do
	table.insert(in_order, entry.shares)
end
local groups = pdk.groups(in_order, settings.confidence)

local header = { "rank", "group", "perturbation", "failing levels", percent }
for _, driver in settings.drivers do
	table.insert(header, `{study.driver_name(driver)} fails at`)
end
table.insert(header, "time to failure s")
table.insert(header, "over the line")
table.insert(header, `|XTE| increase at level {highest}, m`)
local rows = {}
for rank, entry in entries do
	entry.rank, entry.group = rank, groups[rank]
	local row: { any } = { rank, entry.group, entry.perturbation, entry.failed_share, string.format("%.2f to %.2f", entry.failed_share_low, entry.failed_share_high) }
	for _, of in entry.by_driver do
		table.insert(row, if of.failing_level then (study.shown(of.failing_level, highest)) else "unknown")
	end
	table.insert(row, entry.median_time_to_failure or "")
	table.insert(row, `{entry.over_line} of {entry.drives - entry.failures}`)
	table.insert(row, entry.mean_cross_track_error_increase or "")
	table.insert(rows, row)
end
print("Perturbations, by the share of levels at which drivers fail")
pdk.table(header, rows)
if #not_driven > 0 then
	print(`Not ranked, because a component failed in every scenario: {table.concat(not_driven, ", ")}`)
end

-- How close drives at the highest level came to failing, the closest first, among them drives with a clear view.
local function with_a_clear_view()
	local by_road = {}
	for number = 1, settings.roads do
		local here = {}
		for _, place in places do
			for _, road in place.roads do
				if road.number == number then
					table.insert(here, tally.closeness(road.outcomes[1], lane_departure :: number))
				end
			end
		end
		by_road[number] = (study.mean(here) or false) :: any
	end
	local close = tally.mean_closeness(by_road, settings.confidence)
	return { perturbation = "a clear view", closeness_by_road = by_road, closeness = close.value, closeness_low = close.low, closeness_high = close.high }
end
local clear_view: any = nil
if lane_departure then
	clear_view = with_a_clear_view()
	local by_closeness = { clear_view }
	for _, entry in entries do
		if entry.closeness then
			table.insert(by_closeness, entry)
		end
	end
	table.sort(by_closeness, function(a, b)
		if a.closeness ~= b.closeness then
			return a.closeness > b.closeness
		end
		return a.perturbation < b.perturbation
	end)
	in_order = {}
	for _, entry in by_closeness do
		table.insert(in_order, entry.closeness_by_road)
	end
	rows = {}
	for place, group in pdk.groups(in_order, settings.confidence) do
		local entry = by_closeness[place]
		entry.closeness_group = group
		table.insert(rows, { group, entry.perturbation, entry.closeness, string.format("%.2f to %.2f", entry.closeness_low, entry.closeness_high) } :: { any })
	end
	print(`How close drives came to failing at level {highest}: their largest |XTE| divided by {lane_departure} m, or 1 if they failed`)
	pdk.table({ "group", "perturbation", "closeness", percent }, rows)
else
	print(`How close drives came to failing is not known: set failure.lane_departure to the |XTE| in metres at which a vehicle has left its lane in {simulator.name}`)
end

-- Each of the conditions and drivers at each level: the share of roads and perturbations that fail.
local totals, total_rows = {}, {}
for _, place in places do
	if not place.results then
		continue
	end
	local row: { any } = { place.conditions, place.name }
	local between = 0
	local by_level = {}
	for i, level in levels do
		local of_names = {}
		for _, name in names do
			local share = study.mean(study.known(place.results[name].by_level[i]))
			if share then
				table.insert(of_names, share)
				between += if share > 0 and share < 1 then 1 else 0
			end
		end
		local share = study.mean(of_names)
		table.insert(by_level, { level = level, failed_share = share })
		table.insert(row, share or "")
	end
	between /= #names * #levels
	table.insert(row, between)
	table.insert(totals, { conditions = place.conditions, driver = place.name, by_level = by_level, between = between })
	table.insert(total_rows, row)
end
header = { "conditions", "driver" }
for _, level in levels do
	table.insert(header, `fail at {level}`)
end
table.insert(header, "cells between 0 and 1")
print("Share of perturbations and roads that fail, by level")
pdk.table(header, total_rows)

-- The first driver's share of failing levels less that of each other, road by road, over all perturbations.
local comparisons, compared_rows = {}, {}
local function over_perturbations(driver)
	local sums = {}
	for _, name in names do
		for i, share in (pooled(name, function(place) return place.driver == driver end)) do
			sums[i] = sums[i] or {}
			if share then
				table.insert(sums[i], share)
			end
		end
	end
	local shares = {}
	for i, on_road in sums do
		shares[i] = (study.mean(on_road) or false) :: any
	end
	return shares
end
for i = 2, #settings.drivers do
	local first, other = settings.drivers[1], settings.drivers[i]
	local paired = pdk.compare(over_perturbations(first), over_perturbations(other), settings.confidence)
	if paired then
		local name = study.driver_name(other)
		table.insert(comparisons, { driver = study.driver_name(first), against = name, paired = paired })
		table.insert(compared_rows, { name, paired.difference.value, interval(paired.difference), paired.effect_size, paired.p, paired.roads } :: { any })
	end
end
if #compared_rows > 0 then
	print(`The share of levels at which {study.driver_name(settings.drivers[1])} fails less that of the others, road by road`)
	pdk.table({ "driver", "difference", percent, "effect size", "p", "roads" }, compared_rows)
end

local nominal = {}
for _, place in places do
	local roads = {}
	for _, road in place.roads do
		table.insert(roads, { road = road.number, seed = road.seed, angles = road.angles, mean_cross_track_error = road.nominal[1], over_line = road.over_line[1] })
	end
	table.insert(nominal, { conditions = place.conditions, driver = place.name, roads = roads })
end
pdk.save("ranking.json", {
	simulator = settings.simulator,
	conditions = settings.conditions,
	drivers = settings.drivers,
	levels = levels,
	roads = settings.roads,
	confidence = settings.confidence,
	nominal = nominal,
	clear_view = clear_view,
	lane_departure = lane_departure,
	ranking = entries,
	by_level = totals,
	comparisons = comparisons,
	left_out = left_out,
	not_driven = not_driven,
})
