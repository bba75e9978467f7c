-- Drives that fail, whose causes causes.py finds: four networks on twelve roads, through perturbations that make them leave their lane.
--
--   pdk run tests/study/causes.lua --out failures

local settings = pdk.settings({
	drivers = { "dave2", "dave2_augmented", "dave2_tub", "dave2_hardened" },
	perturbations = { "fog_filter@3", "false_color_filter@3", "rotate_image@3", "grayscale_filter@4", "cutout_filter@4" },
	roads = 12,
	road_seed = 1,
})

local scenarios = {}
for seed = settings.road_seed, settings.road_seed + settings.roads - 1 do
	local road = pdk.road({ seed = seed, segment = 14, limit = 40, attempts = 1000 }).road
	for _, driver in settings.drivers do
		for _, perturbation in settings.perturbations do
			table.insert(scenarios, {
				name = `{perturbation} on road {seed}`,
				driver = driver,
				road = road,
				perturbations = { perturbation },
			})
		end
	end
end
pdk.drive({ simulator = "lane", driver = settings.drivers[1], duration = 60, images_every = 0, scenarios = scenarios })
