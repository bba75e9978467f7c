-- A search strategy that finds out how little it takes to fail: it draws a test, and if that fails, halves the way to it from values at
-- which nothing fails, until it knows to 1/64 of the way where failing begins. Then it draws the next.
--
--   pdk.search({ strategy = require("@pdk/bisection").new({ fog = 0, curvature = 0 }), ... })

local bisection = {}

local FINEST = 1 / 64

-- `from` has the values of variables at which nothing fails. The others keep what is drawn for them.
function bisection.new(from: { [string]: number })
	local variables, random
	local drawn, share, passes, fails
	local strategy = { batch = 1 }

	function strategy.start(problem, stream)
		variables, random, drawn = problem.variables, stream, nil
		for name in from do
			local found
			for _, variable in variables do
				found = found or (variable.name == name and not variable.values)
			end
			if not found then
				error(`bisection starts from {name}, which is not a number of the space`, 0)
			end
		end
	end

	local function draw(variable)
		if variable.values then
			return variable.values[random:integer(1, #variable.values)]
		elseif variable.type == "integer" then
			return random:integer(variable.min, variable.max)
		end
		return random:uniform(variable.min, variable.max)
	end

	function strategy.ask(_)
		if drawn then
			share = (passes + fails) / 2
		else
			drawn, share, passes, fails = {}, 1, 0, 1
			for _, variable in variables do
				drawn[variable.name] = draw(variable)
			end
		end
		local values = table.clone(drawn)
		for _, variable in variables do
			local start = from[variable.name]
			if start then
				local value = start + (drawn[variable.name] - start) * share
				values[variable.name] = if variable.type == "integer" then math.round(value) else value
			end
		end
		return { values }
	end

	function strategy.tell(results)
		if results[1].critical then
			fails = share
		elseif share < 1 then
			passes = share
		end
		if fails == 1 and share == 1 and not results[1].critical or fails - passes <= FINEST then
			drawn = nil
		end
	end

	return strategy
end

return bisection
