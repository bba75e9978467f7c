-- What came of perturbations on random roads: sums over the drives of each, with a driver in some conditions and over several of these.
--
--   local tally = require("@pdk/tally")

local study = require("@pdk/study")

local tally = {}

-- What is counted of a perturbation.
tally.counts = { "drives", "failures", "unsafe", "stopped", "late", "over_line", "errors" }

-- What came of one perturbation with a driver in some conditions. For each road: the share of levels that fail, in `shares`, false
-- where that is unknown; of each level the share of drives that fail, in `by_level`; and the drives of each searcher, in `trials`.
-- Then counts, among which `over_line` is of drives that came to the end with a wheel over the line on the way, times to failure, how
-- much more |XTE| there was at the highest level than with a clear view, and for each road how close each drive there at the highest
-- level came to failing, in `closeness`.
local function empty(levels: { number })
	local entry: { [string]: any } = {
		trials = {},
		shares = {},
		by_level = {},
		times = {},
		increases = {},
		closeness = {},
	}
	for _, count in tally.counts do
		entry[count] = 0
	end
	for i in levels do
		entry.by_level[i] = {}
	end
	return entry
end

-- How close a drive came to failing, from 0 to 1: its largest |XTE| as a share of the one at which a vehicle has left its lane, and 1
-- if it failed, for whatever reason.
function tally.closeness(outcome, lane_departure: number): number
	return if outcome.success then math.min(1, outcome.max_cross_track_error / lane_departure) else 1
end

-- Counts the drives of a searcher: see `study.search`.
local function count(entry, searcher, highest: number, lane_departure: number?)
	entry.errors += if searcher.error then 1 else 0
	for i, outcome in searcher.outcomes do
		entry.drives += 1
		if lane_departure and searcher.trials[i].level == highest then
			table.insert(entry.closeness[searcher.road.number], tally.closeness(outcome, lane_departure))
		end
		if not outcome.success then
			entry.failures += 1
			entry[outcome.verdict] += 1
			table.insert(entry.times, outcome.time)
			continue
		end
		entry.over_line += if outcome.measures.over_line_seconds > 0 then 1 else 0
		if searcher.trials[i].level == highest then
			-- Of a drive that was cut short it is not comparable.
			table.insert(entry.increases, outcome.mean_cross_track_error - searcher.road.nominal[1])
		end
	end
end

-- Says of all levels on a road what the drives there, each searcher's in a list, tell of them.
local function fill(entry, number: number, levels: { number })
	local failed, told = 0, 0
	for i, level in levels do
		-- Of searchers that drove at other levels, each level counts as much.
		local here, of = 0, 0
		for _, trials in entry.trials[number] do
			local fails = pdk.fails_at(trials, level)
			if fails ~= nil then
				here += if fails then 1 else 0
				of += 1
			end
		end
		if of > 0 then
			entry.by_level[i][number] = here / of
			failed += here / of
			told += 1
		end
	end
	entry.shares[number] = if told > 0 then failed / told else false
end

-- What came of each of the named perturbations with a driver in some conditions, by its name, from searchers that are done. The
-- levels are in order, roads have numbers up to `roads`, and a vehicle with an |XTE| of `lane_departure` metres has left its lane; without
-- it, there is no closeness.
function tally.results(searchers, names: { string }, levels: { number }, roads: number, lane_departure: number?)
	local by_name = {}
	for _, name in names do
		by_name[name] = empty(levels)
		for number = 1, roads do
			by_name[name].trials[number] = {}
			by_name[name].closeness[number] = {}
		end
	end
	for _, searcher in searchers do
		local entry = by_name[searcher.perturbation]
		count(entry, searcher, levels[#levels], lane_departure)
		if #searcher.trials > 0 then
			table.insert(entry.trials[searcher.road.number], searcher.trials)
		end
	end
	for _, name in names do
		for number = 1, roads do
			fill(by_name[name], number, levels)
		end
	end
	return by_name
end

-- Of a perturbation in those of the places that a test picks, for each road: the share of levels that fail, over all of these places,
-- or false; the drives of each searcher there, as `pdk.failing_level` takes them; and how close drives at the highest level came to
-- failing, or false. A place holds its `results`, if any.
function tally.pooled(places, name: string, roads: number, picks)
	local shares, trials, closeness = {}, {}, {}
	for number = 1, roads do
		local here, driven, close = {}, {}, {}
		for _, place in places do
			local result = if place.results and picks(place) then place.results[name] else nil
			if result and #result.closeness[number] > 0 then
				table.insert(close, study.mean(result.closeness[number]) :: number)
			end
			if result and result.shares[number] then
				table.insert(here, result.shares[number])
				table.move(result.trials[number], 1, #result.trials[number], #driven + 1, driven)
			end
		end
		shares[number] = (study.mean(here) or false) :: any
		trials[number] = driven
		closeness[number] = (study.mean(close) or false) :: any
	end
	return shares, trials, closeness
end

-- The mean over roads of how close drives came to failing, from 0 to 1, with its interval; nothing if there is none.
function tally.mean_closeness(by_road: { number | false }, confidence: number)
	local found = pdk.mean(study.known(by_road), confidence)
	if not found or found.low == found.high then
		-- Roads that are all alike do not say how much others may differ.
		return pdk.mean_share(by_road, confidence)
	end
	return { value = found.value, low = math.max(0, found.low), high = math.min(1, found.high) }
end

return tally
