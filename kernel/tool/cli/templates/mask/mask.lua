-- A mask for pdk: put this file into a folder and name the folder with --plugins.
-- See it:    pdk --plugins . perturb IMAGE --with '{{perturbation}},where={"mask":"{{name}}"}' -o out.png
-- Check it:  pdk check {{name}}.lua

return {
	doc = "Bright parts of the lower half, such as markings on the road",
	parameters = {
		{ name = "brightness", default = 150, min = 0, max = 255, doc = "how bright a pixel is at least" },
	},

	-- `image` holds a copy of the frame. Make a picture of it whose brightness says how much of each pixel is perturbed:
	-- black stays as it is, white is perturbed.
	mask = function(image: Image, cx: Context)
		local pixels, row = image.pixels, image.width * 3
		for y = 0, image.height - 1 do
			for x = 0, row - 3, 3 do
				local at = y * row + x
				local light = (buffer.readu8(pixels, at) + buffer.readu8(pixels, at + 1) + buffer.readu8(pixels, at + 2)) / 3
				local value = if y >= image.height / 2 and light >= cx.brightness then 255 else 0
				for channel = 0, 2 do
					buffer.writeu8(pixels, at + channel, value)
				end
			end
		end
	end,
}
