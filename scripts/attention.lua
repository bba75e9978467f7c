-- Whether it matters where a frame is perturbed: the same perturbation on as many pixels, once where a saliency map says that
-- the driver looks, once at random pixels, and once where it looks least. Take perturbations that change every pixel: of one that
-- draws shapes, such as cutout_filter, only what lies within those pixels remains, which differs from place to place. Random pixels
-- are scattered, while a map marks areas, so compare `top` with `bottom` first.
--
--   pdk run attention
--   pdk run attention --set conditions=easy --set shares=20
--   pdk run attention --set drivers=dave2,dave2_augmented --set perturbations=false_color_filter,fog_filter
--   pdk run attention --set methods=smooth-grad,occlusion --set every=5
--
-- If the map is faithful and the driver depends on what it marks, `top` fails more often than `random`, and `random` more often
-- than `bottom`. Roads are the unit, and places are compared road by road: they were driven on the same roads under the same
-- luck. attention.json in the record holds what the tables show.

local study = require("@pdk/study")

local settings = pdk.settings({
	simulator = "lane",
	conditions = { "easy", "standard", "hard" }, -- of lane; none: the simulator as it is
	drivers = { "dave2" }, -- networks; a file as { name = "onnx", model = "FILE.onnx" }
	perturbations = { "false_color_filter" },
	levels = { 4 },
	shares = { 5, 10, 20, 40 }, -- percent of the frame that is perturbed
	methods = { "hirescam", "gradient" }, -- saliency methods, with parameters of their own as { name = ..., ... }
	every = 1, -- a map is made of one frame in this many
	roads = 20, -- how many random roads in each of the conditions
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	segment = 0, -- length of its segments in metres; 0: what the conditions' speed calls for
	attempts = 1000, -- draws until a road is valid
	repeats = 1, -- how often what draws at random, a perturbation or its places, is driven at each level on each road
	duration = 60, -- seconds of simulation time
	failure = {}, -- what counts as a failure: see FailureCriteria
	confidence = 0.95, -- of the intervals
	images_every = 0, -- every how many frames the record keeps an image; 0 for none
})

local names, levels = study.checked(settings, { "roads", "attempts", "repeats", "every" })
for _, share in settings.shares do
	if not (share > 0 and share < 100) then
		error(`shares has {share} percent, but each has to be above 0 and below 100: else all places are the same`, 0)
	end
end
for _, list in { "shares", "methods", "drivers" } do
	if #settings[list] == 0 then
		error(`{list} is empty; name at least one`, 0)
	end
end

-- What tables call a method.
local function called(method): string
	if type(method) == "string" then
		return method
	end
	local parameters = {}
	for name, value in method do
		if name ~= "name" then
			table.insert(parameters, `,{name}={value}`)
		end
	end
	table.sort(parameters)
	return method.name .. table.concat(parameters)
end

-- The method with the network of a driver, which is a component of its own or a file.
local function looked_at_by(method, driver)
	local by = if type(method) == "string" then { name = method } else table.clone(method)
	by.model = study.driver_name(driver)
	return by
end

-- What was found in one place with a perturbation, with an entry for each road: the share of drives that failed, false where none
-- says anything, and the mean |XTE|, false unless all came to the end. `drives`, `failures` and `broken`, those in which a component
-- failed, count all.
type Found = {
	shares: { number | false },
	errors: { number | false },
	drives: number,
	failures: number,
	broken: number,
}

-- The pixels that are perturbed: of a share of the frame, those that the map of a method marks most or least, or any at random.
type Place = { kind: string, share: number, method: any }

-- All places, those at random once for all methods.
local places: { Place } = {}
for _, share in settings.shares do
	table.insert(places, { kind = "random", share = share, method = nil })
	for _, method in settings.methods do
		for _, kind in { "top", "bottom" } do
			table.insert(places, { kind = kind, share = share, method = method })
		end
	end
end

-- Drives a driver with each perturbation in each place: what was found, by perturbation and place.
local function measured(these, driver, driven): { [string]: { [Place]: Found } }
	local lists, scenarios, of = {}, {}, {}
	for _, name in names do
		lists[name] = {}
		for _, place in places do
			local list = { failed = {}, errors = {}, broken = 0 }
			for road in driven do
				list.failed[road], list.errors[road] = {}, {}
			end
			lists[name][place] = list
			local where: any, what = { [place.kind] = place.share, every = settings.every }, place.kind
			if place.method then
				where.by = looked_at_by(place.method, driver)
				what = `{place.kind} by {called(place.method)}`
			end
			local repeats = if place.kind == "random" then settings.repeats else study.repeats(settings, name)
			for _, level in levels do
				for number, road in driven do
					for again = 1, repeats do
						table.insert(scenarios, {
							name = study.called(`{name}@{level} {what} {place.share} %`, road.number, again),
							road = road.road,
							["repeat"] = again - 1,
							perturbations = { { name = name, level = level, where = where } },
						})
						table.insert(of, { list = list, road = number })
					end
				end
			end
		end
	end
	for i, outcome in study.drive(these, scenarios, driver) do
		local list, road = of[i].list, of[i].road
		if outcome.cause == "error" then
			-- A component failed, which says nothing about the driver.
			list.broken += 1
			continue
		end
		table.insert(list.failed[road], not outcome.success)
		if outcome.success then
			table.insert(list.errors[road], outcome.mean_cross_track_error)
		end
	end

	local found = {}
	for name, by_place in lists do
		found[name] = {}
		for place, list in by_place do
			local one: Found = { shares = study.shares(list.failed), errors = {}, drives = 0, failures = 0, broken = list.broken }
			for road, errors in list.errors do
				local drives = #list.failed[road]
				one.errors[road] = if #errors == drives then study.mean(errors) or false else false
				one.drives += drives
				one.failures += drives - #errors
			end
			found[name][place] = one
		end
	end
	return found
