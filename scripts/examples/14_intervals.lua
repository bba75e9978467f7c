-- The share of roads on which a driver fails, with an interval that says how much eight roads can tell.

local settings = pdk.settings({ driver = "dave2", perturbation = "sample_pairing_filter", level = 3, roads = 8, confidence = 0.95 })

local scenarios = {}
for seed = 1, settings.roads do
	table.insert(scenarios, {
		road = pdk.road({ seed = seed, attempts = 100 }).road,
		perturbations = { { name = settings.perturbation, level = settings.level } },
	})
end

local failed, errors = {}, {}
for _, outcome in pdk.drive({ simulator = "lane", driver = settings.driver, scenarios = scenarios }) do
	table.insert(failed, { not outcome.success })
	if outcome.success then
		table.insert(errors, outcome.mean_cross_track_error)
	end
end
local function row(name: string, estimate: any)
	return { name, if estimate then string.format("%.2f, %.2f to %.2f", estimate.value, estimate.low, estimate.high) else "not known" }
end
pdk.table({ "over roads", "estimate and interval" }, {
	row("share that failed", pdk.failed_share(failed, settings.confidence)),
	row("mean |XTE| of the others, m", pdk.mean(errors, settings.confidence)),
})
