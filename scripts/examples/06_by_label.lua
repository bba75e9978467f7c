-- A perturbation of what the simulator knows to be road, sky or vegetation, and of what is far away.

local scenarios = {}
for _, label in { "road", "sky", "vegetation" } do
	table.insert(scenarios, { name = label, perturbations = { { name = "false_color_filter", level = 3, where = { label = label } } } })
end
table.insert(scenarios, { name = "farther than 20 m", perturbations = { { name = "false_color_filter", level = 3, where = { farther = 20 } } } })

pdk.show(pdk.drive({ simulator = "lane", driver = "dave2", scenarios = scenarios }))
