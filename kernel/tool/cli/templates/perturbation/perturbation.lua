-- A perturbation for pdk: put this file into a folder and name the folder with --plugins.
-- See it:    pdk --plugins . perturb IMAGE --with {{name}}@2 -o out.png
-- Check it:  pdk check {{name}}.lua

return {
	doc = "Darkens the frame from the top down, as a sun visor does",
	family = "custom",
	geometry = "kept", -- Everything stays in its place, so labels of frames stay true.
	mathematics = "v / 3 in the upper `share` of the rows",
	source = "A pane of tinted glass that lets a third of the light through",
	parameters = {
		{ name = "share", levels = { 0.1, 0.15, 0.2, 0.3, 0.4 }, min = 0, max = 1, doc = "share of the height that is dark" },
	},

	-- `image` holds a copy of the frame; change it in place. Nothing may be kept from one frame to the next, because any
	-- frame has to come out the same on its own: take numbers from cx.frame_random, or from cx.sequence_random for what
	-- is the same in all frames, and say so in the fields draws_per_frame and draws_per_sequence.
	apply = function(image: Image, cx: Context)
		local visor = image:copy()
		visor:brightness(1 / 3)
		local shade = image:blank()
		shade:rectangle(0, 0, image.width, image.height * cx.share, 255, 255, 255)
		image:blend_through(visor, shade)
	end,
}
