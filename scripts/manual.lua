-- What you name is driven: each chain of perturbations, on each random road, after a drive with a clear view.
--
--   pdk run manual --set chains=fog_filter@2+motion_blur@1,dirty_lens@3.5 --set roads=2 --set conditions=hard
--
-- A chain is perturbations joined by +, each with its intensity behind @; the first one sees the frame first. A chain can
-- also be a list with everything that a perturbation takes: { { name = "fog_filter", level = 2, probability = 0.5 } }. One in which
-- anything is drawn at random is driven several times on each road.

local study = require("@pdk/study")

local settings = pdk.settings({
	simulator = "lane",
	conditions = "", -- of lane: easy, standard or hard; nothing: the simulator as it is
	driver = "dave2",
	chains = { "gaussian_noise@2", "fog_filter@2+motion_blur@1" },
	roads = 1, -- how many random roads
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	segment = 0, -- length of its segments in metres; 0: what the conditions' speed calls for
	attempts = 1000, -- draws until a road is valid
	repeats = 3, -- how often a chain that draws at random is driven on each road
	duration = 60, -- seconds of simulation time
	failure = {}, -- what counts as a failure: see FailureCriteria
	images_every = 10, -- every how many frames the record keeps an image; 0 for none
	mode = "", -- "lockstep": the simulator waits for the driver, as it does where nothing is said and it can; or "realtime"
})

-- "fog_filter@2+motion_blur@1" as a list of perturbations.
local function parsed(chain)
	if type(chain) ~= "string" then
		return chain
	end
	local perturbations = {}
	for _, text in string.split(chain, "+") do
		local name, level = string.match(text, "^([%w_]+)@([%d.]+)$")
		local intensity = tonumber(level)
		if not intensity then
			error(`"{text}" in chains is not a perturbation with its intensity, such as fog_filter@2.5`, 0)
		end
		table.insert(perturbations, { name = name, level = intensity })
	end
	return perturbations
end

-- How often a chain is driven on each road.
local function repeats(perturbations): number
	for _, perturbation in perturbations do
		local name = if type(perturbation) == "string" then string.match(perturbation, "^[^@,]+") else perturbation.name
		if type(perturbation) == "table" and perturbation.probability or pdk.draws(name) then
			return settings.repeats
		end
	end
	return 1
end

for _, name in { "roads", "attempts", "repeats" } do
	study.count(settings, name)
end
settings = study.in_conditions(settings, settings.conditions)
local scenarios = {}
for number = 1, settings.roads do
	local seed = settings.road_seed + number - 1
	local road = pdk.road({ seed = seed, limit = settings.limit, segment = settings.segment, attempts = settings.attempts }).road
	table.insert(scenarios, { name = study.called("nominal", number, 1), road = road })
	for i, chain in settings.chains do
		local perturbations = parsed(chain)
		for again = 1, repeats(perturbations) do
			table.insert(scenarios, {
				name = study.called(if type(chain) == "string" then chain else `chain {i}`, number, again),
				road = road,
				["repeat"] = again - 1,
				perturbations = perturbations,
			})
		end
	end
end

pdk.show(pdk.drive({
	simulator = settings.simulator,
	driver = settings.driver,
	duration = settings.duration,
	failure = settings.failure,
	images_every = settings.images_every,
	mode = if settings.mode == "" then nil else settings.mode,
	scenarios = scenarios,
}))
