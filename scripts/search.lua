-- Searches for roads and perturbations on which a driver fails: the published experiment, and whatever its settings make of it.
--
--   pdk run search
--   pdk run search --set strategy=random --set evaluations=200
--   pdk run search --set strategy.variant=published --seed 7
--   pdk run search --set evaluations=200 --set searches=10 --set against=random,nsga2
--
-- Four variables: how often the road turns, its mean curvature, a perturbation and its intensity. The perturbations stand in the
-- order of their measured effect (scripts/study.lua), so that neighbours are alike. Four objectives, as published: the mean and the
-- largest |XTE|, how early the driver failed, and a criticality that is negative where it failed.
--
-- With `searches` the search is repeated with other seeds, and with `against` done by other strategies too, to see which finds more:
-- a table compares them with the first of those, and `pdk report` draws what they found over the tests.
--
-- search.csv and search.json in the record hold all tests, of several searches STRATEGY-NUMBER.csv and .json. A test that failed
-- is driven again with `pdk replay RUN --scenario ID`.

local study = require("@pdk/study")

local settings = pdk.settings({
	simulator = "lane",
	driver = "dave2",
	strategy = { name = "nsga2_dt", population = 75, eta_crossover = 20, eta_mutation = 20 },
	against = {}, -- names of other strategies to compare with
	searches = 1, -- how many searches by each strategy, with different seeds
	evaluations = 3750, -- different tests: 50 generations of 75
	seconds = 0, -- stop after this much time; 0 for none
	turns = { 0, 8 }, -- smallest and largest number of turns
	curvature = { 0, 40 }, -- smallest and largest mean curvature in thousandths of 1/m
	intensity = { 0, 4 }, -- smallest and largest level
	real_intensity = false, -- also levels between the whole ones
	-- By their effect on the four networks (scripts/ranking.json), the weakest first; none: the default set, in the order of names.
	perturbations = {
		"dynamic_rain_filter", "static_rain_filter", "poisson_noise", "speckle_noise_filter", "zigzag_mapping",
		"saturation_filter", "gaussian_noise", "dotted_lines_mapping", "contrast", "elastic", "low_pass_filter",
		"motion_blur", "snow_on_lens", "white_balance_filter", "posterize_filter", "canny_edges_mapping", "pixelate",
		"defocus_blur", "raindrops_on_lens", "dirty_lens", "gaussian_blur", "impulse_noise", "banding",
		"increase_brightness", "jpeg_filter", "cutout_filter", "splatter_mapping", "object_overlay", "grayscale_filter",
		"frost_filter", "sharpen_filter", "saturation_decrease_filter", "scale_image", "snow_filter", "fog_filter",
		"phase_scrambling", "sample_pairing_filter", "false_color_filter", "translate_image",
	},
	road_seed = 1, -- which roads the turns and the curvature stand for
	attempts = 200, -- draws until a road is valid
	duration = 30, -- seconds of simulation time
	failure = {}, -- what counts as a failure: see FailureCriteria
	images_every = 0, -- every how many frames the record keeps an image; 0 for none
})

local perturbations = settings.perturbations
if #perturbations == 0 then
	perturbations = pdk.perturbations()
end
if settings.searches < 1 or settings.searches % 1 ~= 0 then
	error(`searches is {settings.searches}, but has to be a whole number of at least 1`, 0)
end

local function called(strategy): string
	return if type(strategy) == "string" then strategy else strategy.name
end

-- A search by a strategy; several have names and seeds of their own.
local function searched(strategy, number: number?)
	return pdk.search({
		name = if number then `{called(strategy)}-{number}` else "search",
		seed = number,
		simulator = settings.simulator,
		driver = settings.driver,
		duration = settings.duration,
		failure = settings.failure,
		images_every = settings.images_every,
		strategy = strategy,
		space = {
			turns = { integer = settings.turns },
			curvature = { integer = settings.curvature },
			intensity = if settings.real_intensity then { real = settings.intensity } else { integer = settings.intensity },
			perturbation = { ordinal = perturbations },
		},
		objectives = {
			mean_cross_track_error = "maximise",
			max_cross_track_error = "maximise",
			time_to_failure = "maximise",
			criticality = "minimise",
		},
		-- The worst that counts: the same for all searches, so that their hypervolumes can be compared.
		reference = { mean_cross_track_error = 0, max_cross_track_error = 0, time_to_failure = 0, criticality = 1 },
		evaluate = function(values)
			local made = pdk.road({
				turns = values.turns,
				mean_curvature = values.curvature / 1000,
				seed = settings.road_seed,
				attempts = settings.attempts,
			})
			return { road = made.road, perturbations = { { name = values.perturbation, level = values.intensity } } }
		end,
		stop = {
			evaluations = settings.evaluations,
			seconds = if settings.seconds > 0 then settings.seconds else nil,
		},
	})
