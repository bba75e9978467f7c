-- A pipeline for pdk. Run it:            pdk run {{name}}.lua
-- Change a value without editing it:     pdk run {{name}}.lua --set level=4

local settings = pdk.settings({
	simulator = "lane",
	driver = "lane_keeper",
	perturbations = { "gaussian_noise", "gaussian_blur", "contrast" },
	level = 2,
	duration = 30, -- seconds of simulation time; the road takes about 22
})

-- The road as it is, then once with each perturbation.
local scenarios = { { name = "nominal" } }
for _, name in settings.perturbations do
	table.insert(scenarios, { perturbations = { { name = name, level = settings.level } } })
end

pdk.show(pdk.drive({
	simulator = settings.simulator,
	driver = settings.driver,
	duration = settings.duration,
	scenarios = scenarios,
}))
