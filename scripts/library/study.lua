-- What studies on random roads share: the settings that they check alike, and the nominal drives, which say on which roads the
-- driver can be tested at all.
--
--   local study = require("@pdk/study")

local study = {}

-- Each value once, in the order in which they come.
local function once<T>(values: { T }): { T }
	local kept, seen = {}, {}
	for _, value in values do
		if not seen[value] then
			seen[value] = true
			table.insert(kept, value)
		end
	end
	return kept
end

-- The perturbations and the levels of a study, each once and the levels in order. `counts` names the settings that have to be at
-- least 1. Where no perturbations are set, it is the default set.
function study.checked(settings, counts: { string }): ({ string }, { number })
	local names = once(settings.perturbations)
	if #names == 0 then
		names = pdk.perturbations()
	end
	local levels = once(settings.levels)
	table.sort(levels)
	for _, name in counts do
		if settings[name] < 1 then
			error(`{name} is {settings[name]}, but has to be at least 1`, 2)
		end
	end
	if #levels == 0 then
		error("levels is empty; name at least one from 0 to 4", 2)
	end
	return names, levels
end

-- Drives scenarios with the simulator and the driver that are set.
function study.drive(settings, scenarios)
	return pdk.drive({
		simulator = settings.simulator,
		driver = settings.driver,
		duration = settings.duration,
		images_every = settings.images_every,
		scenarios = scenarios,
	})
end

-- Makes the random roads that are set and drives each with a clear view. Returns those that the driver manages, each with its
-- number, seed, angles, road and the mean |XTE| on it, and what is said of the others.
function study.roads(settings)
	local roads, scenarios = {}, {}
	for number = 1, settings.roads do
		local seed = settings.road_seed + number - 1
		local made = pdk.road({ seed = seed, limit = settings.limit, attempts = settings.attempts })
		table.insert(roads, { number = number, seed = seed, angles = made.angles, road = made.road })
		table.insert(scenarios, { name = "nominal, road " .. number, road = made.road })
	end
	local driven, left_out = {}, {}
	for number, outcome in study.drive(settings, scenarios) do
		if outcome.success then
			roads[number].mean_cross_track_error = outcome.mean_cross_track_error
			table.insert(driven, roads[number])
		else
			print(`Road {number} is left out: without perturbation it ended with {outcome.cause}.`)
			table.insert(left_out, { road = number, cause = outcome.cause })
		end
	end
	return driven, left_out
end

-- Wilson's score interval of a share, `z` standard deviations to both sides: E. B. Wilson, "Probable inference" (1927).
function study.wilson(failures: number, n: number, z: number): (number, number)
	local share, z2 = failures / n, z * z
	local middle = (share + z2 / (2 * n)) / (1 + z2 / n)
	local half = z / (1 + z2 / n) * math.sqrt(share * (1 - share) / n + z2 / (4 * n * n))
	return math.max(0, middle - half), math.min(1, middle + half)
end

return study
