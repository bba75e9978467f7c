-- Banding: lamps on the mains flicker, and a rolling shutter reads the picture row by row. Each row therefore
-- sees the lamps at another moment, and dark bands run over the picture.
--
-- How fast they run is the beat of the flicker and the frame rate: where a frame lasts a whole number of flickers, as
-- at 20 or 25 frames a second under 100 Hz, they would stand still. They never quite do, because no mains keeps its
-- frequency: in Europe it stays within 0.2 Hz of 50, and the lamps flicker twice as often.

return {
    doc = "Dark bands of flickering lamps under a rolling shutter, which roll with the beat of mains and frame rate",
    family = "camera",
    geometry = "kept",
    temporal = "dynamic",
    version = 2,
    mathematics = "v (1 - depth (1 - s cos(2 pi (f (t + readout y / H) + start))) / 2), s = sin(pi f e) / (pi f e)",
    source = "Light of lamps on the mains as a raised cosine, integrated over the exposure e of each row of a rolling shutter",
    draws_per_sequence = "the phase of the mains at its start, and how far f is from its nominal value",

    parameters = {
        { name = "depth", levels = { 0.15, 0.3, 0.45, 0.6, 0.75 }, min = 0, max = 1,
          doc = "How much of the lamps' light is missing between two of their peaks" },
        { name = "flicker", default = 100, min = 0, max = 1000, unit = "Hz",
          doc = "How often the lamps flicker nominally: twice the mains frequency" },
        { name = "drift", default = 0.4, min = 0, max = 10, unit = "Hz",
          doc = "Largest deviation from `flicker`; each sequence draws between half of it and all of it" },
        { name = "readout", default = 0.03, min = 0, max = 1, unit = "s",
          doc = "How long the camera takes from the first row to the last" },
        { name = "exposure", default = 0.003, min = 0, max = 1, unit = "s",
          doc = "How long each row gathers light; the longer, the fainter the bands" },
    },

    apply = function(image, cx)
        local height = image.height

        -- The lamps were switched on at some moment before the sequence began.
        local start = cx.sequence_random:unit()
        local side = if cx.sequence_random:unit() < 0.5 then -1 else 1
        local flicker = cx.flicker + side * cx.drift * cx.sequence_random:uniform(0.5, 1)

        -- What a row sees is the mean over its exposure.
        local turn = math.pi * flicker * cx.exposure
        local seen = if math.abs(turn) > 1e-6 then math.sin(turn) / turn else 1

        for y = 0, height - 1 do
            local seconds = cx.time + cx.readout * y / height
            local phase = 2 * math.pi * (flicker * seconds + start)
            local light = 1 - cx.depth * (0.5 - 0.5 * seen * math.cos(phase))
            image:row_brightness(y, light)
        end
    end,
}
