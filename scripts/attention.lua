-- Whether it matters where a frame is perturbed: the same perturbation on as many pixels, once where a saliency map says that
-- the driver looks, once at random pixels, and once where it looks least. Take perturbations that change every pixel: of one that
-- draws shapes, such as cutout_filter, only what lies within those pixels remains, which differs from place to place. Random pixels
-- are scattered, while a map marks areas, so compare `top` with `bottom` first.
--
--   pdk run attention
--   pdk run attention --set share=10 --set method=grad-cam --set levels=4
--   pdk run attention --set every=5 --set perturbations=gaussian_noise
--
-- If the map is faithful and the driver depends on what it marks, `top` fails more often than `random`, and `random` more often
-- than `bottom`. Roads are the unit, and conditions are compared road by road: they were driven on the same roads under the same
-- luck. attention.json in the record holds what the tables show.

local study = require("@pdk/study")

local settings = pdk.settings({
	simulator = "lane",
	drivers = { "dave2", "dave2_augmented" }, -- networks; a file as { name = "onnx", model = "FILE.onnx" }
	perturbations = { "gaussian_noise", "false_color_filter", "defocus_blur" },
	levels = { 2, 4 },
	share = 20, -- percent of the frame that is perturbed
	method = "hirescam", -- the saliency method, with parameters of its own as a table { name = ..., ... }
	every = 1, -- a map is made of one frame in so many
	roads = 10, -- how many random roads
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	segment = 25, -- length of its segments in metres: 37.5 and 50 match the speeds of the conditions standard and hard of lane
	attempts = 1000, -- draws until a road is valid
	repeats = 3, -- how often what draws at random, a perturbation or its places, is driven at each level on each road
	duration = 60, -- seconds of simulation time
	failure = {}, -- what counts as a failure: see FailureCriteria
	confidence = 0.95, -- of the intervals
	images_every = 0, -- every how many frames the record keeps an image; 0 for none
})

local conditions = { "top", "random", "bottom" }
local names, levels = study.checked(settings, { "roads", "attempts", "repeats", "every" })
if not (settings.share > 0 and settings.share < 100) then
	error(`share is {settings.share} percent, but has to be above 0 and below 100: else all places are the same`, 0)
end

-- The method with the network of a driver, which is a component of its own or a file.
local function looked_at_by(driver)
	local method = if type(settings.method) == "string" then { name = settings.method } else table.clone(settings.method)
	method.model = study.driver_name(driver)
	return method
end

-- What was found under a condition, with an entry for each road: the share of drives that failed, false where none says anything,
-- and the mean |XTE|, false unless all came to the end. `drives`, `failures` and `broken`, those in which a component failed, count all.
type Found = {
	shares: { number | false },
	errors: { number | false },
	drives: number,
	failures: number,
	broken: number,
}

-- Drives all conditions with a driver: what was found, by perturbation and condition.
local function measured(driver, driven): { [string]: { [string]: Found } }
	local lists, scenarios, of = {}, {}, {}
	for _, name in names do
		lists[name] = {}
		for _, condition in conditions do
			local list = { failed = {}, errors = {}, broken = 0 }
			for place in driven do
				list.failed[place], list.errors[place] = {}, {}
			end
			lists[name][condition] = list
			local where = { [condition] = settings.share, every = settings.every }
			if condition ~= "random" then
				where.by = looked_at_by(driver)
			end
			local repeats = if condition == "random" then settings.repeats else study.repeats(settings, name)
			for _, level in levels do
				for place, road in driven do
					for again = 1, repeats do
						table.insert(scenarios, {
							name = study.called(`{name}@{level} {condition} {settings.share} %`, road.number, again),
							road = road.road,
							["repeat"] = again - 1,
							perturbations = { { name = name, level = level, where = where } },
						})
						table.insert(of, { list = list, place = place })
					end
				end
			end
		end
	end
	for i, outcome in study.drive(settings, scenarios, driver) do
		local list, place = of[i].list, of[i].place
		if outcome.cause == "error" then
			-- A component failed, which says nothing about the driver.
			list.broken += 1
			continue
		end
		table.insert(list.failed[place], not outcome.success)
		if outcome.success then
			table.insert(list.errors[place], outcome.mean_cross_track_error)
		end
	end

	local found = {}
	for name, by_condition in lists do
		found[name] = {}
		for condition, list in by_condition do
			local one: Found = { shares = study.shares(list.failed), errors = {}, drives = 0, failures = 0, broken = list.broken }
			for place, errors in list.errors do
				local drives = #list.failed[place]
				one.errors[place] = if #errors == drives then study.mean(errors) or false else false
				one.drives += drives
				one.failures += drives - #errors
			end
			found[name][condition] = one
		end
	end
	return found
