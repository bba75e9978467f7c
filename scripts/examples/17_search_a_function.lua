-- Any function can be searched, without a drive: here the two objectives of a textbook problem (Schaffer, 1985).

local result = pdk.search({
	space = { x = { real = { -10, 10 } } },
	objectives = { near_zero = "minimise", near_two = "minimise" },
	strategy = { name = "nsga2", population = 20 },
	evaluate = function(values)
		return { objectives = { near_zero = values.x ^ 2, near_two = (values.x - 2) ^ 2 } }
	end,
	reference = { near_zero = 10, near_two = 10 },
	stop = { evaluations = 400 },
})
local last = result.convergence[#result.convergence]
print(`{#result.front} compromises, hypervolume {string.format("%.1f", last.hypervolume)} of at most 100`)
