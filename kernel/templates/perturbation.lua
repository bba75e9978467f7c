-- A perturbation for pdk: put this file into a folder and name the folder with --plugins.
-- See it:  pdk --plugins . perturb IMAGE --with {{name}}@2 -o out.png

return {
	doc = "Darkens the frame from the top down, as a sun visor does",
	family = "custom",
	parameters = {
		{ name = "share", levels = { 0.1, 0.15, 0.2, 0.3, 0.4 }, min = 0, max = 1, doc = "share of the height that is dark" },
	},

	-- `image` holds a copy of the frame; change it in place.
	apply = function(image, cx)
		local pixels, width = image.pixels, image.width
		local rows = math.floor(image.height * cx.share)
		for offset = 0, rows * width * 3 - 1 do
			buffer.writeu8(pixels, offset, buffer.readu8(pixels, offset) // 3)
		end
	end,
}
