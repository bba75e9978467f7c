-- Two perturbations alone and one after the other. A frame goes through a chain in the order of the list.

local fog = { name = "fog_filter", level = 2 }
local blur = { name = "motion_blur", level = 3 }

pdk.show(pdk.drive({
	simulator = "lane",
	driver = "dave2",
	scenarios = {
		{ name = "fog", perturbations = { fog } },
		{ name = "blur", perturbations = { blur } },
		{ name = "fog, then blur", perturbations = { fog, blur } },
	},
}))
