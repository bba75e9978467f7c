-- The level from which on a driver fails, found with few drives: each outcome decides what is driven next.

local settings = pdk.settings({ driver = "dave2", perturbation = "fog_filter", resolution = 0.1 })

local session = pdk.session({ simulator = "lane", driver = settings.driver })
local trials = {}
while true do
	local level = pdk.next_level(trials, { resolution = settings.resolution })
	if not level then
		break
	end
	local ticket = session:submit({ perturbations = { { name = settings.perturbation, level = level } } })
	table.insert(trials, { level = level, failed = not session:wait(ticket).success })
end

local rows = {}
for _, trial in trials do
	table.insert(rows, { trial.level, if trial.failed then "failed" else "survived" })
end
pdk.table({ "level", settings.driver }, rows)
