-- A result of your own in the record, for another program: weather.json.

local result = {}
for _, name in { "snow_filter", "frost_filter", "fog_filter" } do
	local outcome = pdk.drive({ simulator = "lane", driver = "dave2", scenarios = { { perturbations = { name .. "@2" } } } })[1]
	result[name] = { survived = outcome.success, progress = outcome.progress }
end
pdk.save("weather.json", result)
