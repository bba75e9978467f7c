-- A trained driver on the embedded simulator: once with a clear view, then through perturbations.
--
--   pdk run quickstart
--   pdk run quickstart --set perturbations=gaussian_noise,dirty_lens --set levels=1,4 --seed 7
--
-- Each is driven once, which is a look and no conclusion: greedy and study repeat what draws at random, on several roads.

local settings = pdk.settings({
	simulator = "lane",
	driver = "dave2",
	road = { angles = { 0, 12, -18, 10, 20, -15, -8, 0 }, segment = 25 }, -- degrees turned every 25 m
	perturbations = { "gaussian_noise", "motion_blur", "fog_filter", "translate_image", "raindrops_on_lens", "dirty_lens" },
	levels = { 2, 4 },
	duration = 30, -- seconds of simulation time
	failure = {}, -- what counts as a failure: see FailureCriteria
})

if #settings.perturbations > 0 and #settings.levels == 0 then
	error("levels is empty; name at least one from 0 to 4", 0)
end

local scenarios = { { name = "nominal" } }
for _, perturbation in settings.perturbations do
	for _, level in settings.levels do
		-- A name, or a table with parameters as well.
		local perturbed = if type(perturbation) == "table" then table.clone(perturbation) else { name = perturbation }
		perturbed.level = level
		table.insert(scenarios, { perturbations = { perturbed } })
	end
end
for _, scenario in scenarios do
	scenario.road = settings.road
end

pdk.show(pdk.drive({
	simulator = settings.simulator,
	driver = settings.driver,
	duration = settings.duration,
	failure = settings.failure,
	scenarios = scenarios,
}))
print("Each was driven once, on one road. What holds on others: pdk run greedy, pdk run study")
