-- A search strategy of one's own: climbs from the best candidate so far, and starts anew where that leads nowhere. Takes the sum of
-- the objectives, with a critical candidate before any other.
--
--   pdk.search({ strategy = require("@pdk/hill_climber").new(), ... })

local space = require("@pdk/space")

local climber = {}

function climber.new(patience: number?)
	local variables, random
	local best, best_score, idle = nil, math.huge, 0
	local strategy = { batch = 8 }

	function strategy.start(problem, stream)
		variables, random = problem.variables, stream
	end

	function strategy.ask(n)
		local candidates = {}
		for i = 1, n do
			local moved = random:integer(1, #variables)
			candidates[i] = {}
			for place, variable in variables do
				candidates[i][variable.name] = if best and place ~= moved then best[variable.name] else space.draw(variable, random)
			end
		end
		return candidates
	end

	function strategy.tell(results)
		for _, result in results do
			local score = if result.failure or result.violation > 0 then math.huge else 0
			for _, objective in result.objectives do
				score += objective - (if result.critical then 1e6 else 0)
			end
			idle += 1
			if score < best_score then
				best, best_score, idle = result.values, score, 0
			elseif idle > (patience or 100) then
				best, best_score, idle = nil, math.huge, 0
			end
		end
	end

	return strategy
end

return climber
