-- Attacks along the gradient of one network while another one drives: how far they carry over.

local settings = pdk.settings({
	networks = { "dave2", "dave2_augmented" },
	level = 2,
	goal = "left",
	steps = 3,
	roads = 1,
	duration = 5,
})

local scenarios = {}
for _, driver in settings.networks do
	for _, model in settings.networks do
		for seed = 1, settings.roads do
			table.insert(scenarios, {
				name = `{driver} under an attack on {model}, road {seed}`,
				driver = driver,
				duration = settings.duration,
				road = pdk.road({ seed = seed, attempts = 100 }).road,
				perturbations = {
					{ name = "pgd", model = model, level = settings.level, goal = settings.goal, steps = settings.steps },
				},
			})
		end
	end
end

local failed, columns = {}, { "driver" }
for i, outcome in pdk.drive({ simulator = "lane", scenarios = scenarios }) do
	local pair = (i - 1) // settings.roads + 1
	failed[pair] = (failed[pair] or 0) + if outcome.cause == "lane_departure" then 1 else 0
end
local rows = {}
for d, driver in settings.networks do
	local row = { driver }
	columns[d + 1] = `leaves the lane under an attack on {driver}`
	for m in settings.networks do
		local count = failed[(d - 1) * #settings.networks + m]
		table.insert(row, `{count} of {settings.roads}`)
	end
	table.insert(rows, row)
end
pdk.table(columns, rows)
