-- Whether it matters where a frame is perturbed: the same perturbation on as many pixels, once where a saliency map says that
-- the driver looks, once at random places, and once where it looks least.
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
	perturbations = { "gaussian_noise", "cutout_filter", "defocus_blur" },
	levels = { 2, 4 },
	share = 20, -- percent of the frame that is perturbed
	method = "hirescam", -- the saliency method, with parameters of its own as a table { name = ..., ... }
	every = 1, -- a map is made of one frame in so many
	roads = 10, -- how many random roads
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	segment = 25, -- length of its segments in metres: 37.5 and 50 match the speeds of the conditions standard and hard of lane
	attempts = 1000, -- draws until a road is valid
	repeats = 1, -- how often each condition is driven at each level on each road
	duration = 30, -- seconds of simulation time
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

-- Drives all conditions with a driver: by perturbation and condition, for each road, whether its drives failed and the mean |XTE|
-- of those that did not.
local function measured(driver, driven)
	local found, scenarios, of = {}, {}, {}
	for _, name in names do
		found[name] = {}
		for _, condition in conditions do
			local entry = { failed = {}, errors = {}, broken = 0 }
			for place in driven do
				entry.failed[place], entry.errors[place] = {}, {}
			end
			found[name][condition] = entry
			local where = { [condition] = settings.share, every = settings.every }
			if condition ~= "random" then
				where.by = looked_at_by(driver)
			end
			for _, level in levels do
				for place, road in driven do
					for again = 1, settings.repeats do
						table.insert(scenarios, {
							name = study.called(`{name}@{level} {condition} {settings.share} %`, road.number, again),
							road = road.road,
							["repeat"] = again - 1,
							perturbations = { { name = name, level = level, where = where } },
						})
						table.insert(of, { entry = entry, place = place })
					end
				end
			end
		end
	end
	for i, outcome in study.drive(settings, scenarios, driver) do
		local entry, place = of[i].entry, of[i].place
		if outcome.cause == "error" then
			-- A component failed, which says nothing about the driver.
			entry.broken += 1
			continue
		end
		table.insert(entry.failed[place], not outcome.success)
		if outcome.success then
			table.insert(entry.errors[place], outcome.mean_cross_track_error)
		end
	end
	return found
end

-- How much more often the first condition fails than the second, and how much larger its |XTE| is on roads where both come to the
-- end.
local function compared(first, second)
	local differences = {}
	for place in first.errors do
		local a, b = study.mean(first.errors[place]), study.mean(second.errors[place])
		if a and b then
			table.insert(differences, a - b)
		end
	end
	return {
		failed = pdk.compare(study.shares(first.failed), study.shares(second.failed), settings.confidence),
		mean_cross_track_error = pdk.mean(differences, settings.confidence),
		roads_with_both = #differences,
	}
end

-- Everything that was driven under a condition, whatever the perturbation.
local function together(found, condition: string)
	local sum = { failed = {}, errors = {}, broken = 0 }
	for _, name in names do
		local entry = found[name][condition]
		sum.broken += entry.broken
		for place in entry.failed do
			sum.failed[place], sum.errors[place] = sum.failed[place] or {}, sum.errors[place] or {}
			table.move(entry.failed[place], 1, #entry.failed[place], #sum.failed[place] + 1, sum.failed[place])
			table.move(entry.errors[place], 1, #entry.errors[place], #sum.errors[place] + 1, sum.errors[place])
		end
	end
	return sum
end

local percent = string.format("%g %%", 100 * settings.confidence)
local function interval(estimate): string
	return if estimate then string.format("%.3f to %.3f", estimate.low, estimate.high) else ""
end

local saved = {}
for _, driver in settings.drivers do
	local driven, left_out = study.roads(settings, settings.repeats, driver)
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
			local share = pdk.failed_share(one.failed, settings.confidence)
			local means, failures, drives = {}, 0, 0
			for place, errors in one.errors do
				table.insert(means, study.mean(errors))
				drives += #one.failed[place]
				failures += #one.failed[place] - #errors
			end
			local error_mean = pdk.mean(means, settings.confidence)
			table.insert(rows, {
				group.name,
				`{condition} {settings.share} %`,
				`{failures} of {drives}`,
				share and share.value or "",
				interval(share),
				error_mean and error_mean.value or "",
				interval(error_mean),
			} :: { any })
			entry.conditions[condition] = {
				drives = drives,
				failures = failures,
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
	print(`{study.driver_name(driver)}, {#driven} roads`)
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
