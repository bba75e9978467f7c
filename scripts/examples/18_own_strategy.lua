-- A search strategy in Lua: it halves the range in which the driver begins to fail.

local low, high = 0, 4
local middle

local found = pdk.search({
	space = { level = { real = { 0, 4 } } },
	objectives = { criticality = "minimise" },
	strategy = {
		batch = 1,
		ask = function()
			middle = (low + high) / 2
			return if high - low < 0.25 then {} else { { level = middle } }
		end,
		tell = function(results)
			if results[1].critical then
				high = middle
			else
				low = middle
			end
		end,
	},
	evaluate = function(values)
		return { perturbations = { { name = "fog_filter", level = values.level } } }
	end,
	simulator = "lane",
	driver = "dave2",
	images_every = 0,
	stop = { evaluations = 20 },
})
print(`dave2 fails from level {high} on ({found.evaluations} drives)`)
