-- A search strategy that finds out how little it takes to fail: it draws a test, and if that fails, halves the way to it from values at
-- which nothing fails, until it knows to 1/64 of the way where failing begins. Then it draws the next. On the way, a test has to fail
-- from some place on.
--
--   pdk.search({ strategy = require("@pdk/bisection").new({ fog = 0, curvature = 0 }), ... })

local space = require("@pdk/space")

local bisection = {}

local FINEST = 1 / 64

-- `from` has the values of variables at which nothing fails. The others keep what is drawn for them.
function bisection.new(from: { [string]: number })
	local variables, random
	local drawn, share, passes, fails
	local strategy = { batch = 1 }

	function strategy.start(problem, stream)
		variables, random, drawn = problem.variables, stream, nil
		for name, value in from do
			local found
			for _, variable in variables do
				found = if variable.name == name and not variable.values then variable else found
			end
			if not found then
				error(`bisection starts from {name}, which is not a number of the space`, 0)
			elseif value < found.min or value > found.max then
				error(`bisection starts from {name} = {value}; give a value from {found.min} to {found.max}`, 0)
			end
		end
	end

	function strategy.ask(_)
		if drawn then
			share = (passes + fails) / 2
		else
			drawn, share, passes, fails = {}, 1, 0, 1
			for _, variable in variables do
				drawn[variable.name] = space.draw(variable, random)
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
		local result = results[1]
		if result.failure or result.violation > 0 then
			drawn = nil
		elseif result.critical then
			fails = share
			if fails - passes <= FINEST then
				if passes == 0 then
					error("tests fail at the values that bisection starts from, or right beside them; give others", 0)
				end
				drawn = nil
			end
		elseif share == 1 then
			drawn = nil
		else
			passes = share
			drawn = if fails - passes <= FINEST then nil else drawn
		end
	end

	return strategy
end

return bisection
