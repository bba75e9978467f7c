-- Dirty lens: smudges sit on the lens, far too close to be in focus. They are drawn sharp on a mask, blurred
-- there, and the mask then tells how much of each pixel is seen and how much is dirt.

local DIRT = { 74, 66, 54 } -- Dried mud, lit from behind.

return {
    doc = "Blurred smudges of dirt on the lens",
    family = "lens",

    parameters = {
        { name = "smudges", levels = { 4, 7, 11, 16, 22 }, min = 0, max = 200, doc = "How many smudges there are" },
        { name = "opacity", levels = { 0.45, 0.55, 0.65, 0.75, 0.85 }, min = 0, max = 1,
          doc = "How much of the picture the densest smudge hides" },
    },

    apply = function(image, cx)
        local width, height = image.width, image.height
        -- The dirt stays where it is: these draws are the same for all frames of a sequence.
        local random = cx.sequence_random

        local mask = image:copy()
        mask:fill(255, 255, 255)
        for _ = 1, math.round(cx.smudges) do
            local x, y = random:uniform(0, width), random:uniform(0, height)
            local radius = height * random:uniform(0.02, 0.1)
            -- A smudge is a handful of drops that ran into each other, some thicker than others.
            for _ = 1, 8 do
                local dx, dy = random:normal() * radius, random:normal() * radius
                local clear = 255 * (1 - cx.opacity * random:uniform(0.3, 1))
                mask:circle(x + dx, y + dy, radius * random:uniform(0.3, 0.9), clear, clear, clear)
            end
        end
        mask:blur(math.max(height / 6, 1))

        local pixels, clearness = image.pixels, mask.pixels
        local red, green, blue = DIRT[1], DIRT[2], DIRT[3]
        for at = 0, width * height * 3 - 1, 3 do
            local clear = buffer.readu8(clearness, at) / 255
            local dirt = 1 - clear
            buffer.writeu8(pixels, at, buffer.readu8(pixels, at) * clear + red * dirt + 0.5)
            buffer.writeu8(pixels, at + 1, buffer.readu8(pixels, at + 1) * clear + green * dirt + 0.5)
            buffer.writeu8(pixels, at + 2, buffer.readu8(pixels, at + 2) * clear + blue * dirt + 0.5)
        end
    end,
}
