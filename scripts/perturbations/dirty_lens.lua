-- Dirty lens: smudges sit on the lens, far too close to be in focus. They are drawn sharp on a mask and blurred
-- there; the mask then tells how much of each pixel is dirt.

local MASK_HEIGHT = 180 -- As blurred as the mask is, more rows than this show nothing more.

return {
    doc = "Blurred smudges of dirt on the lens",
    family = "lens",
    geometry = "kept",
    version = 2,
    mathematics = "v + m (mud - v) / 255, m = G * (255 opacity d), d the thickness of the uppermost drop",
    source = "Out-of-focus dirt as an opacity blurred by a Gaussian of about 1/40 of the frame's height",
    draws_per_sequence = "where the drops of each smudge are, how large and how thick they are",

    parameters = {
        { name = "smudges", levels = { 4, 7, 11, 16, 22 }, min = 0, max = 200, doc = "How many smudges there are" },
        { name = "opacity", levels = { 0.45, 0.55, 0.65, 0.75, 0.85 }, min = 0, max = 1,
          doc = "How much of the picture the densest smudge hides" },
    },

    apply = function(image, cx)
        -- The dirt stays where it is: these draws are the same for all frames of a sequence.
        local random = cx.sequence_random

        local scale = math.min(MASK_HEIGHT / image.height, 1)
        local width, height = math.max(image.width * scale, 1), math.max(image.height * scale, 1)
        local mask = image:blank(width, height)
        for _ = 1, math.round(cx.smudges) do
            local x, y = random:uniform(0, width), random:uniform(0, height)
            local radius = height * random:uniform(0.02, 0.1)
            -- A smudge is a handful of drops that ran into each other, some thicker than others.
            for _ = 1, 8 do
                local dx, dy = random:normal() * radius, random:normal() * radius
                local dense = 255 * cx.opacity * random:uniform(0.3, 1)
                mask:circle(x + dx, y + dy, radius * random:uniform(0.3, 0.9), dense, dense, dense)
            end
        end
        mask:blur(math.max(height / 6.4, 1))

        image:tint(74, 66, 54, mask) -- Dried mud, lit from behind.
    end,
}
