-- The embedded simulator in easy, standard and hard conditions, and at night.

local function lane(parameters)
	parameters.name = "lane"
	return parameters
end

pdk.show(pdk.drive({
	driver = "dave2",
	duration = 60,
	scenarios = {
		{ name = "easy", simulator = lane({ conditions = "easy" }) },
		{ name = "standard", simulator = lane({ conditions = "standard" }) },
		{ name = "hard", simulator = lane({ conditions = "hard" }) },
		{ name = "night", simulator = lane({ conditions = "standard", light = "night" }) },
	},
}))
