-- The same perturbation on a part of the frame: a box, a polygon, and every frame only with a chance.

local function noise(extra)
	local perturbation = { name = "gaussian_noise", level = 4 }
	for field, value in extra do
		perturbation[field] = value
	end
	return { perturbation }
end

pdk.show(pdk.drive({
	simulator = "lane",
	driver = "dave2",
	scenarios = {
		{ name = "whole frame", perturbations = noise({}) },
		{ name = "lower half", perturbations = noise({ region = { box = { 0, 0.5, 1, 1 } } }) },
		{ name = "a corner", perturbations = noise({ region = { polygon = { { 0, 0 }, { 0.5, 0 }, { 0, 0.5 } } } }) },
		{ name = "every third frame or so", perturbations = noise({ probability = 0.33 }) },
	},
}))
