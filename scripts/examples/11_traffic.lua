-- A slow vehicle ahead and oncoming traffic. A driver that does not brake ends with a collision.

pdk.show(pdk.drive({
	simulator = { name = "lane", vehicle_ahead = 20, vehicle_ahead_speed = 4, oncoming = 20 },
	duration = 60,
	scenarios = {
		{ name = "dave2, which follows", driver = "dave2" },
		{ name = "lane_keeper, which does not brake", driver = "lane_keeper" },
	},
}))
