-- Roads by name: degrees turned at each node, and metres between nodes.

return {
	names = { "straight", "bend", "slalom" },
	straight = { angles = { 0, 0, 0, 0 }, segment = 25 },
	bend = { angles = { 0, 12, 12, 0 }, segment = 25 },
	slalom = { angles = { 0, 15, -25, 25, -15 }, segment = 25 },
}
