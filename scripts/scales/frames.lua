-- The frames that the scale calibrated-1 was measured on: 42 frames of nine roads of the embedded simulator, in all of its conditions.
--
--   pdk run scripts/scales/frames.lua -o frames
--   pdk calibrate frames --all -o calibrated-1.scale.json

local scenarios = {}
for seed = 301, 303 do
	for _, conditions in { "easy", "standard", "hard" } do
		table.insert(scenarios, {
			name = `{conditions} {seed}`,
			simulator = { name = "lane", conditions = conditions },
			road = pdk.road({ seed = seed, limit = 30, segment = 30, attempts = 200 }).road,
		})
	end
end
pdk.drive({ driver = "lane_keeper", duration = 9, images_every = 45, scenarios = scenarios })