end

-- What one search found.
local function show(found)
	print(`{found.evaluations} tests, {found.critical} failed, {#found.distinct_failures} of them unlike each other.`)
	local not_unsafe = { stopped = 0, late = 0 }
	for _, test in found.tests do
		if not_unsafe[test.verdict] and not test.same_as then
			not_unsafe[test.verdict] += 1
		end
	end
	if not_unsafe.stopped + not_unsafe.late > 0 then
		print(`Of those that failed, {not_unsafe.stopped} stopped and {not_unsafe.late} were too slow.`)
	end
	local rows = {}
	if found.tree then
		for _, region in found.tree.critical_regions do
			table.insert(rows, { region.region, `{region.critical} of {region.evaluations}` })
		end
	end
	if #rows > 0 then
		pdk.table({ "where most tests fail", "failed" }, rows)
	end
	rows = {}
	for _, number in found.distinct_failures do
		local test = found.tests[number + 1]
		local values = test.values
		table.insert(rows, {
			`{values.perturbation}@{values.intensity}`,
			`{values.turns} {if values.turns == 1 then "turn" else "turns"}, {values.curvature}/1000 1/m`,
			(string.gsub(test.cause or "", "_", " ")),
			-- The mean of a part of the road is not comparable.
			string.format("%.0f %%", 100 * (1 - test.objectives.time_to_failure)),
			test.scenario,
		})
		if #rows == 20 then
			break
		end
	end
	if #rows > 0 then
		pdk.table({ "perturbation", "road", "cause", "driven", "scenario" }, rows)
	end
end

local strategies: { any } = { settings.strategy }
for _, other in settings.against do
	table.insert(strategies, other)
end
if #strategies == 1 and settings.searches == 1 then
	show(searched(settings.strategy))
	return
end

-- What several searches found, by strategy.
local measures = {
	{ name = "failed", of = function(found) return found.critical end },
	{ name = "unlike each other", of = function(found) return #found.distinct_failures end },
	-- Where none failed, one more than there were.
	{ name = "tests to the first", of = function(found) return found.first_critical or found.evaluations + 1 end },
	{ name = "hypervolume", of = function(found) return found.convergence[#found.convergence].hypervolume end },
}
local all = {}
for place, strategy in strategies do
	all[place] = {}
	for number = 1, settings.searches do
		local found = searched(strategy, number)
		for of, measure in measures do
			all[place][of] = all[place][of] or {}
			table.insert(all[place][of], measure.of(found))
		end
	end
end

-- The others are compared with the first of `against`, or with nothing.
local base = if #strategies > 1 then 2 else nil
local header: { string }, rows = { "strategy", "searches" }, {}
for _, measure in measures do
	table.insert(header, measure.name)
	if base then
		table.insert(header, "A, p")
	end
end
for place, strategy in strategies do
	local row: { any } = { called(strategy), settings.searches }
	for of in measures do
		local values = all[place][of]
		table.insert(row, string.format("%g (%g to %g)", study.median(values), math.min(table.unpack(values)), math.max(table.unpack(values))))
		if base then
			local compared = if place == base then nil else pdk.compare_independent(values, all[base][of])
			table.insert(row, if compared then string.format("%.2f, %.3g", compared.effect_size, compared.p) else "")
		end
	end
	table.insert(rows, row)
end
pdk.table(header, rows)
if base then
	print(`A: the probability that a search has a larger value than one by {called(strategies[base])}; p: of the two-sided test of Mann and Whitney`)
end
