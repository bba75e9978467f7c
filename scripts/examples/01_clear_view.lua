-- One drive with a clear view, and what its outcome says.

local outcome = pdk.drive({ simulator = "lane", driver = "dave2", scenarios = { {} } })[1]

pdk.table({ "field", "value" }, {
	{ "cause", outcome.cause },
	{ "verdict", outcome.verdict },
	{ "time s", outcome.time },
	{ "mean |XTE| m", outcome.mean_cross_track_error },
	{ "wheel over the line s", outcome.measures.over_line_seconds },
	{ "jerk m/s³ (rms)", outcome.measures.rms_jerk },
})
