-- Code that several pipelines share: roads.lua lies beside this file.

local roads = require("./roads")

local scenarios = {}
for _, name in roads.names do
	table.insert(scenarios, { name = name, road = roads[name] })
end
pdk.show(pdk.drive({ simulator = "lane", driver = "lane_keeper", scenarios = scenarios }))
