-- What perturbations do to the predictions of a model, frame by frame, on a recorded dataset.
--
--   pdk run offline --set dataset=DIR --set model=FILE.onnx

local study = require("@pdk/study")

local settings = pdk.settings({
	dataset = "", -- a recording: a folder or a file, see docs/guide/datasets.md
	model = "", -- for the driver onnx: frame in, steering and throttle out
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
	level_scale = "", -- the scale that they are on; none: the published one. What does not reach all levels is left out
	frames = 0, -- how many frames from the first; 0 for all
	tolerance = 0.1, -- the drift of the steering for which the table says from which level on it is exceeded
	trust = false, -- rank a driver that is worse than a constant on the frames as they are
})

assert(settings.dataset ~= "", "name the recording with --set dataset=DIR")
local driver = if type(settings.driver) == "string" then { name = settings.driver } else settings.driver
if settings.model ~= "" then
	driver.model = settings.model
elseif driver.name == "onnx" and not driver.model then
	error("name the model with --set model=FILE.onnx, or a driver with --set driver=NAME", 0)
end

-- Empty lists and levels out of range are left to `pdk.evaluate`, which refuses them.
local perturbations, levels = settings.perturbations, {}
for _, level in settings.levels do
	table.insert(levels, level)
end
table.sort(levels)
if settings.level_scale ~= "" and #perturbations > 0 and #levels > 0 and levels[1] >= 0 and levels[#levels] <= 4 then
	for _, perturbation in settings.perturbations do
		if type(perturbation) ~= "string" or string.find(perturbation, "[,@]") then
			error("with level_scale, perturbations are names alone, without parameters and modifiers", 0)
		end
	end
	perturbations = {}
	for _, name in study.reaching(settings.perturbations, levels, settings.level_scale) do
		table.insert(perturbations, { name = name, level_scale = settings.level_scale })
	end
end

pdk.show(pdk.evaluate({
	dataset = settings.dataset,
	driver = driver,
	perturbations = perturbations,
	levels = settings.levels,
	frames = if settings.frames > 0 then settings.frames else nil,
	tolerance = settings.tolerance,
	trust = settings.trust,
}))
