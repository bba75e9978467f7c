-- A trained patch on the road beside plain ones of the same size: on how many roads the driver leaves the lane.

local settings = pdk.settings({
	driver = "dave2",
	picture = "dave2_patch",
	sizes = { 2, 3 },
	stretch = 3,
	distance = 10,
	spacing = 0,
	pose = "flat",
	-- What the camera sees the patch through, such as { name = "rain_by_rate", level = 2 }.
	under = {} :: { any },
	roads = 2,
	duration = 6,
})

local function chain(size: number, show: string): { any }
	local flat = settings.pose == "flat"
	local patch = {
		name = "adversarial_patch",
		picture = settings.picture,
		show = show,
		size = size,
		pose = settings.pose,
		stretch = if flat then settings.stretch else nil,
		distance = settings.distance,
		spacing = settings.spacing,
	}
	return { patch, table.unpack(settings.under) }
end

local scenarios, rows, row_of = {}, {}, {}
for _, size in settings.sizes do
	for _, shown in { { "picture", "trained" }, { "mean", "mean colour" }, { "grey", "grey" } } do
		local show, what = table.unpack(shown)
		table.insert(rows, { patch = `{what}, {size} m wide`, failed = 0, far = 0 })
		for seed = 1, settings.roads do
			table.insert(row_of, rows[#rows])
			table.insert(scenarios, {
				name = `{what} {size} m, road {seed}`,
				driver = settings.driver,
				duration = settings.duration,
				road = pdk.road({ seed = seed, attempts = 100 }).road,
				perturbations = chain(size, show),
			})
		end
	end
end

for i, outcome in pdk.drive({ simulator = "lane", scenarios = scenarios }) do
	local row = row_of[i]
	row.failed += if outcome.cause == "lane_departure" then 1 else 0
	row.far = math.max(row.far, outcome.max_cross_track_error)
end
local lines = {}
for _, row in rows do
	table.insert(lines, { row.patch, `{row.failed} of {settings.roads}`, string.format("%.2f", row.far) })
end
pdk.table({ "patch", "left the lane", "largest cross-track error m" }, lines)
