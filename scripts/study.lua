-- Which perturbations degrade a driver most: perturbations x levels x random roads, ranked.
--
--   pdk run scripts/study.lua
--   pdk run scripts/study.lua --set perturbations=gaussian_noise,dirty_lens --set levels=0,2,4 --set roads=3
--
-- The ranking goes by the share of scenarios that failed, then by how much the mean |XTE| grew over that of the same road
-- with a clear view: the first few places say what breaks a driver, the many that never do are close to each other. Roads that the driver does not manage with a clear view are left out. ranking.json in the record
-- holds what the table shows, and the failures by level. Each repeat draws everything random anew, which tells chance from
-- effect, with drivers that do not always do the same also theirs.

local study = require("@pdk/study")

local settings = pdk.settings({
	simulator = "lane",
	driver = "dave2",
	perturbations = {}, -- none: the default set
	levels = { 0, 1, 2, 3, 4 },
	roads = 10, -- how many random roads
	road_seed = 1, -- seed of the first road; each further one has the next
	limit = 35, -- largest angle of a road in degrees
	attempts = 1000, -- draws until a road is valid
	repeats = 1, -- how often each perturbation is driven at each level on each road
	duration = 40, -- seconds of simulation time
	images_every = 0, -- every how many frames the record keeps an image; 0 for none
	z = 1.96, -- standard deviations of the interval: 1.96 for 95 %
})

local names, levels = study.checked(settings, { "roads", "attempts", "repeats" })
local driven, left_out = study.roads(settings)
if #driven == 0 then
	error("the driver managed no road without perturbation, so there is nothing to compare with", 0)
end

local scenarios, of = {}, {}
for _, name in names do
	for _, level in levels do
		for _, place in driven do
			for number = 1, settings.repeats do
				local again = if settings.repeats > 1 then `, repeat {number}` else ""
				table.insert(scenarios, {
					name = `{name}@{level}, road {place.number}{again}`,
					road = place.road,
					["repeat"] = number - 1, -- luck of its own for each
					perturbations = { { name = name, level = level } },
				})
				table.insert(of, { name = name, level = level, nominal = place.mean_cross_track_error })
			end
		end
	end
end

local entries, by_name = {}, {}
for _, name in names do
	by_name[name] = { perturbation = name, scenarios = 0, failures = 0, errors = 0, increase = 0, by_level = {} }
	for _, level in levels do
		table.insert(by_name[name].by_level, { level = level, scenarios = 0, failures = 0 })
	end
	table.insert(entries, by_name[name])
end
for i, outcome in study.drive(settings, scenarios) do
	local entry = by_name[of[i].name]
	if outcome.cause == "error" then
		-- A component failed, which says nothing about the driver.
		entry.errors += 1
		continue
	end
	local failures = if outcome.success then 0 else 1
	entry.scenarios += 1
	entry.failures += failures
	for _, counted in entry.by_level do
		if counted.level == of[i].level then
			counted.scenarios += 1
			counted.failures += failures
		end
	end
	entry.increase += outcome.mean_cross_track_error - of[i].nominal
end

local not_driven = {}
for i = #entries, 1, -1 do
	if entries[i].scenarios == 0 then
		table.insert(not_driven, 1, table.remove(entries, i).perturbation)
	end
end
for _, entry in entries do
	entry.failed_share = entry.failures / entry.scenarios
	entry.failed_share_low, entry.failed_share_high = study.wilson(entry.failures, entry.scenarios, settings.z)
	entry.mean_cross_track_error_increase = entry.increase / entry.scenarios
	entry.increase = nil
end
table.sort(entries, function(a, b)
	if a.failed_share ~= b.failed_share then
		return a.failed_share > b.failed_share
	end
	if a.mean_cross_track_error_increase ~= b.mean_cross_track_error_increase then
		return a.mean_cross_track_error_increase > b.mean_cross_track_error_increase
	end
	return a.perturbation < b.perturbation
end)

local rows = {}
for rank, entry in entries do
	entry.rank = rank
	table.insert(rows, {
		rank,
		entry.perturbation,
		`{entry.failures} of {entry.scenarios}`,
		entry.failed_share,
		string.format("%.3f to %.3f", entry.failed_share_low, entry.failed_share_high),
		entry.mean_cross_track_error_increase,
	})
end
pdk.table({ "rank", "perturbation", "failed", "share", "interval", "mean |XTE| increase m" }, rows)
if #not_driven > 0 then
	print(`Not ranked, because a component failed in every scenario: {table.concat(not_driven, ", ")}`)
end
local totals = {}
for i, level in levels do
	local count, failures = 0, 0
	for _, entry in entries do
		count += entry.by_level[i].scenarios
		failures += entry.by_level[i].failures
	end
	table.insert(totals, { level, `{failures} of {count}`, if count > 0 then failures / count else "" })
end
pdk.table({ "level", "failed", "share" }, totals)
local roads = {}
for _, place in driven do
	table.insert(roads, {
		road = place.number,
		seed = place.seed,
		angles = place.angles,
		nominal_mean_cross_track_error = place.mean_cross_track_error,
	})
end
pdk.save("ranking.json", {
	simulator = settings.simulator,
	driver = settings.driver,
	ranking = entries,
	z = settings.z,
	roads = roads,
	left_out = left_out,
	not_driven = not_driven,
})
