-- What search strategies in Lua need of a space.
--
--   local space = require("@pdk/space")

local space = {}

-- A value of a variable, each as likely as the others.
function space.draw(variable, random): any
	if variable.values then
		return variable.values[random:integer(1, #variable.values)]
	elseif variable.type == "integer" then
		return random:integer(variable.min, variable.max)
	end
	return random:uniform(variable.min, variable.max)
end

return space
