-- A perturbation of your own: perturbations/windscreen_wiper.lua, which pdk finds beside the pipeline.

pdk.show(pdk.drive({
	simulator = "lane",
	driver = "dave2",
	scenarios = {
		{ perturbations = { "windscreen_wiper@1" } },
		{ perturbations = { "windscreen_wiper@4" } },
		{ name = "a wide one", perturbations = { { name = "windscreen_wiper", level = 4, width = 0.2 } } },
	},
}))
