-- grayscale_filter@4: lane departure after 4.60 s.
-- Found at level 3.69 on a longer road, where one processor made the difference; at level 4 all drives fail, whatever the engine.
--
--   pdk run grayscale_filter.lua

pdk.show(pdk.drive({
	images_every = 1,
	scenarios = { {
		simulator = "lane",
		driver = "dave2",
		road = { angles = { 0, -25, 25 }, segment = 25 },
		perturbations = {
			{ name = "grayscale_filter", level = 4 },
		},
		duration = 10,
		seed = 488447330695260,
	} },
}))
