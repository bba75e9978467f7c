-- Intensity that changes during the drive: a fog bank that comes and goes, a flash, and a function of time.

local function swell(time: number): number
	return 2 + 2 * math.sin(time)
end

pdk.show(pdk.drive({
	simulator = "lane",
	driver = "dave2",
	scenarios = {
		{ name = "fog bank", perturbations = { { name = "fog_filter", level = { points = { { 5, 0 }, { 8, 3 }, { 12, 0 } } } } } },
		{ name = "rising fog", perturbations = { { name = "fog_filter", level = { ramp = { from = 0, to = 3, ["end"] = 20 } } } } },
		{ name = "flashes", perturbations = { { name = "increase_brightness", level = { pulse = { level = 4, period = 2, duration = 0.2 } } } } },
		{ name = "swell", perturbations = { { name = "gaussian_noise", level = swell } } },
	},
}))
