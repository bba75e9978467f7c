-- Two fifths of the frame: those that matter most to the network, by a saliency method, and those that matter least.

local by = { name = "hirescam", model = "dave2" }

pdk.show(pdk.drive({
	simulator = "lane",
	driver = "dave2",
	scenarios = {
		{ name = "what matters most", perturbations = { { name = "false_color_filter", level = 4, where = { top = 40, by = by } } } },
		{ name = "what matters least", perturbations = { { name = "false_color_filter", level = 4, where = { bottom = 40, by = by } } } },
	},
}))