end

-- What was found under a condition with all perturbations, each of which counts the same, however often it was driven. Roads on
-- which one of them says nothing are left out, since the others alone would be another mixture.
local function together(found: { [string]: { [string]: Found } }, condition: string): Found
	local all: Found = { shares = {}, errors = {}, drives = 0, failures = 0, broken = 0 }
	for place in found[names[1]][condition].shares do
		for _, of in { "shares", "errors" } do
			local values = {}
			for _, name in names do
				table.insert(values, found[name][condition][of][place])
			end
			local known = study.known(values)
			all[of][place] = if #known == #names then study.mean(known) else false
		end
	end
	for _, name in names do
		for _, count in { "drives", "failures", "broken" } do
			all[count] += found[name][condition][count]
		end
	end
	return all
end

-- How much more often the first condition fails than the second, and how much larger its |XTE| is on roads where all drives of both
-- come to the end.
local function compared(first: Found, second: Found)
	local differences = {}
	for place in first.errors do
		local a, b = first.errors[place], second.errors[place]
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

local saved = {}
for _, driver in settings.drivers do
	local driven, left_out = study.roads(settings, 1, driver)
	if #driven == 0 then
		error(study.nothing_managed(settings, study.driver_name(driver), left_out), 0)
	end
	local found = measured(driver, driven)
	local groups = {}
	for _, name in names do
		table.insert(groups, { name = name, by = found[name] })
	end
	if #names > 1 then
		local all = {}
		for _, condition in conditions do
			all[condition] = together(found, condition)
		end
		table.insert(groups, { name = "all", by = all })
	end

	local rows, differences, entries = {}, {}, {}
	for _, group in groups do
		local entry = { perturbation = group.name, conditions = {}, comparisons = {} }
		for _, condition in conditions do
			local one = group.by[condition]
			local share = pdk.mean_share(one.shares, settings.confidence)
			local error_mean = pdk.mean(study.known(one.errors), settings.confidence)
			table.insert(rows, {
				group.name,
				`{condition} {settings.share} %`,
				`{one.failures} of {one.drives}`,
				share and share.value or "",
				interval(share),
				error_mean and error_mean.value or "",
				interval(error_mean),
			} :: { any })
			entry.conditions[condition] = {
				drives = one.drives,
				failures = one.failures,
				errors = one.broken,
				failed_share = share,
				mean_cross_track_error = error_mean,
			}
		end
		for _, pair in { { "top", "random" }, { "random", "bottom" }, { "top", "bottom" } } do
			local comparison = compared(group.by[pair[1]], group.by[pair[2]])
			local failed, growth = comparison.failed, comparison.mean_cross_track_error
			table.insert(differences, {
				group.name,
				`{pair[1]} less {pair[2]}`,
				failed and failed.difference.value or "",
				interval(failed and failed.difference),
				failed and failed.p or "",
				growth and growth.value or "",
				interval(growth),
			} :: { any })
			entry.comparisons[`{pair[1]}-{pair[2]}`] = comparison
		end
		table.insert(entries, entry)
	end
	print(`{study.driver_name(driver)}, {#driven} of {settings.roads} roads`)
	pdk.table({ "perturbation", "where", "failed", "share", percent, "mean |XTE| m", percent }, rows)
	pdk.table({ "perturbation", "paired by road", "failed share", percent, "p", "mean |XTE| m", percent }, differences)
	table.insert(saved, { driver = driver, roads = #driven, left_out = left_out, perturbations = entries })
end
pdk.save("attention.json", {
	simulator = settings.simulator,
	method = settings.method,
	share = settings.share,
	every = settings.every,
	levels = levels,
	confidence = settings.confidence,
	drivers = saved,
})
