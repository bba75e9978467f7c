-- A perturbation at each of its five published intensities. Any number in between works as well.

local settings = pdk.settings({ driver = "dave2", perturbation = "fog_filter", levels = { 0, 1, 2, 3, 4 } })

local scenarios = {}
for _, level in settings.levels do
	table.insert(scenarios, { perturbations = { { name = settings.perturbation, level = level } } })
end
pdk.show(pdk.drive({ simulator = "lane", driver = settings.driver, scenarios = scenarios }))