end

-- What was found in a place with all perturbations, each of which counts the same, however often it was driven. Roads on
-- which one of them says nothing are left out, since the others alone would be another mixture.
local function together(found: { [string]: { [Place]: Found } }, place: Place): Found
	local all: Found = { shares = {}, errors = {}, drives = 0, failures = 0, broken = 0 }
	for road in found[names[1]][place].shares do
		for _, of in { "shares", "errors" } do
			local values = {}
			for _, name in names do
				table.insert(values, found[name][place][of][road])
			end
			local known = study.known(values)
			all[of][road] = if #known == #names then study.mean(known) else false
		end
	end
	for _, name in names do
		for _, count in { "drives", "failures", "broken" } do
			all[count] += found[name][place][count]
		end
	end
	return all
end

-- How much more often drives fail in the first place than in the second, and how much larger |XTE| is on roads where all drives of
-- both come to the end.
local function compared(first: Found, second: Found)
	local differences = {}
	for road in first.errors do
		local a, b = first.errors[road], second.errors[road]
		if a and b then
			table.insert(differences, a - b)
		end
	end
	return {
		failed = pdk.compare(first.shares, second.shares, settings.confidence),
		mean_cross_track_error = pdk.mean(differences, settings.confidence),
		roads_with_both = #differences,
	}
end

local percent = string.format("%g %%", 100 * settings.confidence)
local function interval(estimate): string
	return if estimate then string.format("%.3f to %.3f", estimate.low, estimate.high) else ""
end

-- The places of a share and a method by their kinds.
local function kinds(share: number, method): { [string]: Place }
	local by_kind = {}
	for _, place in places do
		if place.share == share and (place.method == method or place.kind == "random") then
			by_kind[place.kind] = place
		end
	end
	return by_kind
end

-- What the table and the record say of a perturbation, a share and a method.
local function entry_of(name: string, share: number, method, found: { [Place]: Found })
	local entry = { perturbation = name, share = share, method = method, where = {}, comparisons = {} }
	local by_kind = kinds(share, method)
	local row: { any } = { name, `{share} %`, called(method) }
	for _, kind in { "top", "random", "bottom" } do
		local one = found[by_kind[kind]]
		table.insert(row, `{one.failures} of {one.drives}`)
		entry.where[kind] = {
			drives = one.drives,
			failures = one.failures,
			errors = one.broken,
			failed_share = pdk.mean_share(one.shares, settings.confidence),
			mean_cross_track_error = pdk.mean(study.known(one.errors), settings.confidence),
		}
	end
	for _, pair in { { "top", "random" }, { "random", "bottom" }, { "top", "bottom" } } do
		entry.comparisons[`{pair[1]}-{pair[2]}`] = compared(found[by_kind[pair[1]]], found[by_kind[pair[2]]])
	end
	local most = entry.comparisons["top-bottom"]
	local failed, growth = most.failed, most.mean_cross_track_error
	for _, value in {
		failed and failed.difference.value or "",
		interval(failed and failed.difference),
		failed and failed.p or "",
		growth and growth.value or "",
		interval(growth),
	} :: { any } do
		table.insert(row, value)
	end
	return entry, row
end

local saved, untested = {}, nil
local in_conditions: { any } = if #settings.conditions > 0 then settings.conditions else { "" }
for _, driver in settings.drivers do
	for _, conditions in in_conditions do
		local these = study.in_conditions(settings, conditions)
		local driven, left_out = study.roads(these, 1, driver)
		if #driven == 0 then
			untested = study.nothing_managed(these, study.driver_name(driver), left_out)
			continue
		end
		local found = measured(these, driver, driven)
		local groups = table.clone(names)
		if #names > 1 then
			found.all = {}
			for _, place in places do
				found.all[place] = together(found, place)
			end
			table.insert(groups, "all")
		end
		local rows, entries = {}, {}
		for _, name in groups do
			for _, share in settings.shares do
				for _, method in settings.methods do
					local entry, row = entry_of(name, share, method, found[name])
					table.insert(entries, entry)
					table.insert(rows, row)
				end
			end
		end
		print(`{study.driver_name(driver)}{if conditions ~= "" then ` in {conditions}` else ""}, {#driven} of {settings.roads} roads: drives that failed, by place`)
		pdk.table(
			{ "perturbation", "share", "map", "top", "random", "bottom", "top less bottom", percent, "p", "mean |XTE| m", percent },
			rows
		)
		table.insert(saved, { driver = driver, conditions = conditions, roads = #driven, left_out = left_out, perturbations = entries })
	end
end
if #saved == 0 then
	error(untested, 0)
end
pdk.save("attention.json", {
	simulator = settings.simulator,
	methods = settings.methods,
	shares = settings.shares,
	every = settings.every,
	levels = levels,
	confidence = settings.confidence,
	drivers = saved,
})
