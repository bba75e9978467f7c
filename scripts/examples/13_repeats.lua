-- How much of an outcome is luck: the same scenario with other random draws.

local settings = pdk.settings({ perturbation = "splatter_mapping", level = 4, repeats = 6 })

local scenarios = {}
for again = 0, settings.repeats - 1 do
	table.insert(scenarios, { perturbations = { { name = settings.perturbation, level = settings.level } }, ["repeat"] = again })
end
pdk.show(pdk.drive({ simulator = "lane", driver = "dave2", scenarios = scenarios }))
print(`{settings.perturbation} draws at random: {pdk.draws(settings.perturbation)}`)
