-- Banding: lamps on the mains flicker, and a rolling shutter reads the picture row by row. Each row therefore
-- sees the lamps at another moment, and dark bands run over the picture.

return {
    doc = "Dark bands of flickering lamps under a rolling shutter",
    family = "camera",
    temporal = "dynamic",
    mathematics = "v (1 - depth (1 - cos(2 pi (flicker (t + readout y / H) + start))) / 2)",
    source = "Light of lamps on the mains as a raised cosine, sampled row by row by a rolling shutter",
    draws_per_sequence = "the phase of the mains at its start",

    parameters = {
        { name = "depth", levels = { 0.15, 0.3, 0.45, 0.6, 0.75 }, min = 0, max = 1,
          doc = "How much of the light is missing in the middle of a band" },
        { name = "flicker", default = 100, min = 0, max = 1000, unit = "Hz",
          doc = "How often the lamps flicker: twice the mains frequency" },
        { name = "readout", default = 0.03, min = 0, max = 1, unit = "s",
          doc = "How long the camera takes from the first row to the last" },
    },

    apply = function(image, cx)
        local pixels, height = image.pixels, image.height
        local row_bytes = image.width * 3

        -- The lamps were switched on at some moment before the sequence began.
        local start = cx.sequence_random:unit()

        for y = 0, height - 1 do
            local seconds = cx.time + cx.readout * y / height
            local phase = 2 * math.pi * (cx.flicker * seconds + start)
            local light = 1 - cx.depth * (0.5 - 0.5 * math.cos(phase))

            for at = y * row_bytes, (y + 1) * row_bytes - 1 do
                buffer.writeu8(pixels, at, buffer.readu8(pixels, at) * light + 0.5)
            end
        end
    end,
}
