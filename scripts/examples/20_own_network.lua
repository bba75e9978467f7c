-- A network in an ONNX file as the driver: frames in, steering and throttle out. `pdk show FILE.onnx` prints what it has.
-- The file here is in pdk's source tree; use your own with --set model=FILE.onnx.

local settings = pdk.settings({ model = pdk.path("../models/dave2.onnx"), level = 2 })

pdk.show(pdk.drive({
	simulator = "lane",
	driver = { name = "onnx", model = settings.model },
	scenarios = { { name = "nominal" }, { perturbations = { { name = "motion_blur", level = settings.level } } } },
}))
