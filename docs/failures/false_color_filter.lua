-- false_color_filter@0: lane departure after 1.20 s.
-- With other random draws it fails in 20 of 20 drives; the probability of failure is 0.84 to 1.00 (95 %).
--
--   pdk run false_color_filter.lua

pdk.show(pdk.drive({
	images_every = 1,
	scenarios = { {
		simulator = "lane",
		driver = "dave2",
		road = { angles = { 0, 0 }, segment = 25 },
		perturbations = {
			{ name = "false_color_filter", level = 0 },
		},
		duration = 10,
		seed = 7191359084845048,
	} },
}))
