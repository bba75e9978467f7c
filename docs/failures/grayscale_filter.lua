-- grayscale_filter@3.75: lane departure after 7.45 s.
-- Under new luck it fails in 20 of 20 drives: a probability of 0.84 to 1.00.
--
--   pdk run grayscale_filter.lua

pdk.show(pdk.drive({
	images_every = 1,
	scenarios = { {
		simulator = "lane",
		driver = "dave2",
		road = { angles = { 0, 25, -25, 25, 0, 0, 0, 0 }, segment = 25 },
		perturbations = {
			{ name = "grayscale_filter", level = 3.75 },
		},
		duration = 7.6,
		seed = 8380286669476961,
	} },
}))
