-- A dark bar that swings over the frame, in step with the simulation time.

return {
	doc = "A windscreen wiper that swings over the frame",
	family = "custom",
	temporal = "dynamic",
	parameters = {
		{ name = "swing", levels = { 4, 3, 2, 1.5, 1 }, min = 0.2, max = 60, unit = "s", doc = "seconds for a swing to the right and back" },
		{ name = "width", default = 0.04, min = 0.001, max = 1, doc = "width of the bar, as a share of the frame's width" },
	},
	apply = function(image: Image, cx: Context)
		local share = 0.5 - 0.5 * math.cos(2 * math.pi * cx.time / cx.swing)
		local width = math.max(1, math.floor(cx.width * image.width))
		local left = math.floor(share * (image.width - width))
		image:rectangle(left, 0, width, image.height, 20, 20, 20)
	end,
}
