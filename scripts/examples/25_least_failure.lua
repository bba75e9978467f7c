-- The least that makes a driver fail: along the border of failures to the cheapest combination of bends and perturbations.

local settings = pdk.settings({
	driver = "dave2",
	perturbations = { "fog_filter", "frost_filter", "sharpen_filter" },
	bend = 25, -- the largest, in degrees
	strategy = { name = "descent", towards = "max_cross_track_error" },
	evaluations = 50,
})

local bends, space, none = { "bend_1", "bend_2", "bend_3" }, {}, {}
for _, bend in bends do
	space[bend], none[bend] = { real = { -settings.bend, settings.bend } }, 0
end
for _, name in settings.perturbations do
	space[name], none[name] = { real = { 0, 4 } }, 0
end

local found = pdk.search({
	simulator = "lane",
	driver = settings.driver,
	images_every = 0,
	strategy = if settings.strategy == "bisection" then require("@pdk/bisection").new(none) else settings.strategy,
	space = space,
	objectives = { max_cross_track_error = "maximise", effort = "minimise" },
	evaluate = function(values)
		local perturbations = {}
		for _, name in settings.perturbations do
			table.insert(perturbations, { name = name, level = values[name] })
		end
		local road = { angles = { 0, values.bend_1, values.bend_2, values.bend_3, 0 }, segment = 25 }
		return { road = road, perturbations = perturbations }
	end,
	-- What a failure takes: each level and each bend as a share of its largest.
	outcome = function(_, values)
		local effort = 0
		for _, bend in bends do
			effort += math.abs(values[bend]) / settings.bend
		end
		for _, name in settings.perturbations do
			effort += values[name] / 4
		end
		return { objectives = { effort = effort } }
	end,
	stop = { evaluations = settings.evaluations },
})

local least: any
for _, test in found.tests do
	if test.critical and (not least or test.objectives.effort < least.objectives.effort) then
		least = test
	end
end
assert(least, `none of {found.evaluations} tests failed`)
print(`{settings.driver} fails with an effort of {string.format("%.2f", least.objectives.effort)}, of {#settings.perturbations + #bends} at most:`)
for _, name in { "bend_1", "bend_2", "bend_3", table.unpack(settings.perturbations) } do
	print(string.format("%-15s %5.2f", name, least.values[name]))
end
