-- A search for failures over two variables: how thick the fog is and how sharply the road bends.

local settings = pdk.settings({ driver = "dave2", strategy = "nsga2", evaluations = 24 })

local found = pdk.search({
	space = { fog = { real = { 0, 4 } }, bend = { integer = { 0, 25 } } },
	objectives = { criticality = "minimise" },
	strategy = { name = settings.strategy, population = 8 },
	evaluate = function(values)
		return {
			road = { angles = { 0, values.bend, -values.bend, values.bend, 0 }, segment = 25 },
			perturbations = { { name = "fog_filter", level = values.fog } },
		}
	end,
	simulator = "lane",
	driver = settings.driver,
	images_every = 0,
	stop = { evaluations = settings.evaluations },
})
print(`{found.critical} of {found.evaluations} tests failed, the first after {found.first_critical}`)
for _, region in if found.tree then found.tree.critical_regions else {} do
	print(`{region.critical} of {region.evaluations} fail if {region.region}`)
end
