-- What perturbations do to the predictions of a model, frame by frame, on a recorded dataset.
--
--   pdk run scripts/offline.lua --set dataset=DIR --set model=FILE.onnx

local settings = pdk.settings({
	dataset = "", -- a DonkeyCar tub, or a folder of images with records
	model = "", -- frame in, steering and throttle out
	driver = { name = "onnx" },
	perturbations = {
		"gaussian_noise",
		"poisson_noise",
		"impulse_noise",
		"speckle_noise_filter",
		"gaussian_blur",
		"motion_blur",
		"defocus_blur",
		"increase_brightness",
		"contrast",
		"grayscale_filter",
	},
	levels = { 0, 1, 2, 3, 4 },
	frames = 0, -- how many frames from the first; 0 for all
})

assert(settings.dataset ~= "", "name the recording with --set dataset=DIR")
assert(settings.model ~= "", "name the model with --set model=FILE.onnx")
local driver = if type(settings.driver) == "string" then { name = settings.driver } else settings.driver
driver.model = settings.model

pdk.show(pdk.evaluate({
	dataset = settings.dataset,
	driver = driver,
	perturbations = settings.perturbations,
	levels = settings.levels,
	frames = if settings.frames > 0 then settings.frames else nil,
}))
