-- fog_filter@3.25: lane departure after 6.50 s.
-- With other random draws it fails in 20 of 20 drives; the probability of failure is 0.84 to 1.00 (95 %).
--
--   pdk run fog_filter.lua

pdk.show(pdk.drive({
	images_every = 1,
	scenarios = { {
		simulator = "lane",
		driver = "dave2",
		road = { angles = { 0, -28 }, segment = 25 },
		perturbations = {
			{ name = "fog_filter", level = 3.25 },
		},
		duration = 10,
		seed = 2073130918622966,
	} },
}))
